#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds what is committed here in a Debian or Ubuntu of another release, with the compiler, libraries and OpenCL of that
# release, and runs a command there. The release is installed into a folder by debootstrap; nothing else of this system changes.
# usage: scripts/other_system.sh RELEASE [--folder DIR] [--mirror URL] [--keyring FILE] [--components LIST] [COMMAND [ARGUMENT ...]]
#   RELEASE       as debootstrap names it: trixie, noble, ...
#   --folder DIR  keeps the system and the build for the next call (default: ~/.cache/raysplats-systems)
#   --mirror URL, --keyring FILE, --components LIST
#                 where packages come from, the keys that they are signed with and the parts of the archive: debootstrap needs to
#                 be told of another distribution's (Ubuntu: the keys of its package ubuntu-keyring; main,universe)
#   COMMAND       runs in the root of the source tree there (default: scripts/test.sh)
# For instance: scripts/other_system.sh trixie scripts/quickstart.sh
# Needs root (chroot, mounts), debootstrap, and 4 GB for each release.
set -euo pipefail
called_from=$PWD
cd "$(dirname "${BASH_SOURCE[0]}")/.."

usage='scripts/other_system.sh RELEASE [--folder DIR] [--mirror URL] [--keyring FILE] [--components LIST] [COMMAND [ARGUMENT ...]]'
fail() {
  printf '%s\n' "$*" >&2
  exit 2
}
say() { printf '== %s\n' "$*"; }

(($# > 0)) || fail "usage: $usage"
[[ $1 =~ ^[a-z]+$ ]] || fail "RELEASE is a name such as trixie, not '$1': $usage"
release=$1
shift
folder=${XDG_CACHE_HOME:-$HOME/.cache}/raysplats-systems
given=()
mirror=()
while [[ ${1:-} == --* ]]; do
  (($# > 1)) || fail "$1 needs a value"
  case $1 in
    --folder) folder=$(cd "$called_from" && realpath -m -- "$2") ;;
    --mirror) mirror=("$2") ;;
    --keyring) given+=(--keyring="$(cd "$called_from" && realpath -m -- "$2")") ;;
    --components) given+=(--components="$2") ;;
    *) fail "$1 is no option: $usage" ;;
  esac
  shift 2
done
command=("$@")
((${#command[@]} > 0)) || command=(scripts/test.sh)

((EUID == 0)) || fail 'chroot and mounts need root: run this as root'
command -v debootstrap >/dev/null || fail 'debootstrap is missing: install it (Debian, Ubuntu: debootstrap)'
[[ -e /usr/share/debootstrap/scripts/$release ]] ||
  fail "this debootstrap does not know $release: /usr/share/debootstrap/scripts has what it knows, newer ones know more"

root=$folder/$release
if [[ ! -e $root/.complete ]]; then
  say "Installing $release into $root"
  rm -rf --one-file-system "$root"
  mkdir -p "$folder"
  debootstrap "${given[@]}" --variant=minbase "$release" "$root" "${mirror[@]}" >"$folder/$release.log" 2>&1 || {
    tail -n 5 "$folder/$release.log" >&2
    exit 1
  }
  touch "$root/.complete"
fi

mounted=()
unmount() {
  local place
  for place in "${mounted[@]}"; do umount "$place"; done
}
trap unmount EXIT
for place in proc dev dev/pts dev/shm sys; do
  mount --bind "/$place" "$root/$place"
  mounted=("$root/$place" "${mounted[@]}")
done
mkdir -p "$root/source"
mount --bind "$PWD" "$root/source"
mounted=("$root/source" "${mounted[@]}")
cp /etc/resolv.conf "$root/etc/"

chroot "$root" env -i HOME=/root PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 \
  DEBIAN_FRONTEND=noninteractive bash -euc '
    apt-get -qq update
    command -v git >/dev/null || apt-get -qq install --no-install-recommends git ca-certificates >/dev/null
    git config --global --replace-all safe.directory "*"
    cd /root
    [[ -d raysplats ]] || git clone -q /source raysplats
    cd raysplats
    git fetch -q /source HEAD
    git reset -q --hard FETCH_HEAD
    exec "$@"' "$release" "${command[@]}"
