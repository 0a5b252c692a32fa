#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Trains on every capture below a folder with the default settings and tabulates quality; see --help.
set -euo pipefail
exec python3 "$(dirname "${BASH_SOURCE[0]}")/quality/quality.py" "$@"
