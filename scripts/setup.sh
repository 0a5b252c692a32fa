#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the Debian packages that are missing, then configures and builds the release preset.
# The program is build/release/bin/raysplats afterwards. With --tests the test programs are built too, and
# what they run on is installed.
# Needs the network only when a package is missing; root or sudo only then.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

packages=(
  g++ cmake ninja-build pkg-config ccache git
  ocl-icd-opencl-dev opencl-headers opencl-clhpp-headers pocl-opencl-icd
  libglm-dev libfmt-dev libspdlog-dev nlohmann-json3-dev libcli11-dev libxxhash-dev doctest-dev
  libbenchmark-dev libtinyobjloader-dev libtinygltf-dev libtomlplusplus-dev
  zlib1g-dev libzstd-dev libwebp-dev libopenimageio-dev openimageio-tools libopenexr-dev libopencv-dnn-dev
)
# Of each the first that the system has; 1.81 is the newer Boost of Debian 12.
alternatives=("libboost1.81-dev libboost-dev")
# Left out where the system has none of that name: the tests that run on it are skipped.
optional=()

say() { printf '== %s\n' "$*"; }

# The manual is a part of what `cmake --install` installs.
targets=(raysplats_cli raysplats_manual)
case "${1:-}" in
  "") ;;
  --tests)
    targets=(all)
    optional+=(oclgrind)
    ;;
  *)
    echo "usage: scripts/setup.sh [--tests]" >&2
    exit 2
    ;;
esac

is_installed() { [[ $(dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null || true) == installed ]]; }
is_known() { [[ -n $(apt-cache madison "$1" 2>/dev/null) ]]; }

# Prints the name among its arguments that is installed, else the first that is known, else the last one.
first_of() {
  local name
  for name in "$@"; do
    if is_installed "$name"; then
      echo "$name"
      return
    fi
  done
  for name in "$@"; do
    if is_known "$name"; then break; fi
  done
  echo "$name"
}

# Fills `missing` with what is not installed.
find_missing() {
  local package names
  missing=()
  for package in "${packages[@]}"; do
    is_installed "$package" || missing+=("$package")
  done
  for names in "${alternatives[@]}"; do
    # shellcheck disable=SC2086 # a list
    package=$(first_of $names)
    is_installed "$package" || missing+=("$package")
  done
  for package in "${optional[@]}"; do
    if ! is_installed "$package" && is_known "$package"; then missing+=("$package"); fi
  done
}

if command -v dpkg-query >/dev/null; then
  find_missing
  if ((${#missing[@]} > 0)); then
    say "Missing Debian packages: ${missing[*]}"
    as_root=()
    if ((EUID != 0)); then
      if ! command -v sudo >/dev/null; then
        echo "These packages are missing and there is no sudo; install them as root: ${missing[*]}" >&2
        exit 1
      fi
      as_root=(sudo)
    fi
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get update -q
    find_missing # what is known may be known since then
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${missing[@]}"
  else
    say "All Debian packages are installed"
  fi
else
  say "No Debian package manager; the build needs: ${packages[*]} libboost-dev"
fi

say "Configuring build/release"
cmake --preset release
say "Building ${targets[*]} with $(nproc) jobs"
cmake --build --preset release --parallel "$(nproc)" --target "${targets[@]}"
say "Built $PWD/build/release/bin/raysplats"
