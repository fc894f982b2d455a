#!/usr/bin/env bash
# Renders scenes that mislead camera tracking, maps them from images alone, and prints Markdown tables against ground
# truth. Rendered scenes in OUT_DIR are used again.
#
#   tests/bench/stress_quality.sh BUILD_DIR OUT_DIR [repeated|rounds|plain|black|rolling]...
#
#   repeated  ten scenes without a place seen twice, with repeated texture and four equal walls: no loop may be closed
#   rounds    five scenes with two rounds: the drift that true loops remove
#   plain     five scenes on a plain light table: up and cuboids
#   rolling   five scenes with fast hand motion and a rolling shutter (72 % of the frame interval): its readout time
#             ignored, known, and the same scenes with a global shutter
#   black     eight single objects on a black background with given poses: cuboids
set -euo pipefail
[ $# -ge 2 ] || { sed -n '2,12s/^# \{0,1\}//p' "$0" >&2; exit 2; }
build=$1 out=$2
shift 2
[ $# -gt 0 ] || set -- repeated rounds plain black rolling
mkdir -p "$out"
# Messages of the programs, for errors.
log=$out/log.txt
render() { [ -d "$out/$1/gt" ] || "$build/client/cli/romap" synth --out "$out/$1" "${@:2}" >"$log" 2>&1; }
track() { "$build/tests/bench/track_bench" "$out/$1" --out "$out/$1.track" --one-thread "${@:2}" 2>&1; }
objects() { "$build/tests/bench/object_quality" "$out/$1" --seeds 1 "${@:2}" 2>"$log" | grep "^| $1 |"; }
field() { awk -F'|' -v column="$1" '{ gsub(/ /, "", $column); print $column }'; }
centimeters() { sed -n 's/^ATE rmse \([0-9.]*\) cm.*/\1/p'; }

for kind in "$@"; do
  case $kind in
    repeated)
      echo '| scene | ATE rmse, seeds 1 to 5: median, worst [cm] | lost frames | loops corrected | objects found | extra |'
      echo '| --- | --- | --- | --- | --- | --- |'
      for seed in 1 2 3 4 5 6 7 8 9 10; do
        scene=repeated.$seed
        render "$scene" --path handheld --arc 300 --frames 200 --table-texture "repeat:$((2 + seed % 2))" \
          --walls identical --objects $((5 + seed % 4)) --seed "$seed"
        runs=$(for s in 1 2 3 4 5; do track "$scene" --set "slam.seed=$s"; done)
        errors=$(echo "$runs" | centimeters | sort -n)
        row=$(objects "$scene" --poses none)
        echo "| $scene | $(echo "$errors" | sed -n 3p), $(echo "$errors" | tail -1)" \
             "| $(echo "$runs" | sed -n 's/.* lost \([0-9]*\),.*/\1/p' | awk '{ s += $1 } END { print s + 0 }')" \
             "| $(echo "$runs" | sed -n 's/.*loops \([0-9]*\) corrected.*/\1/p' | awk '{ s += $1 } END { print s + 0 }')" \
             "| $(echo "$row" | awk -F'|' '{ print $4 }') | $(echo "$row" | field 5) |"
      done ;;
    rounds)
      echo '| scene | ATE rmse without loops [cm] | with loops [cm] | loops corrected |'
      echo '| --- | --- | --- | --- |'
      for seed in 1 2 3 4 5; do
        scene=rounds.$seed
        render "$scene" --path handheld --arc 720 --rounds 2 --frames 240 --objects 5 --seed "$seed"
        with=$(track "$scene")
        echo "| $scene | $(track "$scene" --set slam.close_loops=false | centimeters) | $(echo "$with" | centimeters)" \
             "| $(echo "$with" | sed -n 's/.*loops \([0-9]*\) corrected.*/\1/p') |"
      done ;;
    rolling)
      echo '| scene | ATE rmse, readout time ignored [cm] | known [cm] | global shutter [cm] | time per frame, known and global: median [ms] |'
      echo '| --- | --- | --- | --- | --- |'
      for seed in 1 2 3 4 5; do
        scene=rolling.$seed
        options=(--path handheld --hand-motion 4 --frames 200 --objects 4 --seed "$seed")
        render "$scene" "${options[@]}" --rolling-shutter 0.72
        render "global.$seed" "${options[@]}"
        known=$(track "$scene")
        ignored=$(track "$scene" --readout-ms 0)
        global=$(track "global.$seed")
        milliseconds() { sed -n 's/^tracking: median \([0-9.]*\) ms.*/\1/p'; }
        echo "| $scene | $(echo "$ignored" | centimeters) | $(echo "$known" | centimeters)" \
             "| $(echo "$global" | centimeters) | $(echo "$known" | milliseconds), $(echo "$global" | milliseconds) |"
      done ;;
    plain)
      echo '| scene | ATE rmse [cm] | up direction error | confidence | objects found | extra | mean IoU |'
      echo '| --- | --- | --- | --- | --- | --- | --- |'
      for seed in 1 2 3 4 5; do
        scene=plain.$seed
        render "$scene" --table-texture plain --frames 150 --objects 5 --seed "$seed"
        run=$(track "$scene")
        row=$(objects "$scene" --poses none)
        echo "| $scene | $(echo "$run" | centimeters) | $(echo "$run" | sed -n 's/^up direction error \(.*\)/\1/p')" \
             "| $(echo "$run" | sed -n 's/^keyframes .*up confidence \(.*\)/\1/p') | $(echo "$row" | awk -F'|' '{ print $4 }')" \
             "| $(echo "$row" | field 5) | $(echo "$row" | field 6) |"
      done ;;
    black)
      echo '| scene | found | extra | IoU |'
      echo '| --- | --- | --- | --- |'
      for seed in 1 2 3 4 5 6 7 8; do
        scene=black.$seed
        render "$scene" --background black --frames 80 --objects 1 --seed "$seed"
        row=$(objects "$scene" --poses given)
        echo "| $scene | $(echo "$row" | awk -F'|' '{ print $4 }') | $(echo "$row" | field 5) | $(echo "$row" | field 6) |"
      done ;;
    *) echo "stress_quality.sh: unknown kind '$kind'; use repeated, rounds, plain or black" >&2; exit 2 ;;
  esac
  echo
done
