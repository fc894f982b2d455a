#!/bin/sh
# runs_anywhere.sh PROGRAM: checks that PROGRAM needs only libc, and that without a device it reports so in one line and
# exits with 2.
set -u
others=$(readelf -d "$1" | sed -n 's/.*NEEDED.*\[\(.*\)\]/\1/p' | grep -v -E '^(libc|libm|ld-linux-x86-64|libpthread|librt|libdl)\.so' || true)
if [ -n "$others" ]; then
  echo "the program needs more libraries than libc:" $others
  exit 1
fi
output=$("$1")
code=$?
echo "$output"
# With a device all tests must pass and the table must be printed.
[ "$code" = 0 ] && exec test -n "$output"
[ "$code" = 2 ] && [ "$(echo "$output" | wc -l)" = 1 ] && echo "$output" | grep -q '^CUDA: '
