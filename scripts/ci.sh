#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# What CI checks beside the test suite: the Python module, the Debian packages, processes under mpirun, the viewer in a browser, and the form of the kernels that GPUs get,
# without a GPU. Each leg ends with PASS, FAIL or SKIPPED (what it needs cannot be had here: a failed download is no failure)
# and its seconds.
# usage: scripts/ci.sh [BUILD]     (default: build/release, with the tests built)
set -euo pipefail
called_from=$PWD
cd "$(dirname "${BASH_SOURCE[0]}")/.."
build=$PWD/build/release
(($# == 0)) || build=$(cd "$called_from" && realpath -- "$1")

work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
# A case of every kernel that has a form of its own on GPUs, and a whole training run; all: scripts/gpu_path.sh.
gpu_cases='*[tiny]*,steps of one?s own train as a run does'
summary=()
failed=0

# leg NAME COMMAND...: 0 passes unless the output says SKIPPED, 77 skips, all else fails.
leg() {
  local name=$1 status=0 begin=$SECONDS result
  shift
  printf '== %s\n' "$name"
  "$@" 2>&1 | tee "$work/log" || status=$?
  local reasons
  reasons=$(sed -n 's/^SKIPPED //p' "$work/log" | paste -sd ';')
  if ((status == 77)) || { ((status == 0)) && [[ -n $reasons ]]; }; then
    result="SKIPPED in $((SECONDS - begin)) s: ${reasons:-see above}"
  elif ((status == 0)); then
    result="PASS in $((SECONDS - begin)) s"
  else
    result="FAIL in $((SECONDS - begin)) s"
    failed=1
  fi
  printf '== %s: %s\n' "$name" "$result"
  summary+=("$name: $result")
}

# PyTorch is large: users' tests do without it.
python_module() {
  local has=0 candidate
  for candidate in python3 /usr/bin/python3; do
    "$candidate" -c 'import torch' 2>/dev/null && has=1
  done
  if ((has == 0)) && command -v apt-get >/dev/null && ((EUID == 0)); then
    local packages=(python3-torch python3-dev python3-venv)
    install() { DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${packages[@]}" >"$work/apt.log" 2>&1; }
    install || { apt-get update -q >/dev/null && install; } || echo "PyTorch cannot be installed: $(tail -n 1 "$work/apt.log")"
  fi
  ./scripts/test_python.sh
}

gpu_path() {
  if ! command -v "${CC:-cc}" >/dev/null; then
    echo "SKIPPED no C compiler ${CC:-cc}: apt-get install gcc"
    return 77
  fi
  ./scripts/gpu_path.sh --build "$build" --cases "$gpu_cases"
}

vendor() {
  if ! command -v python3 >/dev/null; then
    echo "SKIPPED no python3: apt-get install python3"
    return 77
  fi
  python3 scripts/gpu_compile.py --quiet --skip-missing --targets "$1"
}

intel_cpu() {
  ./scripts/implementations.sh --only intel,intel-gpu --build "$build" -R '^(parallel|bvh|trace|train)$' --cases "$gpu_cases"
}

browser() { ./scripts/test_browser.sh "$build/bin/raysplats"; }

leg "Python" python_module
leg "packages" ./scripts/test_package.sh "$build"
leg "MPI" ./scripts/test_mpi.sh "$build"
leg "GPU path on this OpenCL" gpu_path
leg "Intel's OpenCL for CPUs" intel_cpu
leg "browser" browser
leg "AMD's compiler (gfx1030)" vendor gfx1030
leg "NVIDIA's compiler (sm_86)" vendor sm_86
leg "Intel's compiler (dg2-g10)" vendor dg2-g10

printf '== %s\n' "${summary[@]}"
exit "$failed"
