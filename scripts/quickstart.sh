#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# From a fresh clone to a trained model: sets up, generates a small ray-traced data set, trains on it, measures
# the held-out views, renders an orbit and says where everything is.
# usage: scripts/quickstart.sh [OUTPUT]     (default: quickstart/ in the project)
# RAYSPLATS_DEVICE chooses the OpenCL device (index or part of its name).
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
if [[ ${1:-} == -* ]]; then
  sed -n '/^# From/,/^set/s/^# //p' "${BASH_SOURCE[0]}"
  [[ $1 == --help ]] && exit
  exit 2
fi
output=$(realpath -m -- "${1:-$root/quickstart}")
cd "$root"

say() { printf '\n== %s\n' "$*"; }

# Only folders that an earlier quick start made are replaced.
marker=$output/.raysplats-quickstart
if [[ -e $output && ! -e $marker && -n $(ls -A -- "$output") ]]; then
  echo "$output holds other files: give an empty or new folder" >&2
  exit 2
fi

./scripts/setup.sh
mkdir -p -- "$output"
touch -- "$marker"
raysplats=$root/build/release/bin/raysplats
device=()
[[ -z ${RAYSPLATS_DEVICE:-} ]] || device=(--device "$RAYSPLATS_DEVICE")
started=$SECONDS

say "OpenCL devices"
"$raysplats" devices

say "Generating the data set: $output/data"
"$raysplats" generate "$output/data"

say "Training: $output/run"
rm -rf -- "$output/run" "$output/eval" "$output/orbit"
"$raysplats" train "$output/data" -o "$output/run" --config configs/quick.toml "${device[@]}"

say "Measuring the held-out views: $output/eval"
"$raysplats" eval "$output/run" --data "$output/data" -o "$output/eval" "${device[@]}"

say "Rendering an orbit: $output/orbit"
"$raysplats" render "$output/run" --data "$output/data" --orbit 24 --width 320 --height 320 \
  -o "$output/orbit" --format png "${device[@]}"
model=$(find "$output/run/point_cloud" -name point_cloud.ply | sort -V | tail -n 1)

say "Done in $((SECONDS - started)) s after the build"
cat <<END
photos            $output/data/train, $output/data/test
model (3DGS PLY)  $model
report            $output/run/report.html
training curve    $output/run/metrics.csv
held-out metrics  $output/eval/metrics.json
held-out images   $output/eval
orbit frames      $output/orbit
look around       $raysplats view $output/run --data $output/data
END
