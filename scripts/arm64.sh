#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds this tree for 64-bit ARM by Debian's cross compiler, and runs a command with it in Debian's ARM system under qemu:
# what an ARM processor would do, some twenty times slower.
# usage: scripts/arm64.sh [--folder DIR] [--targets LIST] [COMMAND [ARGUMENT ...]]
#   --folder DIR    keeps the ARM system for the next call (default: ~/.cache/raysplats-systems)
#   --targets LIST  what is built, separated by commas (default: raysplats_cli)
#   COMMAND         runs in the root of the source tree there (default: build/arm64/bin/raysplats doctor)
# For instance: scripts/arm64.sh --targets test_bvh build/arm64/bin/test_bvh
# Needs root (chroot, mounts), Debian's mmdebstrap, qemu-user-static and g++-aarch64-linux-gnu, and 3 GB.
set -euo pipefail
called_from=$PWD
cd "$(dirname "${BASH_SOURCE[0]}")/.."

usage='scripts/arm64.sh [--folder DIR] [--targets LIST] [COMMAND [ARGUMENT ...]]'
fail() {
  printf '%s\n' "$*" >&2
  exit 2
}
say() { printf '== %s\n' "$*"; }

folder=${XDG_CACHE_HOME:-$HOME/.cache}/raysplats-systems
targets=raysplats_cli
while [[ ${1:-} == --* ]]; do
  (($# > 1)) || fail "$1 needs a value"
  case $1 in
    --folder) folder=$(cd "$called_from" && realpath -m -- "$2") ;;
    --targets) targets=$2 ;;
    *) fail "$1 is no option: $usage" ;;
  esac
  shift 2
done
command=("$@")
((${#command[@]} > 0)) || command=(build/arm64/bin/raysplats doctor)

((EUID == 0)) || fail 'chroot and mounts need root: run this as root'
for tool in mmdebstrap qemu-aarch64-static aarch64-linux-gnu-g++; do
  command -v "$tool" >/dev/null || fail "$tool is missing: install mmdebstrap, qemu-user-static and g++-aarch64-linux-gnu"
done

release=bookworm # that of the cross compiler's C++ library, or older
root=$folder/arm64-$release
if [[ ! -e $root/.complete ]]; then
  say "Unpacking $release for arm64 into $root"
  rm -rf --one-file-system "$root"
  mkdir -p "$folder"
  # Unpacked by this system's own programs; nothing of theirs runs then, so that it takes minutes and not an hour.
  packages=$(sed -n '/^packages=(/,/^)/p' scripts/setup.sh | sed '1d;$d' | tr -s ' \n' ',')
  mmdebstrap --variant=extract --architectures=arm64 --aptopt='Apt::Install-Recommends "false"' \
    --hook-dir=/usr/share/mmdebstrap/hooks/merged-usr --skip=check/qemu \
    --include='?essential' --include="${packages#,}libboost1.81-dev" "$release" "$root" >"$folder/arm64-$release.log" 2>&1 || {
    tail -n 5 "$folder/arm64-$release.log" >&2
    exit 1
  }
  # What Debian's scripts would have made.
  libraries=$root/usr/lib/aarch64-linux-gnu
  ln -sf blas/libblas.so.3 lapack/liblapack.so.3 "$libraries"
  find "$libraries" -maxdepth 1 -type l -lname '/*' -printf '%p %l\n' | while read -r link target; do
    ln -sfn "../../..${target/#\/lib\///usr/lib/}" "$link"
  done
  qemu-aarch64-static "$root/usr/sbin/ldconfig" -r "$root"
  # PoCL reads there what the processor can do: a Neoverse N1, as in many servers.
  for core in 0 1; do
    printf '%s\t: %s\n' processor $core Features 'fp asimd aes pmull sha1 sha2 crc32 atomics fphp asimdhp asimdrdm lrcpc dcpop asimddp' \
      'CPU implementer' 0x41 'CPU architecture' 8 'CPU variant' 0x3 'CPU part' 0xd0c 'CPU revision' 1 ''
  done >"$root/cpuinfo"
  touch "$root/.complete"
fi

say "Building $targets for arm64"
cmake -G Ninja -S . -B build/arm64 -DCMAKE_BUILD_TYPE=Release -DCMAKE_TOOLCHAIN_FILE="$PWD/scripts/cmake/aarch64.cmake" \
  -DCMAKE_SYSROOT="$root" >/dev/null
IFS=, read -ra targets <<<"$targets"
cmake --build build/arm64 --parallel "$(nproc)" --target "${targets[@]}"

# Namespaces of its own, in which the kernel gives ARM's programs to qemu; nothing of this system changes.
export root qemu
qemu=$(command -v qemu-aarch64-static)
# shellcheck disable=SC2016 # expands there
exec unshare --map-root-user --mount --pid --fork --kill-child bash -euc '
  mount -t proc proc /proc
  if mount -t binfmt_misc binfmt_misc /proc/sys/fs/binfmt_misc 2>/dev/null; then
    printf "%s" ":aarch64:M::\\x7fELF\\x02\\x01\\x01\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x02\\x00\\xb7\\x00" \
      ":\\xff\\xff\\xff\\xff\\xff\\xff\\xff\\x00\\xff\\xff\\xff\\xff\\xff\\xff\\xff\\xff\\xfe\\xff\\xff\\xff:$qemu:FP" \
      >/proc/sys/fs/binfmt_misc/register
  fi # else by what qemu-user-static has registered, on kernels before 6.7
  mkdir -p "$root$PWD"
  mount --rbind /proc "$root/proc"
  mount --rbind /dev "$root/dev"
  mount --rbind /sys "$root/sys"
  mount --rbind "$PWD" "$root$PWD"
  mount --bind "$root/cpuinfo" "$root/proc/cpuinfo"
  exec chroot "$root" /usr/bin/env -i HOME=/root PATH=/usr/local/bin:/usr/sbin:/usr/bin LANG=C.UTF-8 \
    bash -c "cd \"\$0\" && exec \"\$@\"" "$PWD" "$@"' arm64 "${command[@]}"
