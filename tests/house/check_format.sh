#!/usr/bin/env bash
# Lists the files that clang-format would change, and fails if there are any. `--fix` formats them.
set -euo pipefail
cd "$(dirname "$0")/../.."
formatter=$(command -v clang-format-14 || command -v clang-format) || { echo "clang-format 14 is not installed; see deploy/setup.sh"; exit 1; }
mode=(--dry-run -Werror)
[ "${1:-}" != --fix ] || mode=(-i)
find common server client tests \( -name '*.cc' -o -name '*.h' -o -name '*.cu' -o -name '*.cuh' \) -print0 |
  xargs -0 -n 40 -P 2 "$formatter" "${mode[@]}"
