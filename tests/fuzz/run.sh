#!/usr/bin/env bash
# Builds the fuzz targets with clang and lets libFuzzer search in each of them. Ends with a table, and with an error if
# there is a finding.
#
#   tests/fuzz/run.sh [SECONDS [TARGET...]]     30 seconds per target by default, all targets
#
# Inputs that reach new code are kept in build/fuzz/corpus, so that the next run continues there. Findings are in
# build/fuzz/findings.
set -euo pipefail
cd "$(dirname "$0")/../.."
seconds=${1:-30}
shift || true
case $seconds in '' | *[!0-9]* | 0) echo "run.sh: the seconds must be a number above 0, are '$seconds'" >&2; exit 2 ;; esac
./deploy/setup.sh fuzz
mkdir -p build
cmake --preset fuzz >build/configure-fuzz.log 2>&1 || { cat build/configure-fuzz.log; exit 1; }
targets=("$@")
if [ ${#targets[@]} -eq 0 ]; then
  for source in tests/fuzz/*_fuzz.cc; do targets+=("$(basename "$source" _fuzz.cc)"); done
fi
cmake --build build/fuzz --target "${targets[@]/#/fuzz_}"

export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
result=0
table=$(printf '%-14s %9s %8s %8s %9s  %s' target runs exec/s coverage "peak MiB" findings)
for target in "${targets[@]}"; do
  corpus=build/fuzz/corpus/$target findings=build/fuzz/findings/$target log=build/fuzz/findings/$target.log
  rm -rf "$findings"
  mkdir -p "$corpus" "$findings"
  program=build/fuzz/tests/fuzz/fuzz_$target
  ROMAP_FUZZ_SEEDS=$corpus "$program"
  known=()
  [ ! -d "tests/fuzz/corpus/$target" ] || known=("tests/fuzz/corpus/$target")
  echo "run.sh: $target, $seconds s"
  code=0
  # A small input may take 1 s and 1 GiB. Sanitizers multiply both, and other programs may take processor time.
  timeout=10
  # libdraco reads up to 2^31 orientations of texture coordinates before it finds that they are too many.
  [ "$target" != draco ] || timeout=40
  "$program" -max_total_time="$seconds" -timeout="$timeout" -report_slow_units="$timeout" \
    -rss_limit_mb=2560 -malloc_limit_mb=1024 -max_len=16384 -print_final_stats=1 -artifact_prefix="$findings/" \
    "$corpus" "${known[@]}" >"$log" 2>&1 || code=$?
  found=$(find "$findings" -type f | wc -l)
  if [ "$code" -ne 0 ] || [ "$found" -ne 0 ]; then
    result=1
    grep -m3 -E 'ERROR|runtime error|must hold|Slowest' "$log" || tail -n 5 "$log"
  fi
  stat() { sed -n "s/^stat::$1: *//p" "$log" | tail -n 1; }
  coverage=$(grep -oE 'cov: [0-9]+' "$log" | tail -n 1 | cut -d' ' -f2 || true)
  table+=$'\n'$(printf '%-14s %9s %8s %8s %9s  %s' "$target" "$(stat number_of_executed_units)" \
    "$(stat average_exec_per_sec)" "$coverage" "$(stat peak_rss_mb)" "$found")
done
printf '\n%s\n' "$table"
[ "$result" -eq 0 ] || echo "run.sh: the findings are in build/fuzz/findings; tests/fuzz/README.md says how to go on" >&2
exit "$result"
