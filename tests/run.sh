#!/usr/bin/env bash
# Installs what is missing, builds everything with warnings as errors, and runs all tests. Safe to run again.
#
#   ./tests/run.sh [PRESET]     a preset of CMakePresets.json: ci (default), debug, asan, tsan, ...
#
# ROMAP_DATA_DIR and ROMAP_TOOLS_DIR, when set, name folders with recorded sequences and reference evaluators; checks
# against them are skipped otherwise.
set -euo pipefail
cd "$(dirname "$0")/.."
preset=${1:-ci}
./deploy/setup.sh tests
if ! command -v nvcc >/dev/null; then
  echo "run.sh: no nvcc here: the CUDA back end is not compiled"
fi
mkdir -p build
cmake --preset "$preset" >"build/configure-$preset.log" 2>&1 || { cat "build/configure-$preset.log"; exit 1; }
cmake --build --preset "$preset"
exec ctest --preset "$preset" --parallel "$(nproc)"
