#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Sets up, builds everything and runs all tests. Arguments go to ctest, for example: scripts/test.sh -R bvh
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if [[ ${1:-} == --help ]]; then
  sed -n '/^# Sets/s/^# //p' scripts/test.sh
  exit
fi
./scripts/setup.sh --tests
printf '== %s\n' "Running the tests"
ctest --preset release "$@"
