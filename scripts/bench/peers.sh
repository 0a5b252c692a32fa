#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Compares RaySplats-CL with other programs on this machine; see --help.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)

usage() {
  cat <<'END'
usage: scripts/bench/peers.sh [OPTIONS]
Builds ours and an Embree 3 program, runs them in turn on the same Gaussians, and prints a table of ratios.
Writes OUT/peers.csv (every measurement) and OUT/ratios.csv (the table).

  --out DIR      results (peers_out)
  --build DIR    build folder (build/peers)
  --rounds N     times that all measurements are repeated (3)
  --repeat N     measured runs of each program within a round (2)
  --device DEV   OpenCL device of ours
  --fox DIR      COLMAP folder of the undistorted fox: also time training iterations
  --prefix CMD   put before every measured program, for example "taskset -c 0-3"
  --only LIST    kinds of work: build, refit, camera, rays, train (all)
  --quick        a hundredth of the Gaussians, to try the script
  --help

OpenSplat and tinybvh are not run: their published figures are scaled to this machine by what Embree takes
here. Needs the Debian package libembree-dev; without it only our own side is measured.
END
}

out=peers_out
build=$root/build/peers
rounds=3
repeat=2
device=()
fox=
only=build,refit,camera,rays,train
part=1 # of the Gaussians
prefix=()
while (($# > 0)); do
  case $1 in
    --help) usage && exit 0 ;;
    --quick) part=100 && shift ;;
    --out | --build | --rounds | --repeat | --device | --fox | --prefix | --only)
      (($# > 1)) || { echo "peers.sh: $1 needs a value" >&2 && exit 2; }
      case $1 in
        --out) out=$2 ;;
        --build) build=$2 ;;
        --rounds) rounds=$2 ;;
        --repeat) repeat=$2 ;;
        --device) device=(--device "$2") ;;
        --fox) fox=$2 ;;
        --only) only=$2 ;;
        --prefix) read -ra prefix <<<"$2" ;;
      esac
      shift 2
      ;;
    *) echo "peers.sh: unknown option $1, see --help" >&2 && exit 2 ;;
  esac
done

say() { printf '== %s\n' "$*" >&2; }

embree=ON
if ! echo '#include <embree3/rtcore.h>' | "${CXX:-c++}" -E - >/dev/null 2>&1; then
  embree=OFF
  say "Embree 3 is not installed (Debian package libembree-dev): the peers are skipped, only ours is measured"
fi
mkdir -p "$out"
say "Building in $build"
# logged COMMAND...: silent unless it fails.
logged() {
  if ! "$@" >"$out/build.log" 2>&1; then
    tail -n 20 "$out/build.log" >&2
    say "Failed: $*"
    exit 1
  fi
}
logged cmake -S "$root" --preset release -B "$build" -DRAYSPLATS_BUILD_PEERS=$embree
targets=(raysplats_cli)
[[ $embree == OFF ]] || targets+=(embree_peer)
logged cmake --build "$build" --target "${targets[@]}"

rows=$out/peers.csv
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
header=work,program,scene,gaussians,units,median_ms,min_ms,million_units_per_s,hits_per_ray,traces_per_ray
echo "round,$header,mean_color,max_difference,mean_difference" >"$rows"

# wanted LIST: those of the kinds of work that were asked for.
wanted() {
  local kept=
  for work in ${1//,/ }; do
    [[ ,$only, != *,$work,* ]] || kept+=${kept:+,}$work
  done
  echo "$kept"
}

# measure GAUSSIANS WORK ARGUMENTS...: embree_peer's rows, marked with the round.
measure() {
  local work
  work=$(wanted "$2")
  [[ -n $work ]] || return 0
  "${prefix[@]}" "$build/bin/embree_peer" --no-header --repeat "$repeat" --count "$(($1 / part))" --work "$work" \
    "${device[@]}" "${@:3}" | sed "s/^/$round,/" >>"$rows"
}

# measure_ours ARGUMENTS...: the same for our side alone, through raysplats bench.
measure_ours() {
  rm -f -- "$scratch/bench.json"
  "${prefix[@]}" "$build/bin/raysplats" --quiet bench --repeat "$repeat" "${device[@]}" \
    --min-transmittance 0.001 --json "$scratch/bench.json" "$@" >/dev/null
  python3 "$root/scripts/bench/peer_table.py" rows "$scratch/bench.json" | sed "s/^/$round,/" >>"$rows"
}

# measure_fox: a training iteration at the Gaussian count and image size of the published figure, over the last sixth
# of a short run: at its start the Gaussians are few, faint and wide.
measure_fox() {
  rm -rf "$scratch/fox"
  "${prefix[@]}" "$build/bin/raysplats" --quiet train "$fox" -o "$scratch/fox" -n 300 --resolution-schedule 1 \
    --max-gaussians "$((14700 / part))" --eval-at 300 --eval-views 1 --eval-renders 0 "${device[@]}" >/dev/null
  awk -F, -v round="$round" '
    $1 == 250 { start = $2 }
    $1 == 300 { ms = 20 * ($2 - start); printf "%s,train,ours,fox,%s,1,%.3f,%.3f,,,,,,\n", round, $5, ms, ms }
  ' "$scratch/fox/metrics.csv" >>"$rows"
}

for ((round = 1; round <= rounds; ++round)); do
  say "Round $round of $rounds"
  if [[ $embree == ON ]]; then
    measure 100000 build,refit,camera
    measure 10000 camera --programs embree-packets-k64
    measure 1000000 build,refit,camera --programs embree-packets-k64
    measure 100000 rays --size 400 --programs embree-single-k64
    measure 1000000 rays --size 200 --programs embree-single-k64
  else
    measure_ours --sizes "$((10000 / part)),$((100000 / part)),$((1000000 / part))" \
      --filter '^(view|build|refit|rays)/'
  fi
  [[ -z $fox || -z $(wanted train) ]] || measure_fox
done
python3 "$root/scripts/bench/peer_table.py" table "$rows" "$out/ratios.csv" "$part"
