#!/usr/bin/env bash
# What each part of the object map is worth: the whole against the whole without one part, and the recipe of the paper,
# with masks as they are and damaged in all usual ways together. Prints Markdown tables.
#
#   tests/bench/object_ablation.sh BUILD_DIR SEQUENCE...
#
# SEEDS (5), POSES (none) and JOBS (2) in the environment as for object_quality.sh.
set -euo pipefail
[ $# -ge 2 ] || { sed -n '2,7s/^# \{0,1\}//p' "$0" >&2; exit 2; }
quality=$1/tests/bench/object_quality
shift

row() {
  local title=$1
  shift
  local sets=()
  for value in "$@"; do sets+=(--set "$value"); done
  "$quality" "${sequences[@]}" --poses "${POSES:-none}" --seeds "${SEEDS:-5}" --jobs "${JOBS:-2}" --damage together \
    ${sets[@]+"${sets[@]}"} |
    awk -v title="$title" '/^Damaged masks/ { inside = 1 }
      inside && /^\| (as they are|all of these)/ { sub(/^\| /, "| " title " | "); print }'
}

sequences=("$@")
echo '| objects | masks | found | extra | IoU drop | mean IoU | least IoU | centre [cm] | in plane [cm] | yaw, median [deg] | right class |'
echo '| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |'
row 'romap'
row 'without the best assignment of all evidence (greedy IoU)' objects.association=greedy_iou
row 'without the isolation forest and the hull against outliers' objects.outlier_removal=none
row 'without the hull against outliers' objects.outlier_removal=forest
row 'without straight edges for the yaw' objects.edge_yaw_min_confidence=1
row 'cuboids from points alone' objects.cuboid_from=points
row 'the paper: greedy IoU, forest, points, edges' objects.association=greedy_iou objects.outlier_removal=forest \
  objects.cuboid_from=points
row 'its plain form: greedy IoU, all points, main axis' objects.association=greedy_iou objects.outlier_removal=none \
  objects.cuboid_from=points objects.edge_yaw_min_confidence=1
