#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs the kernel tests on every OpenCL implementation for CPUs that can be had, with their devices as they are and as GPUs
# (scripts/gpu_path.sh): packets of every width, as vectors and as work-groups. What is not there is fetched, pinned, into a
# folder of its own; nothing is installed. An implementation that cannot be had is SKIPPED with the reason.
# usage: scripts/implementations.sh [--only NAMES] [-R REGEX] [--cases GLOBS] [--with-known] [--build BUILD] [--cache DIR]
#   --only NAMES   comma-separated: pocl, pocl-gpu, intel, intel-gpu, rusticl, rusticl-gpu (default: all)
#   -R REGEX       test programs, as ctest names them (default: ^(device|parallel|bvh|trace|train)$)
#   --cases GLOBS  test cases, comma-separated globs (default: all); known defects of an implementation are left out, and named
#   --with-known   run those too
#   --build BUILD  build folder with the test programs (default: build/release)
#   --cache DIR    keeps implementations and compiled kernels (default: ~/.cache/raysplats-implementations), 1.6 GB
# Fetches 270 MB for Intel's runtime and 90 MB for rusticl, once. Needs python3 with pip, apt-get, and unshare for rusticl.
# Ends with 1 when a test fails, and 77 when nothing that was asked for could be had.
set -euo pipefail
called_from=$PWD
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf '== %s\n' "$*"; }

usage='scripts/implementations.sh [--only NAMES] [-R REGEX] [--cases GLOBS] [--with-known] [--build BUILD] [--cache DIR]'
all=(pocl pocl-gpu intel intel-gpu rusticl rusticl-gpu)
wanted=("${all[@]}")
pattern='^(device|parallel|bvh|trace|train)$'
known=out
cases='*'
build=$PWD/build/release
cache=${XDG_CACHE_HOME:-$HOME/.cache}/raysplats-implementations
while (($# > 0)); do
  case $1 in
    --only | -R | --cases | --build | --cache)
      (($# > 1)) || {
        echo "$1 needs a value" >&2
        exit 2
      }
      case $1 in
        --only) IFS=, read -ra wanted <<<"$2" ;;
        -R) pattern=$2 ;;
        --cases) cases=$2 ;;
        --build) build=$(cd "$called_from" && realpath -- "$2") ;;
        --cache) cache=$(cd "$called_from" && realpath -m -- "$2") ;;
      esac
      shift 2
      ;;
    --with-known)
      known=in
      shift
      ;;
    *)
      echo "$1 is no option: $usage" >&2
      exit 2
      ;;
  esac
done
for name in "${wanted[@]}"; do
  [[ " ${all[*]} " == *" $name "* ]] || {
    echo "--only $name: the implementations are ${all[*]}" >&2
    exit 2
  }
done
mkdir -p "$cache"
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT

# What an implementation gets wrong, by the names of cases; docs/gpu.md says what is known of each.
known() {
  case $1 in
    intel-gpu) echo 'a few gradients of rays in shared sums*,gradients of a few pixels equal*,steps of one?s own train as a run does' ;;
    *) echo '' ;;
  esac
}

fetched() { python3 scripts/gpu/packages.py "$1" "$cache" 2>"$work/reason"; }

# prepare NAME: sets `prefix`, the command that makes the implementation the only one; 77 with a reason in $work/reason.
prepare() {
  prefix=()
  local root icd=$work/icd-$1
  mkdir -p "$icd"
  case ${1%-gpu} in
    pocl)
      cp /etc/OpenCL/vendors/pocl.icd "$icd/" 2>/dev/null || {
        echo "PoCL is not installed: apt-get install pocl-opencl-icd" >"$work/reason"
        return 77
      }
      prefix=(env)
      ;;
    intel)
      root=$(fetched intel-cpu) || return 77
      echo "$root"/intel_opencl_rt-*.data/data/lib/libintelocl.so >"$icd/intel.icd"
      # Its programs from the cache do not tell the types of arguments, and would all be compiled anew to be checked;
      # the test of the check itself switches it on.
      prefix=(env "LD_LIBRARY_PATH=$(printf '%s:' "$root"/*.data/data/lib)" RAYSPLATS_CHECK_ARGUMENTS=0)
      ;;
    rusticl)
      root=$(fetched rusticl) || return 77
      # It reads /usr/lib/clc and wants a newer C library: a view of /usr of its own, with the packages over it.
      unshare --map-root-user --mount mount -t overlay overlay -o "lowerdir=$root/usr:/usr" /usr 2>"$work/reason" || return 77
      echo "/usr/lib/$(uname -m)-linux-gnu/libRusticlOpenCL.so.1" >"$icd/rusticl.icd"
      prefix=(env RUSTICL_ENABLE=llvmpipe unshare --map-root-user --mount "$work/overlay.sh" "$root/usr")
      printf '#!/bin/sh\nmount -t overlay overlay -o "lowerdir=$1:/usr" /usr && shift && exec "$@"\n' >"$work/overlay.sh"
      chmod +x "$work/overlay.sh"
      ;;
  esac
  prefix+=(env "OCL_ICD_VENDORS=$icd")
}

summary=()
failed=0
ran=0
skip() {
  echo "SKIPPED $1: $2"
  summary+=("$1: SKIPPED, $2")
}
for name in "${wanted[@]}"; do
  status=0
  prepare "$name" || status=$?
  if ((status != 0)); then
    skip "$name" "$(tail -n 1 "$work/reason")"
    continue
  fi
  if ! "${prefix[@]}" "$build/bin/raysplats" devices >"$work/devices" 2>&1; then
    skip "$name" "it offers no device: $(tail -n 1 "$work/devices")"
    continue
  fi
  say "$name"
  head -n 2 "$work/devices"
  arguments=(-R "$pattern" --cases "$cases" --build "$build" --cache "$cache/kernels/$name")
  [[ $name == *-gpu ]] || arguments+=(--as-it-is)
  but=$(known "$name")
  if [[ -n $but && $known == out ]]; then
    arguments+=(--but "$but")
    say "Left out, known defects of $name: $but"
  fi
  begin=$SECONDS
  "${prefix[@]}" ./scripts/gpu_path.sh "${arguments[@]}" 2>&1 | tee "$work/$name.log" || status=$?
  ran=1
  result=PASS
  if ((status != 0)); then
    result=FAIL
    failed=1
  fi
  counts=$(sed -nE '/^== Passed/d; s/^== (\w+) as .*/\1/p; s/.*test cases: +([0-9]+) \| +([0-9]+) passed.*/\2 of \1,/p' "$work/$name.log" |
    paste -sd ' ' | sed 's/,$//')
  summary+=("$name: $result in $((SECONDS - begin)) s ($counts)")
done

printf '== %s\n' "${summary[@]}"
((ran == 1)) || exit 77
exit "$failed"
