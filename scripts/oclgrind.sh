#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs the small kernel tests (their names contain "[small]", or TAG) on Oclgrind, an OpenCL device that checks every memory
# access, data races and the arguments of API calls. Oclgrind's own exit status does not tell, so the
# log must stay empty. Kernels are built without optimisation: Oclgrind 21.10 gets what LLVM makes of a vector
# comparison that is added to integers wrong (it extends true to 255, not 1).
# usage: scripts/oclgrind.sh [--tag TAG] [BUILD]     (default: build/release, brought up to date first)
# The test suite runs the tag [tiny], about a minute; [small] takes many. Needs the Debian package oclgrind; ends with 77
# where that is not installed.
set -euo pipefail
called_from=$PWD
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf '== %s\n' "$*"; }

if ! command -v oclgrind >/dev/null; then
  echo "Skipped, oclgrind is not installed: apt-get install oclgrind" >&2
  exit 77
fi
tag='[small]'
if [[ ${1:-} == --tag ]]; then
  (($# > 1)) || {
    echo "--tag needs a value" >&2
    exit 2
  }
  tag=$2
  shift 2
fi
if (($# > 0)); then
  build=$(cd "$called_from" && realpath -- "$1")
else
  ./scripts/setup.sh --tests
  build=$PWD/build/release
fi

work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
export RAYSPLATS_DEVICE=oclgrind XDG_CACHE_HOME=$work/cache
filter="*$tag*"
ran=0
failed=()
for program in "$build"/bin/test_*; do
  name=$(basename "$program")
  count=$("$program" --list-test-cases --test-case="$filter" | grep -cF -- "$tag" || true)
  ((count > 0)) || continue
  ran=$((ran + count))
  say "$name: $count test cases"
  log=$work/$name.log
  : >"$log"
  if ! oclgrind --data-races --check-api --build-options "-cl-opt-disable -DRS_CALLS" --log "$log" \
    "$program" --test-case="$filter"; then
    failed+=("$name: a test failed")
  fi
  if [[ -s $log ]]; then
    head -n 60 "$log"
    failed+=("$name: $(grep -c . "$log") lines in Oclgrind's log")
  fi
done

if ((ran == 0)); then
  echo "No test case is named $tag below $build/bin: build the tests first" >&2
  exit 1
fi
if ((${#failed[@]} > 0)); then
  printf '== Failed: %s\n' "${failed[@]}"
  exit 1
fi
say "$ran test cases ran clean"
