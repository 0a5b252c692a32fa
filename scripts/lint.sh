#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Checks the format of C++ and OpenCL sources, the kernels' warnings without any device, and clang-tidy on the
# compile database of build/release.
# usage: scripts/lint.sh [FILE...]     (default: every file of the project)
# Needs the Debian packages clang-14 (or clang), clang-format and clang-tidy.
set -euo pipefail
called_from=$PWD
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf '== %s\n' "$*"; }

clang=$(command -v clang-14 || command -v clang || true)
for tool in "${clang:-clang-14}" clang-format clang-tidy; do
  if ! command -v "$tool" >/dev/null; then
    echo "$tool is not installed: apt-get install clang-14 clang-format clang-tidy" >&2
    exit 1
  fi
done

if (($# > 0)); then
  files=()
  for file in "$@"; do
    files+=("$(realpath --relative-to=. -- "$(cd "$called_from" && realpath -- "$file")")")
  done
else
  mapfile -t files < <(git ls-files -- '*.cpp' '*.hpp' '*.cl' '*.h')
fi
sources=()
kernels=()
for file in "${files[@]}"; do
  case $file in
    # Not part of the compile database: built against an installed copy, and into the wheel.
    tests/package/consumer/* | apps/python/* | scripts/cmake/bundle/*) ;;
    *.cpp) sources+=("$file") ;;
    *.cl) kernels+=("$file") ;;
  esac
done
failed=()

say "clang-format: ${#files[@]} files"
clang-format --dry-run -Werror "${files[@]}" || failed+=(clang-format)

say "Kernel warnings: ${#kernels[@]} files"
for kernel in "${kernels[@]}"; do
  "$clang" -x cl -cl-std=CL1.2 -target spir64 -Xclang -finclude-default-header -Icl -Wall -Wextra -Werror \
    -fsyntax-only "$kernel" || failed+=("$kernel")
done

if ((${#sources[@]} > 0)); then
  say "clang-tidy: ${#sources[@]} files"
  [[ -e build/release/compile_commands.json ]] || cmake --preset release >/dev/null
  printf '%s\0' "${sources[@]}" |
    xargs -0 -n 1 -P "$(nproc)" clang-tidy -p build/release --quiet 2> >(grep -v 'warnings generated' >&2) ||
    failed+=(clang-tidy)
fi

if ((${#failed[@]} > 0)); then
  say "Failed: ${failed[*]}"
  exit 1
fi
say "Clean"
