#!/usr/bin/env bash
# Measures the contribution of each part of object mapping: everything, everything without one part, and the method of
# the paper, each with undamaged masks and with all usual kinds of damage together. Prints Markdown tables.
#
#   tests/bench/object_ablation.sh BUILD_DIR SEQUENCE...
#
# Environment: SEEDS (5), POSES (none) and JOBS (2), as for object_quality.sh.
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
      inside && /^\| (undamaged|all of these)/ { sub(/^\| /, "| " title " | "); print }'
}

sequences=("$@")
echo '| objects | masks | found | extra | IoU drop | mean IoU | lowest IoU | center [cm] | in plane [cm] | yaw, median [deg] | right class |'
echo '| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |'
row 'romap'
row 'with greedy IoU instead of the best assignment of all evidence' objects.association=greedy_iou
row 'without outlier removal by hull and isolation forest' objects.outlier_removal=none
row 'without outlier removal by the hull' objects.outlier_removal=forest
row 'without straight edges for the yaw' objects.edge_yaw_min_confidence=1
row 'cuboids from points alone' objects.cuboid_from=points
row 'the paper: greedy IoU, forest, points, edges' objects.association=greedy_iou objects.outlier_removal=forest \
  objects.cuboid_from=points
row 'the paper without outlier removal and edges: greedy IoU, points, main axis' objects.association=greedy_iou objects.outlier_removal=none \
  objects.cuboid_from=points objects.edge_yaw_min_confidence=1
