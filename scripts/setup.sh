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
  libboost1.81-dev
)

say() { printf '== %s\n' "$*"; }

targets=(raysplats_cli)
case "${1:-}" in
  "") ;;
  --tests)
    targets=(all)
    packages+=(oclgrind)
    ;;
  *)
    echo "usage: scripts/setup.sh [--tests]" >&2
    exit 2
    ;;
esac

if command -v dpkg-query >/dev/null; then
  missing=()
  for package in "${packages[@]}"; do
    status=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
    [[ $status == installed ]] || missing+=("$package")
  done
  if ((${#missing[@]} > 0)); then
    say "Installing Debian packages: ${missing[*]}"
    as_root=()
    if ((EUID != 0)); then
      if ! command -v sudo >/dev/null; then
        echo "These packages are missing and there is no sudo; install them as root: ${missing[*]}" >&2
        exit 1
      fi
      as_root=(sudo)
    fi
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get update -q
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${missing[@]}"
  else
    say "All Debian packages are installed"
  fi
else
  say "No Debian package manager; the build needs: ${packages[*]}"
fi

say "Configuring build/release"
cmake --preset release
say "Building ${targets[*]} with $(nproc) jobs"
cmake --build --preset release --parallel "$(nproc)" --target "${targets[@]}"
say "Built $PWD/build/release/bin/raysplats"
