#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Rewrites the section "All options" of docs/cli.md from what the built program says.
# usage: scripts/cli_help.sh [PROGRAM]     (default: build/release/bin/raysplats)
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
raysplats=${1:-$root/build/release/bin/raysplats}
page=$root/docs/cli.md
new=$(mktemp)
trap 'rm -f "$new"' EXIT
awk '/^## All options$/ { exit } { print }' "$page" >"$new"
{
  printf '## All options\n\nWhat `--help-all` prints (`scripts/cli_help.sh` writes this section).\n'
  for command in devices doctor generate prepare train render eval trace info convert view report bench "bench compare" tune completion manual; do
    # shellcheck disable=SC2086  # two words are two arguments
    help=$("$raysplats" $command --help-all)
    printf '\n```text\n%s\n```\n' "$(sed 's/ *$//' <<<"$help")"
  done
} >>"$new"
cat "$new" >"$page"
