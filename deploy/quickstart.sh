#!/usr/bin/env bash
# From a fresh Debian 12 to meshes of objects: installs packages, builds romap, renders a sample sequence, starts
# romap-server on loopback, streams the sample through it, and prints the results. Can be repeated safely.
#
#   ./deploy/quickstart.sh [--page] [FOLDER]     FOLDER for the sample and its results, default romap_out
#
# --page: keeps the server until Ctrl-C, so that its page shows the finished map.
set -euo pipefail
cd "$(dirname "$0")/.."
keep=
if [ "${1:-}" = --page ]; then
  keep=yes
  shift
fi
out=${1:-romap_out}
heading() { printf '\n== %s\n' "$*"; }
start=$SECONDS

heading "1/4 packages"
./deploy/setup.sh
echo "all packages are installed"

heading "2/4 build"
cmake --preset release -DROMAP_BUILD_TESTS=OFF >build-configure.log 2>&1 || { cat build-configure.log; exit 1; }
rm -f build-configure.log
cmake --build --preset release --target romap romap-server
bin=build/release

heading "3/4 sample sequence"
mkdir -p "$out"
"$bin/client/cli/romap" synth --out "$out/sample" --frames 150 --objects 5 --seed 1

heading "4/4 server and client"
server_log=$out/server.log
"$bin/server/romap-server" --ephemeral --listen 127.0.0.1:0 --http 127.0.0.1:0 >"$server_log" 2>&1 &
server=$!
trap 'kill $server 2>/dev/null || true; wait $server 2>/dev/null || true' EXIT
for _ in $(seq 100); do
  address=$(sed -n 's/^romap-server listening on //p' "$server_log")
  page=$(sed -n 's/^romap-server page at //p' "$server_log")
  [ -n "$address" ] && [ -n "$page" ] && break
  kill -0 $server 2>/dev/null || { cat "$server_log" >&2; exit 1; }
  sleep 0.1
done
[ -n "${address:-}" ] || { echo "romap-server did not start; see $server_log" >&2; exit 1; }
echo "romap-server listens on $address; watch the map grow at $page"
"$bin/client/cli/romap" run "$out/sample" --server "$address" --out "$out/map" --keep-session

printf '\nDone in %d s. Open the meshes with any glTF or PLY viewer, the pictures with any image viewer.\n' $((SECONDS - start))
if [ -n "$keep" ]; then
  printf 'The page at %s shows the map. Ctrl-C ends the server.\n' "$page"
  wait $server
fi
