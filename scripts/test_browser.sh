#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Opens `raysplats view` and reports in a real Chromium without a screen and uses them: tests/view/browser_*_test.py and
# tests/report/browser_test.py.
# usage: scripts/test_browser.sh [PROGRAM] [SCREENSHOTS]     (default: build/release/bin/raysplats, no screenshots)
# Installs Debian's chromium, chromium-driver and python3-selenium when they are missing and root may. Ends with 77 and
# a line "SKIPPED why" where they cannot be had.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
program=${1:-$root/build/release/bin/raysplats}

skip() {
  echo "SKIPPED $*"
  exit 77
}

packages=(chromium chromium-driver python3-selenium)
# Debian's Python has Debian's selenium; another one in PATH may not.
python=/usr/bin/python3
have() {
  command -v chromium >/dev/null && command -v chromedriver >/dev/null && "$python" -c 'import selenium' 2>/dev/null
}
if ! have; then
  if ! command -v apt-get >/dev/null || ((EUID != 0)); then
    skip "no Chromium with selenium: apt-get install ${packages[*]}"
  fi
  DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${packages[@]}" ||
    { apt-get update -q && DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${packages[@]}"; } ||
    skip "${packages[*]} cannot be installed"
  have || skip "chromium, chromedriver or selenium do not start"
fi
[[ -x $program ]] || { echo "$program is missing: build it with scripts/setup.sh" >&2; exit 1; }
failed=0
for test in "$root"/tests/view/browser_*_test.py "$root/tests/report/browser_test.py"; do
  "$python" "$test" "$program" ${2:+"$2"} || failed=1
done
exit $failed
