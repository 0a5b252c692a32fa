#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes the packages of a build. lintian looks at the Debian ones; the program's and the archive (TGZ) are each unpacked into
# an empty folder and used from there: doctor, generate, train, render.
# usage: scripts/test_package.sh [BUILD]     (default: build/release, built)
# Ends with 77 after "SKIPPED why" where packages cannot be made; without lintian all else is done.
set -euo pipefail
called_from=$PWD
cd "$(dirname "${BASH_SOURCE[0]}")/.."
build=$PWD/build/release
(($# == 0)) || build=$(cd "$called_from" && realpath -- "$1")

for tool in cpack dpkg-deb dpkg-shlibdeps; do
  if ! command -v "$tool" >/dev/null; then
    echo "SKIPPED no $tool: apt-get install cmake dpkg-dev"
    exit 77
  fi
done
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT

if ! cpack --config "$build/CPackConfig.cmake" -G "DEB;TGZ" -B "$work/dist" >"$work/log" 2>&1; then
  tail -n 20 "$work/log"
  exit 1
fi
packages=("$work"/dist/*.deb)
printf '%s\n' "${packages[@]##*/}"

if ! command -v lintian >/dev/null && ((EUID == 0)); then
  DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends lintian >"$work/log" 2>&1 || true
fi
if command -v lintian >/dev/null; then
  lintian --allow-root --fail-on error,warning "${packages[@]}"
  echo "lintian: no errors and no warnings"
else
  echo "SKIPPED lintian: apt-get install lintian"
fi

for package in "${packages[@]}"; do
  if [[ ${package##*/} == raysplats_* ]]; then dpkg-deb -x "$package" "$work/root"; fi
done
archives=()
for archive in "$work"/dist/*.tar.gz; do
  archives+=("${archive##*/}")
  mkdir -p "$work/archive"
  tar -xzf "$archive" -C "$work/archive" --strip-components=1
done
printf '%s\n' "${archives[@]}"

use() {
  local program=$1 place=$work/$2
  mkdir "$place"
  cd "$place"
  "$program" doctor
  "$program" generate data --size 32 --train-views 8 --test-views 2
  "$program" train data -o run -n 20
  "$program" render run -o frames --orbit 2 --width 32 --height 24
  local frames=(frames/*.png)
  ((${#frames[@]} == 2))
}
use "$work/root/usr/bin/raysplats" from_package
use "$work/archive/usr/bin/raysplats" from_archive
