#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Kills training runs at random moments and resumes them; see --help.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)

usage() {
  cat <<'END'
usage: scripts/reliability/kill_loop.sh N [OPTIONS]
Trains on a small generated data set with a checkpoint after every iteration, sends SIGKILL at a random moment (every
other time only once a checkpoint is being written), starts the same command with --resume latest again, and so on until
N runs were killed. Every start has to succeed. A run that gets to its end has to leave the model and the checkpoint of a
run that nobody disturbed, byte for byte; then the next one begins from nothing. Exit status 1 at the first difference or
failure; the folder then stays for a look.

  --raysplats FILE    program (build/release/bin/raysplats)
  --iterations N      of a run (40)
  --seed N            of the random moments (1)
  --help
END
}

fail() {
  echo "kill_loop.sh: $*" >&2
  exit "${status:-2}"
}

kills=
raysplats=$root/build/release/bin/raysplats
iterations=40
seed=1
while (($# > 0)); do
  case $1 in
    --help) usage && exit 0 ;;
    --raysplats | --iterations | --seed)
      (($# > 1)) || fail "$1 needs a value"
      declare "${1#--}=$2"
      shift 2
      ;;
    -*) fail "unknown option $1, see --help" ;;
    *) kills=$1 && shift ;;
  esac
done
[[ $kills =~ ^[0-9]+$ ]] || fail "how many kills? see --help"
[[ -x $raysplats ]] || fail "$raysplats does not exist, build it or name it with --raysplats"

folder=$(mktemp -d "${TMPDIR:-/tmp}/raysplats_kill_XXXXXX")
child=
trap '[[ -z $child ]] || kill -9 "$child" 2>/dev/null || true' EXIT
RANDOM=$seed
"$raysplats" -q generate "$folder/data" --size 32 --train-views 6 --test-views 1 >/dev/null

# train FOLDER MORE...
train=("$raysplats" -q train "$folder/data" -n "$iterations" --init-count 400 --max-gaussians 800 --sh-degree 1
  --densify-from 8 --densify-every 8 --resolution-schedule 10 --checkpoint-every 1 --log-every 1 --deterministic)
begin=$(date +%s%N)
"${train[@]}" -o "$folder/reference" >"$folder/log.txt" 2>&1 || fail "the undisturbed run failed, see $folder/log.txt"
length=$((($(date +%s%N) - begin) / 1000000))

last=step_$(printf '%09d' "$iterations").rsck
result() {
  (cd "$1" && sha256sum "checkpoints/$last" "point_cloud/iteration_$iterations/point_cloud.ply")
}
expected=$(result "$folder/reference")

killed=0
resumed=0
finished=0
torn=0
status=1
finish() {
  [[ $(result "$folder/run") == "$expected" ]] || fail "a resumed run ended otherwise, compare $folder/run with $folder/reference"
  [[ -z $(find "$folder/run" -name '.*.tmp*') ]] || fail "a resumed run left temporary files in $folder/run"
  finished=$((finished + 1))
  rm -rf "$folder/run"
}
while ((killed < kills)); do
  [[ ! -e $folder/run/checkpoints ]] || resumed=$((resumed + 1))
  "${train[@]}" -o "$folder/run" --resume latest >"$folder/log.txt" 2>&1 &
  child=$!
  # Anywhere in a run, its first moments included.
  moment=$(((RANDOM * 32768 + RANDOM) % length))
  sleep "$((moment / 1000)).$(printf '%03d' $((moment % 1000)))"
  if ((killed % 2 == 0)); then
    for ((i = 0; i < 2000; ++i)); do
      ! compgen -G "$folder/run/checkpoints/.step_*" >/dev/null || break
    done
  fi
  kill -9 "$child" 2>/dev/null || true
  code=0
  wait "$child" 2>/dev/null || code=$?
  child=
  case $code in
    137)
      killed=$((killed + 1))
      [[ -z $(find "$folder/run" -name '.*.tmp*' 2>/dev/null) ]] || torn=$((torn + 1))
      ;;
    0) finish ;;
    *) fail "a start ended with $code, see $folder/log.txt" ;;
  esac
done
resumed=$((resumed + 1))
"${train[@]}" -o "$folder/run" --resume latest >"$folder/log.txt" 2>&1 || fail "the last start failed, see $folder/log.txt"
finish
rm -rf "$folder"
echo "$killed runs killed, $torn of them in the middle of writing a file; $resumed resumed, $finished finished: all equal to the undisturbed run"
