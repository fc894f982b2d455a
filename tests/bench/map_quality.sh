#!/usr/bin/env bash
# Measures complete runs: streams sequences through a romap-server on loopback at the recorded rate, with labels permuted
# in each frame, and prints a Markdown table of the results against the ground truth.
#
#   tests/bench/map_quality.sh BUILD_DIR OUT_DIR [SEQUENCE...]
#
# The environment variable POSES=none tracks the camera from the images. Without SEQUENCE, renders three synthetic
# sequences (150 frames, five objects, seeds 1 to 3) in OUT_DIR. The figures are means over the objects, for the surface
# visible to at least one camera; distances are in cm. Closed, hollow and normals compare with the whole surface,
# undersides included (client/README.md, Evaluation).
set -euo pipefail
[ $# -ge 2 ] || { sed -n '2,9s/^# \{0,1\}//p' "$0" >&2; exit 2; }
build=$1 out=$2
shift 2
mkdir -p "$out"
romap=$build/client/cli/romap
sequences=("$@")
if [ ${#sequences[@]} -eq 0 ]; then
  for seed in 1 2 3; do
    [ -f "$out/synth_$seed/objects.yaml" ] ||
      "$romap" synth --out "$out/synth_$seed" --frames 150 --objects 5 --seed "$seed" >&2
    sequences+=("$out/synth_$seed")
  done
fi

"$build/server/romap-server" --ephemeral --listen 127.0.0.1:0 --http "" --log-level warning >"$out/server.out" 2>"$out/server.err" &
server=$!
trap 'kill $server 2>/dev/null || true' EXIT
for _ in $(seq 100); do
  address=$(sed -n 's/^romap-server listening on //p' "$out/server.out")
  [ -n "$address" ] && break
  sleep 0.1
done
[ -n "$address" ] || { echo "romap-server did not listen within 10 s" >&2; cat "$out/server.out" "$out/server.err" >&2; exit 1; }

echo '| sequence | objects found | cuboid IoU | accuracy | completion | < 0.4 cm | < 1 cm | closed | hollow | normals | first cuboid, mesh (slowest) | training after the last frame | frames dropped | peak memory of server, client |'
echo '| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |'
for sequence in "${sequences[@]}"; do
  name=$(basename "$sequence")
  "$romap" run "$sequence" --server "$address" --realtime --permute-labels 1 \
    --poses "${POSES:-given}" --out "$out/$name.map" --no-pictures >"$out/$name.txt"
  awk -v name="$name" '
    / rejected, .* dropped\)/ { dropped = $7; for (i = 1; i < NF; ++i) if ($i == "took") training = $(i + 1) }
    /^peak memory:/ { memory = $4 " MiB, " $7 " MiB" }
    /^[0-9]+_/ && / s +[0-9]+ +[0-9.]+ s +[0-9.]+ s$/ { if ($(NF-3) > cuboid) cuboid = $(NF-3); if ($(NF-1) > mesh) mesh = $(NF-1) }
    /^mean/ && !found { found = $2 " of " $4; acc = $6; comp = $8; r04 = $10; r1 = $12; closed = $13; hollow = $14; normal = $15; next }
    /^mean / && NF <= 8 { iou = $5 }
    END { printf "| %s | %s | %.2f | %.3f | %.3f | %.1f %% | %.1f %% | %.3f | %s %% | %s deg | %.2f s, %.2f s | %s s | %s | %s |\n",
                 name, found, iou, acc, comp, r04, r1, closed, hollow, normal, cuboid, mesh, training, dropped, memory }' "$out/$name.txt"
done
