#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# What it costs to add gradients in each way; see --help.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)

usage() {
  cat <<'END'
usage: scripts/reliability/price.sh [OPTIONS] [-- TRAIN OPTIONS...]
Trains with gradients added by private copies, exactly, and by atomic operations on floats, in turns, and prints the
device time of the kernels concerned and of all kernels together: the least of the repetitions.

  --data DIR          a data set; without it one is generated
  --raysplats FILE    program (build/release/bin/raysplats)
  --iterations N      (60)
  --repeat N          (3)
  --help
END
}

fail() {
  echo "price.sh: $*" >&2
  exit 2
}

data=
raysplats=$root/build/release/bin/raysplats
iterations=60
repeat=3
extra=()
while (($# > 0)); do
  case $1 in
    --help) usage && exit 0 ;;
    --data | --raysplats | --iterations | --repeat)
      (($# > 1)) || fail "$1 needs a value"
      declare "${1#--}=$2"
      shift 2
      ;;
    --) shift && extra=("$@") && break ;;
    *) fail "unknown option $1, see --help" ;;
  esac
done
[[ -x $raysplats ]] || fail "$raysplats does not exist, build it or name it with --raysplats"

folder=$(mktemp -d "${TMPDIR:-/tmp}/raysplats_price_XXXXXX")
trap 'rm -rf "$folder"' EXIT
if [[ -z $data ]]; then
  data=$folder/data
  "$raysplats" -q generate "$data" --size 160 --train-views 12 --test-views 1 >/dev/null
fi
for ((i = 0; i < repeat; ++i)); do
  for sum in copies exact atomic; do
    "$raysplats" -q train "$data" -o "$folder/run" -n "$iterations" --init-count 20000 --densify-until 0 \
      --checkpoint-every 0 --eval-renders 0 --resolution-schedule 1 "${extra[@]}" --gradient-sum "$sum" --profile >"$folder/$sum.$i.txt"
    rm -rf "$folder/run"
  done
done

echo "sum      backward ms  rounding ms  fills ms  all kernels ms   backward and rounding, all: ratio to copies"
for sum in copies exact atomic; do
  for file in "$folder/$sum".*.txt; do
    awk '$1 == "trace_backward" { b = $3 } $1 == "round_exact_lines" { r = $3 } $1 == "(fill)" { f = $3 }
      NF == 5 && $5 ~ /%$/ { all += $3 } END { print b + 0, r + 0, f + 0, all }' "$file"
  done | sort -g | awk -v sum="$sum" -v base="${base:-}" '
    NR == 1 { b = $1; r = $2; f = $3; all = $4 } { if ($4 < all) all = $4 }
    END { split(base == "" ? (b + r) " " all : base, x, " ")
      printf "%-8s %11.1f %12.1f %9.1f %15.1f   %.3f %.3f\n", sum, b, r, f, all, (b + r) / x[1], all / x[2] }' |
    tee "$folder/row"
  [[ -n ${base:-} ]] || base=$(awk '{ print $2 + $3, $5 }' "$folder/row")
done
