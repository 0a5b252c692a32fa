#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Measures how time and memory grow with Gaussians and pixels; see --help.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)

usage() {
  cat <<'END'
usage: scripts/bench/growth.sh [OPTIONS]
Runs raysplats bench once per number of Gaussians and once per image size, each in a process of its own so that
its peak memory is its own, and writes OUT/*.json (a file that exists is not measured again), OUT/growth.csv,
OUT/growth_gaussians.png and OUT/growth_pixels.png.

  --out DIR           results (growth_out)
  --raysplats FILE    program to measure (build/release/bin/raysplats)
  --sizes LIST        Gaussians, at 800x800 pixels (10k,100k,1M,3M)
  --sides LIST        image widths and heights, with --pixels-at Gaussians (200,400,800,1600)
  --pixels-at N       (100k)
  --scene NAME        random, clustered or surface (random)
  --rows REGEX        what is measured (build|refit|view|backward|iteration|rays)
  --repeat N          runs of each row (3)
  --device DEV        OpenCL device
  --prefix CMD        put before every measured program, for example "taskset -c 0-3"
  --help

The plots need Python's matplotlib (Debian package python3-matplotlib); PYTHON names the interpreter.
END
}

out=growth_out
raysplats=$root/build/release/bin/raysplats
sizes=10k,100k,1M,3M
sides=200,400,800,1600
pixels_at=100k
scene=random
rows='build|refit|view|backward|iteration|rays'
repeat=3
device=()
prefix=()
while (($# > 0)); do
  case $1 in
    --help) usage && exit 0 ;;
    --out | --raysplats | --sizes | --sides | --pixels-at | --scene | --rows | --repeat | --device | --prefix)
      (($# > 1)) || { echo "growth.sh: $1 needs a value" >&2 && exit 2; }
      case $1 in
        --out) out=$2 ;;
        --raysplats) raysplats=$2 ;;
        --sizes) sizes=$2 ;;
        --sides) sides=$2 ;;
        --pixels-at) pixels_at=$2 ;;
        --scene) scene=$2 ;;
        --rows) rows=$2 ;;
        --repeat) repeat=$2 ;;
        --device) device=(--device "$2") ;;
        --prefix) read -ra prefix <<<"$2" ;;
      esac
      shift 2
      ;;
    *) echo "growth.sh: unknown option $1, see --help" >&2 && exit 2 ;;
  esac
done
if [[ ! -x $raysplats ]]; then
  echo "growth.sh: $raysplats does not exist, build it with scripts/setup.sh or name it with --raysplats" >&2
  exit 1
fi
# Before anything is measured.
python=$("$root/scripts/bench/plotting_python.sh")
mkdir -p "$out"

# measure SIZE SIDE
measure() {
  local json=$out/${scene}_$1_$2.json
  if [[ -e $json ]]; then
    printf '== %s is there already\n' "$json" >&2
    return
  fi
  printf '== %s Gaussians, %s x %s pixels\n' "$1" "$2" "$2" >&2
  "${prefix[@]}" "$raysplats" --quiet bench --scene "$scene" --sizes "$1" --resolution "$2x$2" --rays 16384 \
    --filter "^($rows)/" --repeat "$repeat" "${device[@]}" --json "$json" >/dev/null
}

for size in ${sizes//,/ }; do measure "$size" 800; done
for side in ${sides//,/ }; do measure "$pixels_at" "$side"; done

"$python" "$root/scripts/bench/plot.py" growth "$out"
