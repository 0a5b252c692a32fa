#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Trains the same thing several times and says how much the results differ; see --help.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)

usage() {
  cat <<'END'
usage: scripts/reliability/spread.sh RUNS [OPTIONS] [-- TRAIN OPTIONS...]
Trains RUNS times with one seed, once deterministically and once with gradients added by atomic operations on floats, and
prints for both the range and standard deviation of PSNR on the held-out views and of the number of Gaussians, and how
many different models there were.

  --data DIR          a data set; without it a small one is generated
  --raysplats FILE    program (build/release/bin/raysplats)
  --iterations N      (200)
  --help
END
}

fail() {
  echo "spread.sh: $*" >&2
  exit 2
}

runs=
data=
raysplats=$root/build/release/bin/raysplats
iterations=200
extra=()
while (($# > 0)); do
  case $1 in
    --help) usage && exit 0 ;;
    --data | --raysplats | --iterations)
      (($# > 1)) || fail "$1 needs a value"
      declare "${1#--}=$2"
      shift 2
      ;;
    --) shift && extra=("$@") && break ;;
    -*) fail "unknown option $1, see --help" ;;
    *) runs=$1 && shift ;;
  esac
done
[[ $runs =~ ^[0-9]+$ ]] || fail "how many runs? see --help"
[[ -x $raysplats ]] || fail "$raysplats does not exist, build it or name it with --raysplats"

folder=$(mktemp -d "${TMPDIR:-/tmp}/raysplats_spread_XXXXXX")
trap 'rm -rf "$folder"' EXIT
if [[ -z $data ]]; then
  data=$folder/data
  "$raysplats" -q generate "$data" --size 96 --train-views 16 --test-views 4 >/dev/null
fi

echo "mode           models  PSNR min..max (dB)  sigma     Gaussians min..max  sigma"
for mode in deterministic atomic; do
  option=(--deterministic)
  [[ $mode == deterministic ]] || option=(--no-deterministic --gradient-sum atomic)
  for ((i = 0; i < runs; ++i)); do
    "$raysplats" -q train "$data" -o "$folder/run" -n "$iterations" --init-count 2000 --densify-from 50 --densify-every 50 \
      --densify-until "$iterations" --resolution-schedule 1 --checkpoint-every 0 --eval-renders 0 "${extra[@]}" "${option[@]}" >/dev/null
    sha256sum <"$folder/run/point_cloud/iteration_$iterations/point_cloud.ply" >>"$folder/$mode.models"
    tr -d '\n' <"$folder/run/metrics.json" |
      sed -E 's/.*"evaluations": \[ *\{ *"gaussians": ([0-9]+).*"psnr": ([0-9.]+).*/\1 \2\n/' >>"$folder/$mode.txt"
    rm -rf "$folder/run"
  done
  awk -v mode="$mode" -v models="$(sort -u "$folder/$mode.models" | wc -l)" '
    { count[NR] = $1; psnr[NR] = $2; sum_c += $1; sum_p += $2 }
    function spread(v, mean,   i, s) { for (i = 1; i <= NR; ++i) s += (v[i] - mean) ^ 2; return sqrt(s / (NR > 1 ? NR - 1 : 1)) }
    function least(v,   i, m) { m = v[1]; for (i = 2; i <= NR; ++i) if (v[i] < m) m = v[i]; return m }
    function most(v,   i, m) { m = v[1]; for (i = 2; i <= NR; ++i) if (v[i] > m) m = v[i]; return m }
    END { printf "%-14s %6d  %8.4f..%-8.4f  %-8.4f  %8d..%-8d  %.1f\n", mode, models, least(psnr), most(psnr),
      spread(psnr, sum_p / NR), least(count), most(count), spread(count, sum_c / NR) }' "$folder/$mode.txt"
done
