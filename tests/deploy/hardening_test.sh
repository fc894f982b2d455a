#!/usr/bin/env bash
# hardening_test.sh PROGRAM...: the programs are position-independent, their tables of addresses are read-only, their
# stack is not executable and protected.
set -euo pipefail
for program in "$@"; do
  header=$(readelf -hldW "$program")
  fail() { echo "$program: $1"; exit 1; }
  grep -q 'Type: *DYN' <<<"$header" || fail "is not position-independent"
  grep -q 'GNU_RELRO' <<<"$header" || fail "has no RELRO"
  grep -Eq 'BIND_NOW|FLAGS.*NOW' <<<"$header" || fail "binds its symbols late"
  grep 'GNU_STACK' <<<"$header" | grep -q 'RWE' && fail "has an executable stack"
  symbols=$(readelf --dyn-syms -W "$program")
  grep -q '__stack_chk_fail' <<<"$symbols" || fail "has no stack protector"
done
exit 0
