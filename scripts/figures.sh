#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Measures the program as it stands and writes the tables and plots of docs/; see --help.
set -euo pipefail
exec python3 "$(dirname "${BASH_SOURCE[0]}")/figures/figures.py" "$@"
