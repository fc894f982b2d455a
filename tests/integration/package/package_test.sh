#!/usr/bin/env bash
# Creates the Debian packages, unpacks them into an empty folder, builds the client in this folder against the unpacked SDK,
# and connects it to the unpacked server.
#
#   package_test.sh BUILD_DIR
set -euo pipefail
build=$(realpath "$1") here=$(dirname "$(realpath "$0")")
work=$(mktemp -d)
server=
trap '[ -z "$server" ] || kill "$server" 2>/dev/null || true; rm -rf "$work"' EXIT

cpack --config "$build/CPackConfig.cmake" -B "$work/packages" >"$work/cpack.log" 2>&1 || { cat "$work/cpack.log"; exit 1; }
for package in romap-server romap libromap-dev; do
  deb=("$work"/packages/"${package}"_*.deb)
  [ -f "${deb[0]}" ] || { echo "cpack did not create the package $package: $(ls "$work/packages")"; exit 1; }
  dpkg-deb -x "${deb[0]}" "$work/root"
done
prefix=$work/root/usr
for file in bin/romap bin/romap-server share/romap/server.yaml share/romap/proto/romap/v1/mapping.proto; do
  [ -s "$prefix/$file" ] || { echo "$file is not in any package"; exit 1; }
done

cmake -S "$here" -B "$work/client" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_BUILD_TYPE=Debug >"$work/client.log" 2>&1 &&
  cmake --build "$work/client" >>"$work/client.log" 2>&1 || { cat "$work/client.log"; exit 1; }

cmake -S "$here/../../../client/examples" -B "$work/examples" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_BUILD_TYPE=Debug \
  >"$work/examples.log" 2>&1 &&
  cmake --build "$work/examples" >>"$work/examples.log" 2>&1 || { cat "$work/examples.log"; exit 1; }

"$prefix/bin/romap-server" --config "$prefix/share/romap/server.yaml" --ephemeral --listen 127.0.0.1:0 --http "" \
  --set nerf.first_budget_steps=40 --set nerf.full_budget_steps=40 --set mesh.min_side_nodes=32 --set mesh.resolution=32 \
  >"$work/server.log" 2>&1 &
server=$!
address=
for _ in $(seq 300); do
  address=$(sed -n 's/^romap-server listening on //p' "$work/server.log")
  [ -n "$address" ] && break
  kill -0 "$server" 2>/dev/null || { cat "$work/server.log"; exit 1; }
  sleep 0.1
done
[ -n "$address" ] || { echo "romap-server did not listen within 30 s"; cat "$work/server.log"; exit 1; }

"$work/client/my_client" "$address" >"$work/client.out"
echo "built a client against the packages and connected it to the server; sessions: $(wc -l <"$work/client.out")"

# The AR client maps a rendered sequence whose poses are turned into those of an AR framework.
"$prefix/bin/romap" synth --out "$work/ar" --seed 3 --objects 2 --frames 20 --width 320 --height 240 >/dev/null 2>&1
grep -v '^#' "$work/ar/groundtruth.txt" | awk '{ s = sqrt(0.5); x = -$8; y = -$7; z = $6; w = $5
  printf "%s rgb/%06d.png mask/%06d.png %f %f %f %.9f %.9f %.9f %.9f\n", $1, NR, NR, $2, $4, -$3,
    s * (x - w), s * (y + z), s * (z - y), s * (w + x) }' >"$work/ar/frames.txt"
"$work/examples/ar_client" "$address" "$work/ar" 288 288 159.5 119.5 320 240 >"$work/ar.out" || { cat "$work/ar.out"; exit 1; }
[ "$(grep -c ' triangles$' "$work/ar.out")" -eq 2 ] || { echo "ar_client: expected two objects:"; cat "$work/ar.out"; exit 1; }

"$work/client/my_client" 127.0.0.1:1 2>"$work/refused.out" && { echo "expected an error without a server"; exit 1; }
grep -q UNAVAILABLE "$work/refused.out" || { echo "expected UNAVAILABLE, got:"; cat "$work/refused.out"; exit 1; }
