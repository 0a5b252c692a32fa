#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Fuzzes the parsers, one target after the other, under AddressSanitizer and UndefinedBehaviorSanitizer, from the
# corpora of tests/fuzz and what earlier runs found. Inputs that end a target stay in BUILD/findings.
# usage: scripts/reliability/fuzz.sh [SECONDS] [TARGET...]     (default: 300 seconds for each of all targets)
# BUILD is the build folder (default: build/fuzz, made by the preset fuzz). Needs the Debian package clang.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

say() { printf '== %s\n' "$*"; }

seconds=${1:-300}
if ! [[ $seconds =~ ^[0-9]+$ ]]; then
  echo "usage: scripts/reliability/fuzz.sh [SECONDS] [TARGET...]" >&2
  exit 2
fi
shift $(($# > 0 ? 1 : 0))
build=${BUILD:-build/fuzz}
targets=("$@")
if ((${#targets[@]} == 0)); then
  for source in tests/fuzz/*_fuzz.cpp; do
    name=$(basename "$source" _fuzz.cpp)
    targets+=("$name")
  done
fi

[[ -e $build/build.ninja ]] || cmake --preset fuzz -B "$build"
cmake --build "$build" --target "${targets[@]/#/fuzz_}"
mkdir -p "$build/findings"
export LSAN_OPTIONS=suppressions=$PWD/tests/sanitizers/lsan.supp:print_suppressions=0
failed=()
for target in "${targets[@]}"; do
  mkdir -p "$build/corpus/$target"
  say "$target: $seconds seconds"
  log=$build/findings/$target.log
  # 1 GiB and 10 seconds for an input of at most 64 KiB: more is a finding too.
  if ! "$build/bin/fuzz_$target" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=1024 -malloc_limit_mb=512 \
    -max_len=65536 -print_final_stats=1 -artifact_prefix="$build/findings/$target-" \
    "$build/corpus/$target" "tests/fuzz/corpus/$target" >"$log" 2>&1; then
    failed+=("$target")
    tail -n 40 "$log"
  fi
  grep -E 'stat::(number_of_executed_units|peak_rss_mb)|cov: [0-9]+ ft: [0-9]+ corp' "$log" | tail -n 3 || true
done
if ((${#failed[@]} > 0)); then
  say "Findings in: ${failed[*]} (see $build/findings)"
  exit 1
fi
say "No findings"
