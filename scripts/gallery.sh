#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Renders the scenes of configs/gallery around a trained model: mirrors, glass, shadows, transparency and an animation.
# With DATA the model is one of photos: a mirror with a ball, a ball on its way around, glass and shadows around its
# subject, wherever its cameras say that this is.
# usage: scripts/gallery.sh [[--data] DATA] [OUTPUT [RUN]]
#   DATA    data set of `raysplats train`, trained with --quality low; without --data a folder that is one
#   OUTPUT  folder for the pictures (default: gallery/ in the project)
#   RUN     folder of a training run on the generated data set, or on DATA; trained into OUTPUT/run when left out
# RAYSPLATS_DEVICE chooses the OpenCL device (index or part of its name).
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

is_data() { [[ -e $1/transforms.json || -e $1/transforms_train.json || -d $1/sparse || -d $1/colmap/sparse ]]; }

usage() { sed -n '/^# usage:/,/^[^#]/s/^# //p' "${BASH_SOURCE[0]}"; }

data=
if [[ ${1:-} == --help ]]; then
  usage
  exit
elif [[ ${1:-} == --data ]]; then
  data=$(realpath -- "${2:?--data takes a data set}")
  shift 2
elif (($# > 0)) && is_data "$1"; then
  data=$(realpath -- "$1")
  shift
fi
if [[ ${1:-} == -* ]]; then
  echo "There is no option $1" >&2
  usage >&2
  exit 2
fi
output=$(realpath -m -- "${1:-$root/gallery}")
run=${2:+$(realpath -- "$2")}
cd "$root"
raysplats=$root/build/release/bin/raysplats
[[ -x $raysplats ]] || ./scripts/setup.sh
device=()
[[ -z ${RAYSPLATS_DEVICE:-} ]] || device=(--device "$RAYSPLATS_DEVICE")

say() { printf '\n== %s\n' "$*"; }

mkdir -p -- "$output/scenes"
if [[ -z $run ]]; then
  run=$output/run
  if [[ ! -e $run/metrics.json ]]; then
    say "Training a model to put things into: $run"
    if [[ -n $data ]]; then
      "$raysplats" train "$data" -o "$run" --quality low "${device[@]}"
    else
      "$raysplats" generate "$output/data" --size 320
      "$raysplats" train "$output/data" -o "$run" --config configs/quick.toml --max-gaussians 60000 "${device[@]}"
    fi
  fi
fi
run=$(realpath -- "$run")

# The shapes fill [-1, 1]: a square, a box with flat sides, and a ball.
cat > "$output/scenes/quad.obj" <<'END'
v -1 -1 0
v 1 -1 0
v 1 1 0
v -1 1 0
f 1 2 3 4
END
cat > "$output/scenes/box.obj" <<'END'
v -1 -1 -1
v 1 -1 -1
v 1 1 -1
v -1 1 -1
v -1 -1 1
v 1 -1 1
v 1 1 1
v -1 1 1
f 4 3 2 1
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
END
awk -v n=64 'BEGIN {
  pi = atan2(0, -1)
  for (i = 0; i <= n; ++i) for (j = 0; j < 2 * n; ++j) {
    a = pi * i / n; b = pi * j / n
    printf "v %.7f %.7f %.7f\nvn %.7f %.7f %.7f\n", sin(a) * cos(b), sin(a) * sin(b), cos(a), sin(a) * cos(b), sin(a) * sin(b), cos(a)
  }
  for (i = 0; i < n; ++i) for (j = 0; j < 2 * n; ++j) {
    k = (j + 1) % (2 * n)
    p = i * 2 * n + j + 1; q = (i + 1) * 2 * n + j + 1; r = (i + 1) * 2 * n + k + 1; s = i * 2 * n + k + 1
    if (i < n - 1) printf "f %d//%d %d//%d %d//%d\n", p, p, q, q, r, r
    if (i > 0) printf "f %d//%d %d//%d %d//%d\n", p, p, r, r, s, s
  }
}' > "$output/scenes/ball.obj"

ln -sfn -- "$run" "$output/scenes/model"
if [[ -n $data ]]; then
  python3 scripts/gallery/around.py "$run" "$output/scenes"
  scenes=("$output"/scenes/captured_*.toml)
else
  scenes=(configs/gallery/*.toml)
  cp -- "${scenes[@]}" "$output/scenes/"
fi
for scene in "${scenes[@]}"; do
  name=$(basename "$scene" .toml)
  say "$name"
  video=()
  [[ $name != captured_turn ]] || video=(--video "$output/turn.gif" --fps 10)
  "$raysplats" render "$output/scenes/$name.toml" -o "$output/$name" "${video[@]}" "${device[@]}"
done
say "Pictures: $output"
