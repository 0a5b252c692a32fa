#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Prints the Python that plot.py can run with: PYTHON if it is given, else whichever of two has
# matplotlib.
set -euo pipefail
for python in ${PYTHON:-python3 /usr/bin/python3}; do
  if "$python" -c 'import matplotlib' 2>/dev/null; then
    echo "$python"
    exit
  fi
done
echo "${PYTHON:-python3} has no matplotlib: install the Debian package python3-matplotlib, or name another interpreter with PYTHON" >&2
exit 1
