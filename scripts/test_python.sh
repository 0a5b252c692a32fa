#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the wheel of apps/python, installs it into a virtual environment (build/python-venv) and runs the tests of
# tests/python; those of raysplats.torch need PyTorch, which is taken from the system: apt-get install python3-torch.
# usage: scripts/test_python.sh [PYTEST ARGUMENT...]     PYTHON=... chooses the interpreter
# Ends with 77 after "SKIPPED why" when what it needs cannot be downloaded.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# The first interpreter that has PyTorch, else the first that there is.
choose_python() {
  local candidate
  for candidate in "${PYTHON:-}" python3 /usr/bin/python3; do
    if [[ -z $candidate ]] || ! command -v "$candidate" >/dev/null; then continue; fi
    if [[ -n ${PYTHON:-} ]] || "$candidate" -c 'import torch' 2>/dev/null; then
      echo "$candidate"
      return
    fi
  done
  command -v python3 || true
}

python=$(choose_python)
if [[ -z $python ]]; then
  echo "SKIPPED no python3: apt-get install python3 python3-dev python3-venv"
  exit 77
fi
environment=$PWD/build/python-venv
if [[ ! -x $environment/bin/pip || $(cat "$environment/made-by" 2>/dev/null) != "$python" ]]; then
  rm -rf -- "$environment"
  if ! "$python" -m venv --system-site-packages "$environment"; then
    echo "SKIPPED $python makes no virtual environments: apt-get install python3-venv"
    exit 77
  fi
  echo "$python" >"$environment/made-by"
fi
if ! "$environment/bin/pip" install -q 'scikit-build-core>=1.0' 'nanobind>=3.0' 'numpy>=1.24' pytest pillow; then
  echo "SKIPPED what the wheel is built and tested with cannot be downloaded"
  exit 77
fi

# For tests alone, an independent reader of model files; numpy stays the one that PyTorch goes with.
numpy=$("$environment/bin/python" -c 'import numpy; print(numpy.__version__)')
"$environment/bin/pip" install -q 'gsply[sogs]>=0.4.6' zstandard "numpy==$numpy" ||
  echo "SKIPPED the tests with gsply: it cannot be downloaded"

begin=$SECONDS
# The name by which CMake calls the compiler elsewhere, so that ccache knows what other builds have compiled.
CXX=${CXX:-c++} "$environment/bin/pip" install -q --no-build-isolation --no-deps --force-reinstall ./apps/python
echo "The wheel: $((SECONDS - begin)) s"
"$environment/bin/python" -m pytest -q -p no:cacheprovider tests/python "$@"
if ! "$environment/bin/python" -c 'import torch' 2>/dev/null; then
  echo "SKIPPED the tests of raysplats.torch: no PyTorch (apt-get install python3-torch)"
fi
