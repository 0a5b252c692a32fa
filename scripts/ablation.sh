#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Trains with one option varied at a time and plots quality and cost; see --help.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

usage() {
  cat <<'END'
usage: scripts/ablation.sh DATA OUT [OPTIONS] [-- TRAIN OPTIONS...]
Trains on DATA (any data set of raysplats train) with the axes of the paper's figure 7 (max-hits, min-transmittance,
quantile) and hit-order, adaptive-radius, packet-width varied one at a time, everything else and the seed equal,
and evaluates each model on the held-out views. Writes OUT/ablation.csv (PSNR, SSIM, Gaussians, seconds) and
OUT/ablation.html, one page of tables and plots. A finished run in OUT/runs is not repeated, so that the command goes on where it stopped;
a run that fails is reported, named in the table, and the others go on (exit status 1 at the end).

  --iterations N      training steps of each run (500)
  --axes LIST         which axes (max-hits,min-transmittance,quantile,hit-order,adaptive-radius,packet-width)
  --values AXIS=LIST  other values for an axis, for example --values max-hits=8,64 (repeatable)
  --seed N            (42)
  --raysplats FILE    program (build/release/bin/raysplats)
  --device DEV        OpenCL device
  --prefix CMD        put before every run, for example "taskset -c 0-3"
  --help

The plots need Python's matplotlib (Debian package python3-matplotlib); PYTHON names the interpreter.
END
}

fail() {
  echo "ablation.sh: $*" >&2
  exit 2
}

declare -A values=(
  [max-hits]="4,8,16,32,64,128,512"
  [min-transmittance]="0.3,0.1,0.03,0.01,0.001,0.0001"
  # chi^2 quantiles with three degrees of freedom: 0.5, 0.75, 0.9, 0.95, 0.99, 0.999
  [quantile]="2.366,4.108,6.2514,7.8147,11.3449,16.266"
  [hit-order]="entry,peak"
  [adaptive-radius]="off,on"
  [packet-width]="1,2,4,8,16"
)
iterations=500
axes=max-hits,min-transmittance,quantile,hit-order,adaptive-radius,packet-width
seed=42
raysplats=$root/build/release/bin/raysplats
device=()
prefix=()
extra=()
places=()
while (($# > 0)); do
  case $1 in
    --help) usage && exit 0 ;;
    --iterations | --axes | --values | --seed | --raysplats | --device | --prefix)
      (($# > 1)) || fail "$1 needs a value"
      case $1 in
        --iterations) iterations=$2 ;;
        --axes) axes=$2 ;;
        --values)
          [[ -n ${values[${2%%=*}]:-} ]] || fail "there is no axis ${2%%=*}, see --help"
          values[${2%%=*}]=${2#*=}
          ;;
        --seed) seed=$2 ;;
        --raysplats) raysplats=$2 ;;
        --device) device=(--device "$2") ;;
        --prefix) read -ra prefix <<<"$2" ;;
      esac
      shift 2
      ;;
    --) shift && extra=("$@") && break ;;
    -*) fail "unknown option $1, see --help" ;;
    *) places+=("$1") && shift ;;
  esac
done
((${#places[@]} == 2)) || fail "give a data set and a folder for the results, see --help"
data=${places[0]}
out=${places[1]}
[[ -e $data ]] || fail "$data does not exist"
[[ -x $raysplats ]] || fail "$raysplats does not exist, build it with scripts/setup.sh or name it with --raysplats"
for axis in ${axes//,/ }; do
  [[ -n ${values[$axis]:-} ]] || fail "there is no axis $axis, see --help"
done
# Before anything is measured.
python=$("$root/scripts/bench/plotting_python.sh")

# Runs of other settings would not be comparable.
mkdir -p "$out/runs"
settings="data $(realpath "$data"); iterations $iterations; seed $seed; device ${device[*]:-}; train options ${extra[*]:-}"
if [[ -e $out/settings.txt && $(<"$out/settings.txt") != "$settings" ]]; then
  fail "$out holds runs of other settings ($(<"$out/settings.txt")), choose another folder"
fi
echo "$settings" >"$out/settings.txt"

# run_one AXIS VALUE FOLDER: trains and evaluates; the folder is finished when eval/metrics.json is there.
run_one() {
  local option=("--$1" "$2")
  if [[ $1 == adaptive-radius ]]; then
    option=(--adaptive-radius)
    [[ $2 == on ]] || option=(--no-adaptive-radius)
  fi
  rm -rf "$3"
  mkdir -p "$3"
  "${prefix[@]}" "$raysplats" --quiet train "$data" -o "$3/run" -n "$iterations" --seed "$seed" --eval-renders 0 \
    "${device[@]}" "${extra[@]}" "${option[@]}" >"$3/log.txt" 2>&1 &&
    "${prefix[@]}" "$raysplats" --quiet eval "$3/run" -d "$data" -o "$3/eval" "${device[@]}" >>"$3/log.txt" 2>&1
}

plan=$out/plan.csv
echo axis,value,folder >"$plan"
failed=()
for axis in ${axes//,/ }; do
  for value in ${values[$axis]//,/ }; do
    folder=$out/runs/${axis}_$value
    echo "$axis,$value,runs/${axis}_$value" >>"$plan"
    if [[ -e $folder/eval/metrics.json ]]; then
      printf '== %s %s is there already\n' "$axis" "$value" >&2
      continue
    fi
    printf '== %s %s\n' "$axis" "$value" >&2
    status=0
    run_one "$axis" "$value" "$folder" || status=$?
    ((status != 130)) || exit 130
    if ((status != 0)); then
      printf '== %s %s failed with status %s: %s\n' "$axis" "$value" "$status" "$(tail -n 1 "$folder/log.txt")" >&2
      failed+=("${axis}_$value")
    fi
  done
done

"$python" "$root/scripts/bench/plot.py" ablation "$out"
if ((${#failed[@]} > 0)); then
  printf '== Failed: %s\n' "${failed[*]}" >&2
  exit 1
fi
