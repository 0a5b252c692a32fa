#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs unit tests in the form that GPUs get (packets as work-groups, shared gradient sums, bounded launches) on
# whatever OpenCL implementation is at hand: a small preloaded library makes every device say that it is a GPU.
# usage: scripts/gpu_path.sh [-R REGEX] [--cases GLOBS] [--build BUILD]
#   -R REGEX       test programs, as ctest names them (default: ^(trace|train)$; others: primitives, bvh, light, bench)
#   --cases GLOBS  test cases, comma-separated globs (default: all)
#   --build BUILD  build folder with the test programs (default: build/release)
# Needs a C compiler and built tests (scripts/setup.sh --tests). There are no known exceptions on PoCL 3.1.
set -euo pipefail
called_from=$PWD
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf '== %s\n' "$*"; }

pattern='^(trace|train)$'
cases='*'
build=$PWD/build/release
while (($# > 0)); do
  case $1 in
    -R | --cases | --build)
      (($# > 1)) || {
        echo "$1 needs a value" >&2
        exit 2
      }
      case $1 in
        -R) pattern=$2 ;;
        --cases) cases=$2 ;;
        --build) build=$(cd "$called_from" && realpath -- "$2") ;;
      esac
      shift 2
      ;;
    *)
      echo "$1 is no option: scripts/gpu_path.sh [-R REGEX] [--cases GLOBS] [--build BUILD]" >&2
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
"${CC:-cc}" -shared -fPIC -O1 -Wall -Wextra -Werror -o "$work/say_gpu.so" tests/gpu_path/say_gpu.c -ldl
# Apart from the user's kernels and tunings, which belong to the device as it is.
export XDG_CACHE_HOME=$build/gpu_path_cache

failed=()
for program in "${programs[@]}"; do
  name=${program##*/test_}
  say "$name as on a GPU"
  LD_PRELOAD=$work/say_gpu.so "$program" --test-case="$cases" |
    tee "$work/$name.log" || failed+=("$name")
  if ! grep -Eq 'test cases: +[1-9]' "$work/$name.log"; then
    failed+=("$name: no test case matches $cases")
  fi
done

if ((${#failed[@]} > 0)); then
  printf '== Failed: %s\n' "${failed[@]}"
  exit 1
fi
say "Passed as on a GPU: ${programs[*]##*/test_}"
