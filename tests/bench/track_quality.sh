#!/usr/bin/env bash
# Tracks the camera through sequences from their images, with five seeds each, and prints a Markdown table against ground
# truth: medians over the seeds, and the worst error. Lengths as in the ground truth, errors after Sim3 (SE3 with depth).
#
#   tests/bench/track_quality.sh BUILD_DIR OUT_DIR SEQUENCE... [-- OPTION_OF_TRACK_BENCH...]
set -euo pipefail
[ $# -ge 3 ] || { sed -n '2,5s/^# \{0,1\}//p' "$0" >&2; exit 2; }
build=$1 out=$2
shift 2
sequences=()
while [ $# -gt 0 ] && [ "$1" != -- ]; do sequences+=("$1"); shift; done
[ $# -eq 0 ] || shift
mkdir -p "$out"
middle() { sort -n | awk '{ v[NR] = $1 } END { print v[int((NR + 1) / 2)] }'; }

echo '| sequence | first tracked frame | tracked after that | ATE rmse: median, worst [cm] | of the path length | up direction error | time per frame: median, p99 [ms] | relative to cv::ORB | local adjustment: mean [ms] |'
echo '| --- | --- | --- | --- | --- | --- | --- | --- | --- |'
for sequence in "${sequences[@]}"; do
  name=$(basename "$sequence")
  for seed in 1 2 3 4 5; do
    "$build/tests/bench/track_bench" "$sequence" --out "$out/$name.$seed" --set "slam.seed=$seed" "$@" >"$out/$name.$seed.txt" 2>&1
  done
  all() { cat "$out/$name".[1-5].txt; }
  echo "| $name | $(all | sed -n 's/.*first tracked \([0-9]*\).*/\1/p' | middle)" \
       "| $(all | sed -n 's/.* later frames (\([0-9.]*\) %.*/\1/p' | middle) %" \
       "| $(all | sed -n 's/^ATE rmse \([0-9.]*\) cm.*/\1/p' | middle), $(all | sed -n 's/^ATE rmse \([0-9.]*\) cm.*/\1/p' | sort -n | tail -1)" \
       "| $(all | sed -n 's/^ATE rmse .* cm, \([0-9.]*\) %.*/\1/p' | middle) %" \
       "| $(all | sed -n 's/^up direction error \([0-9.]*\) deg/\1/p' | middle) deg" \
       "| $(all | sed -n 's/^tracking: median \([0-9.]*\) ms.*/\1/p' | middle), $(all | sed -n 's/^tracking: .*p99 \([0-9.]*\) ms.*/\1/p' | middle)" \
       "| $(all | sed -n 's/^tracking: .* ms, \([0-9.]*\) times.*/\1/p' | middle)" \
       "| $(all | sed -n 's/.*local adjustment: mean \([0-9]*\) ms.*/\1/p' | middle) |"
done
