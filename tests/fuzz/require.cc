#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/fuzz_target.h"

namespace romap::fuzz {

void Require(bool holds, std::string_view what) {
  if (holds) return;
  std::fprintf(stderr, "fuzz: this must hold for every input: %.*s\n", static_cast<int>(what.size()), what.data());
  std::abort();
}

}  // namespace romap::fuzz
