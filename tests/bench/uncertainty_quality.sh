#!/usr/bin/env bash
# Compares the stated uncertainty of camera poses with their errors on rendered sequences, and prints a Markdown table:
# the share of the final poses whose position and rotation errors are within the 95 % bound, and the median bound over
# the median error.
#
#   tests/bench/uncertainty_quality.sh BUILD_DIR OUT_DIR [-- OPTION_OF_TRACK_BENCH...]
#
# Environment: SCENES (all; names of the list below), MODES (replay live depth). Sequences in OUT_DIR are not rendered
# again.
set -euo pipefail
[ $# -ge 2 ] || { sed -n '2,9s/^# \{0,1\}//p' "$0" >&2; exit 2; }
build=$1 out=$2
shift 2
[ $# -eq 0 ] || shift

declare -A scenes=(
  [circle]='--seed 1 --path orbit --frames 120'
  [arc]='--seed 2 --path handheld --arc 120 --frames 150'
  [short_arc]='--seed 7 --path handheld --arc 40 --frames 120'
  [two_rounds]='--seed 8 --path handheld --arc 720 --rounds 2 --objects 5 --frames 240'
  [repeated]='--seed 3 --path handheld --arc 300 --table-texture repeat:3 --walls identical --objects 5 --frames 150'
  [small_image]='--seed 4 --path handheld --arc 200 --width 320 --height 240 --frames 150'
  [noise]='--seed 5 --path orbit --noise 8 --frames 120'
)
declare -A modes=([replay]='--one-thread' [live]='--fps 25' [depth]='--one-thread --depth')

figures() {  # prints the numbers of track_bench's line on the uncertainty
  sed -n 's/^uncertainty: \([0-9.]*\) % of position and \([0-9.]*\) %.* \([0-9.]*\) and \([0-9.]*\)$/\1 % | \2 % | \3 | \4/p' "$1"
}

echo '| sequence | mode | ATE rmse [cm] | position errors within the bound | rotation errors within the bound | bound over error: position | rotation |'
echo '| --- | --- | --- | --- | --- | --- | --- |'
for name in ${SCENES:-circle arc short_arc two_rounds repeated small_image noise}; do
  sequence=$out/$name
  # shellcheck disable=SC2086
  [ -f "$sequence/groundtruth.txt" ] ||
    "$build/client/cli/romap" synth --out "$sequence" ${scenes[$name]} >&2
  for mode in ${MODES:-replay live depth}; do
    log=$out/$name.$mode.txt
    # shellcheck disable=SC2086
    "$build/tests/bench/track_bench" "$sequence" --out "$out/$name.$mode" ${modes[$mode]} "$@" \
      >"$log" 2>&1
    ate=$(sed -n 's/^ATE rmse \([0-9.]*\) cm.*/\1/p' "$log")
    echo "| $name | $mode | $ate | $(figures "$log") |"
  done
done
