#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs unit tests in the form that GPUs get (packets as work-groups, shared gradient sums, bounded launches) on
# whatever OpenCL implementation is at hand: a small preloaded library makes every device say that it is a GPU.
# usage: scripts/gpu_path.sh [-R REGEX] [--cases GLOBS] [--but GLOBS] [--as-it-is] [--build BUILD] [--cache DIR]
#   -R REGEX       test programs, as ctest names them (default: ^(trace|train)$; others: parallel, bvh, light, bench)
#   --cases GLOBS  test cases, comma-separated globs (default: all)
#   --but GLOBS    but for these
#   --as-it-is     devices say what they are: the same programs without the library, to compare
#   --build BUILD  build folder with the test programs (default: build/release)
#   --cache DIR    keeps compiled kernels (default: BUILD/gpu_path_cache)
# Needs a C compiler and built tests (scripts/setup.sh --tests). Exceptions on PoCL 3.1, which docs/gpu.md explains: of train
# 'a sky pays outdoors*', and where the machine is slow 'a run by time of few iterations*'.
set -euo pipefail
called_from=$PWD
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf '== %s\n' "$*"; }

pattern='^(trace|train)$'
cases='*'
but=''
form='as on a GPU'
build=$PWD/build/release
cache=
while (($# > 0)); do
  case $1 in
    -R | --cases | --but | --build | --cache)
      (($# > 1)) || {
        echo "$1 needs a value" >&2
        exit 2
      }
      case $1 in
        -R) pattern=$2 ;;
        --cases) cases=$2 ;;
        --but) but=$2 ;;
        --cache) cache=$(cd "$called_from" && realpath -m -- "$2") ;;
        --build) build=$(cd "$called_from" && realpath -- "$2") ;;
      esac
      shift 2
      ;;
    --as-it-is)
      form='as the device is'
      shift
      ;;
    *)
      echo "$1 is no option: scripts/gpu_path.sh [-R REGEX] [--cases GLOBS] [--but GLOBS] [--as-it-is] [--build BUILD] [--cache DIR]" >&2
      exit 2
      ;;
  esac
done

programs=()
for program in "$build"/bin/test_*; do
  [[ -x $program ]] || continue
  name=${program##*/test_}
  [[ $name =~ $pattern ]] && programs+=("$program")
done
if ((${#programs[@]} == 0)); then
  echo "No test program below $build/bin matches $pattern: build the tests first (scripts/setup.sh --tests)" >&2
  exit 1
fi

work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
preloaded=()
if [[ $form == 'as on a GPU' ]]; then
  "${CC:-cc}" -shared -fPIC -O1 -Wall -Wextra -Werror -o "$work/say_gpu.so" tests/gpu_path/say_gpu.c -ldl
  preloaded=(env "LD_PRELOAD=$work/say_gpu.so")
fi
# Apart from the user's kernels and tunings, which belong to the device as it is.
export XDG_CACHE_HOME=${cache:-$build/gpu_path_cache}

failed=()
for program in "${programs[@]}"; do
  name=${program##*/test_}
  say "$name $form"
  "${preloaded[@]}" "$program" --test-case="$cases" --test-case-exclude="$but" |
    tee "$work/$name.log" || failed+=("$name")
  if ! grep -Eq 'test cases: +[1-9]' "$work/$name.log"; then
    failed+=("$name: no test case matches $cases")
  fi
done

if ((${#failed[@]} > 0)); then
  printf '== Failed: %s\n' "${failed[@]}"
  exit 1
fi
say "Passed $form: ${programs[*]##*/test_}"
