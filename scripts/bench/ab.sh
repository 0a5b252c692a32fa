#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Compares the speed of two builds of the program row by row; see --help.
set -euo pipefail

usage() {
  cat <<'END'
usage: scripts/bench/ab.sh OLD NEW [OPTIONS] [-- BENCH-OPTIONS]
Runs every row of `raysplats bench` that both programs have with the one and the other in turns, and prints per row
the medians, the ratio NEW/OLD (median over the rounds of the ratio within a round), its spread (least to largest), the
noise and what that says: "faster", "slower" or "same". A row is slower or faster only when the ratios of at least three
quarters of the rounds lie beyond the noise on the same side (of five ratios that differ by chance alone, four lie on one
side in three rows of eight: it is the noise that keeps these from being called). With --noise own every round runs
OLD a second time, and a row's noise is the larger of 5 % and the median distance of that ratio OLD/OLD from 1: a machine
that other programs share then says "same" more often, instead of calling differences that are its own. A row that one
of the programs cannot run is named and left out. Exit status 3 when any row is slower, 1 when one was left out.

  OLD, NEW         two raysplats programs
  --rounds N       rounds per row, at least 5 (5)
  --filter REGEX   rows, as of bench --filter (.)
  --noise SHARE    what counts as the same (0.05), or own
  --old-row NAME, --new-row NAME
                   compare one row with another one, for rows that changed their name
  --csv FILE       every single time as well
  --prefix CMD     put before every measured program, for example "taskset -c 0-3"
  --help

BENCH-OPTIONS go to both, for example: -- --sizes 100k --repeat 3 --device 0
END
}

if (($# == 1)) && [[ $1 == --help ]]; then
  usage
  exit 0
fi
if (($# < 2)); then
  usage >&2
  exit 2
fi
old=$1
new=$2
shift 2
rounds=5
filter=.
noise=0.05
old_row=
new_row=
csv=
prefix=()
while (($# > 0)); do
  case $1 in
    --rounds) rounds=$2; shift 2 ;;
    --filter) filter=$2; shift 2 ;;
    --noise) noise=$2; shift 2 ;;
    --old-row) old_row=$2; shift 2 ;;
    --new-row) new_row=$2; shift 2 ;;
    --csv) csv=$2; shift 2 ;;
    --prefix) read -ra prefix <<<"$2"; shift 2 ;;
    --help) usage; exit 0 ;;
    --) shift; break ;;
    *) echo "ab.sh: unknown option $1: see --help" >&2; exit 2 ;;
  esac
done
if ! [[ $rounds =~ ^[0-9]+$ ]] || ((rounds < 5)); then
  echo "ab.sh: --rounds is $rounds: 5 at least, fewer say nothing" >&2
  exit 2
fi
if [[ -n $old_row && -z $new_row ]] || [[ -z $old_row && -n $new_row ]]; then
  echo "ab.sh: --old-row and --new-row go together" >&2
  exit 2
fi
if ! [[ $noise == own || $noise =~ ^0?\.[0-9]+$ ]]; then
  echo "ab.sh: --noise is $noise: give a share below 1, such as 0.05, or own" >&2
  exit 2
fi
for program in "$old" "$new"; do
  if [[ ! -x $program ]]; then
    echo "ab.sh: $program is no program: build it first" >&2
    exit 2
  fi
done

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
list() { "$1" bench --list --filter "$2" "${@:3}"; }
if [[ -n $old_row ]]; then
  list "$old" "^$old_row/" "$@" | sort >"$work/old"
  list "$new" "^$new_row/" "$@" | sort >"$work/new"
  paste -d' ' "$work/old" "$work/new" >"$work/rows"
else
  list "$old" "$filter" "$@" | sort >"$work/old"
  list "$new" "$filter" "$@" | sort >"$work/new"
  join "$work/old" "$work/new" | sed 's/.*/& &/' >"$work/rows"
fi
if [[ ! -s $work/rows ]]; then
  echo "ab.sh: the two programs have no such row in common: see raysplats bench --list" >&2
  exit 2
fi

run() { # program, row id, what to call it, bench options
  local result=$work/result.json
  rm -f -- "$result" # of the row before; programs replace no file unasked
  if ! "${prefix[@]}" "$1" bench --filter "^$2\$" --json "$result" "${@:4}" >"$work/log" 2>&1; then
    printf 'ab.sh: %s fails in %s: %s\n' "$2" "$1" "$(tail -n 1 "$work/log")" >&2
    return 1
  fi
  python3 - "$result" "$2" "$3" >>"$work/times.csv" <<'END'
import json, sys
rows = json.load(open(sys.argv[1]))["rows"]
row = next(r for r in rows if f"{r['name']}/{r['scene']}/{r['size']}" == sys.argv[2])
print(sys.argv[3], 1e3 * row["seconds"]["median"], sep=",")
END
}

# One round of a row. Who goes first changes: what a program leaves in caches and in the clock helps neither.
compare() { # round, old row, new row, bench options
  local round=$1 old_id=$2 new_id=$3
  shift 3
  if ((round % 2)); then
    run "$old" "$old_id" "$new_id,$round,old" "$@" && run "$new" "$new_id" "$new_id,$round,new" "$@"
  else
    run "$new" "$new_id" "$new_id,$round,new" "$@" && run "$old" "$old_id" "$new_id,$round,old" "$@"
  fi || return 1
  [[ $noise != own ]] || run "$old" "$old_id" "$new_id,$round,again" "$@"
}

echo "row,round,program,ms" >"$work/times.csv"
left_out=0
while read -r old_id new_id; do
  for ((round = 1; round <= rounds; ++round)); do
    if ! compare "$round" "$old_id" "$new_id" "$@" </dev/null; then
      left_out=1
      grep -v "^$new_id," "$work/times.csv" >"$work/kept.csv" && mv "$work/kept.csv" "$work/times.csv"
      break
    fi
  done
done <"$work/rows"
if [[ -n $csv ]]; then cp "$work/times.csv" "$csv"; fi

python3 - "$work/times.csv" "$noise" "$left_out" <<'END'
import csv, statistics, sys
times = {}
for line in csv.DictReader(open(sys.argv[1])):
    times.setdefault(line["row"], {}).setdefault(line["round"], {})[line["program"]] = float(line["ms"])
slower = False
print(f"{'row':36} {'old ms':>10} {'new ms':>10} {'new/old':>8}  spread          noise")
for row, rounds in times.items():
    ratios = sorted(r["new"] / r["old"] for r in rounds.values())
    ratio = statistics.median(ratios)
    noise = 0.05 if sys.argv[2] == "own" else float(sys.argv[2])
    own = [abs(r["again"] / r["old"] - 1) for r in rounds.values() if "again" in r]
    if own:
        noise = max(noise, statistics.median(own))
    enough = 0.75 * len(ratios)
    verdict = "same"
    if ratio > 1 and sum(r > 1 + noise for r in ratios) >= enough:
        verdict, slower = "slower", True
    if ratio < 1 and sum(r < 1 - noise for r in ratios) >= enough:
        verdict = "faster"
    print(f"{row:36} {statistics.median(r['old'] for r in rounds.values()):10.3f}"
          f" {statistics.median(r['new'] for r in rounds.values()):10.3f} {ratio:8.3f}"
          f"  {ratios[0]:.3f} to {ratios[-1]:.3f}  {noise:.3f}  {verdict}")
sys.exit(3 if slower else int(sys.argv[3]))
END
