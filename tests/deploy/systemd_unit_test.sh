#!/usr/bin/env bash
# The unit file is valid, its sandbox is strict, and the options that it passes exist. Exits with 77 where systemd-analyze
# is missing.
#
#   systemd_unit_test.sh PATH_OF_ROMAP_SERVER
set -euo pipefail
server=$1
unit=$(dirname "$0")/../../deploy/systemd/romap-server.service
command -v systemd-analyze >/dev/null || { echo "skipped: systemd-analyze is not installed"; exit 77; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
sed "s|/usr/bin/romap-server|$server|" "$unit" >"$folder/romap-server.service"
messages=$(systemd-analyze verify "$folder/romap-server.service" 2>&1) || { echo "$messages"; exit 1; }
# Other units of the machine are not of interest.
if grep "romap-server.service" <<<"$messages"; then exit 1; fi
# 0 is the most strict, 10 the least; 2.0 is "OK".
systemd-analyze security --offline=true --threshold=20 "$folder/romap-server.service" | tail -n 1
"$server" --check-config --data-dir "$folder/state"
