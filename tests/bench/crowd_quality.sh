#!/usr/bin/env bash
# Measures a map with many objects: maps a synthetic sequence of twelve objects at 25 Hz, with tracking and training on
# the same machine, and prints a Markdown table that compares each object with Table 1 of the paper (accuracy 0.431 cm,
# completion 0.248 cm, 80.85 % below 0.4 cm, 98.93 % below 1 cm), for the surface visible to at least one camera.
#
#   tests/bench/crowd_quality.sh BUILD_DIR OUT_DIR [SEQUENCE]
#
# The environment variables FRAMES, OBJECTS and SEED change the sequence (300, 12, 1); POSES=none tracks the camera from
# the images. Other load on the machine degrades the figures, so the load average before and after the run is printed.
set -euo pipefail
[ $# -ge 2 ] || { sed -n '2,9s/^# \{0,1\}//p' "$0" >&2; exit 2; }
build=$1 out=$2
frames=${FRAMES:-300} objects=${OBJECTS:-12} seed=${SEED:-1}
romap=$build/client/cli/romap
mkdir -p "$out"
sequence=${3:-$out/crowd_${objects}_$seed}
[ -f "$sequence/objects.yaml" ] ||
  "$romap" synth --out "$sequence" --frames "$frames" --objects "$objects" --seed "$seed" >&2

load=$(cut -d' ' -f1 /proc/loadavg)
"$romap" run "$sequence" --local --realtime --permute-labels 1 --poses "${POSES:-given}" \
  --out "$out/crowd.map" --no-pictures >"$out/crowd.txt"
awk -v load="$load to $(cut -d' ' -f1 /proc/loadavg)" '
  / rejected, .* dropped\)/ { run = $0 }
  / acc +acc.seen / { meshes = 1; print "| object | accuracy | completion | < 0.4 cm | < 1 cm | reaches the paper |"
                      print "| --- | --- | --- | --- | --- | --- |"; next }
  /^cuboids/ { meshes = 0 }
  meshes && NF >= 10 {
    missed = ""
    if ($4 > 0.431) missed = missed " accuracy"
    if ($6 > 0.248) missed = missed " completion"
    if ($8 < 80.85) missed = missed " <0.4"
    if ($10 < 98.93) missed = missed " <1"
    mean = $1 == "mean"
    if (mean) { acc = $6; comp = $8; r04 = $10; r1 = $12; missed = reached + 0 " of " $4 } else { acc = $4; comp = $6; r04 = $8; r1 = $10; }
    if (!mean && missed == "") { ++reached; missed = "yes" } else if (!mean) missed = "no:" missed
    printf "| %s | %s | %s | %s | %s | %s |\n", $1, acc, comp, r04, r1, missed
  }
  END { print ""; print run; print "load: " load }' "$out/crowd.txt"
