#!/usr/bin/env bash
# Measures the object map with undamaged masks and with simulated detector errors, and prints Markdown tables.
#
#   tests/bench/object_quality.sh BUILD_DIR OUT_DIR [SEQUENCE...]
#
# Without SEQUENCE it renders three synthetic ones in OUT_DIR: 150 frames of 12 objects with three identical pairs, two
# hand-held and one orbit. Environment: SEEDS (5), POSES (both; given or none), JOBS (2). If ROMAP_DATA_DIR contains
# redkitchen_600, the map from the masks of a real detector is printed too.
set -euo pipefail
[ $# -ge 2 ] || { sed -n '2,8s/^# \{0,1\}//p' "$0" >&2; exit 2; }
build=$1 out=$2
shift 2
mkdir -p "$out"
quality=$build/tests/bench/object_quality
sequences=("$@")
if [ ${#sequences[@]} -eq 0 ]; then
  for seed in 11 12 13; do
    path=handheld
    [ "$seed" -ne 13 ] || path=orbit
    [ -f "$out/twins_$seed/objects.yaml" ] ||
      "$build/client/cli/romap" synth --out "$out/twins_$seed" --frames 150 --objects 12 --identical-pairs 3 \
        --path "$path" --seed "$seed" >&2
    sequences+=("$out/twins_$seed")
  done
fi

"$quality" "${sequences[@]}" --poses "${POSES:-both}" --seeds "${SEEDS:-5}" --jobs "${JOBS:-2}" --damage all \
  --draw "$out/pictures"

kitchen=${ROMAP_DATA_DIR:-}/redkitchen_600
if [ -f "$kitchen/mask_yolo.txt" ]; then
  echo '# Masks of a real detector'
  echo
  "$quality" "$kitchen" --masks mask_yolo.txt --detections detections_yolo.csv --poses "${POSES:-both}" --seeds 1 --list \
    --draw "$out/pictures_detector"
else
  echo 'object_quality: skipping the real detector: ROMAP_DATA_DIR/redkitchen_600/mask_yolo.txt does not exist' >&2
fi
