#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the part that knows MPI in a build folder and runs the tests of shared work with mpirun, which otherwise are left out.
# usage: scripts/test_mpi.sh [BUILD]     (default: build/release)
# Installs Debian's libopenmpi-dev and openmpi-bin when they are missing and root may. Ends with 77 and a line "SKIPPED
# why" where they cannot be had.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=$(realpath -m -- "${1:-$root/build/release}")
cd "$root"

skip() {
  echo "SKIPPED $*"
  exit 77
}

packages=(libopenmpi-dev openmpi-bin)
have() { command -v mpirun >/dev/null && command -v mpicxx >/dev/null; }
if ! have; then
  if ! command -v apt-get >/dev/null || ((EUID != 0)); then
    skip "no MPI: apt-get install ${packages[*]}"
  fi
  install() { DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${packages[@]}"; }
  install || { apt-get update -q && install; } || skip "${packages[*]} cannot be installed"
  have || skip "mpirun or mpicxx does not start"
fi
[[ -f $build/CMakeCache.txt ]] || { echo "$build is no build: make it with scripts/setup.sh --tests" >&2; exit 1; }
if grep -q '^RAYSPLATS_MPI:[A-Z]*=OFF' "$build/CMakeCache.txt"; then skip "$build is configured with RAYSPLATS_MPI=OFF"; fi
cmake -B "$build" -S . >/dev/null
cmake --build "$build" --target raysplats_cli raysplats_mpi test_comm test_ranks
"$build/bin/test_comm" -m
"$build/bin/test_ranks" -m
