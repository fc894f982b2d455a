// Linked into the targets of libFuzzer: with ROMAP_FUZZ_SEEDS=FOLDER, a target writes its seeds there and ends.

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerInitialize(int* /*argc*/, char*** /*argv*/) {
  const char* folder = std::getenv("ROMAP_FUZZ_SEEDS");
  if (folder == nullptr) return 0;
  int number = 0;
  for (const std::string& seed : romap::fuzz::Seeds()) {
    std::ofstream file(std::string(folder) + "/seed_" + std::to_string(number++), std::ios::binary);
    file.write(seed.data(), static_cast<std::streamsize>(seed.size()));
    romap::fuzz::Require(file.good(), "a seed can be written");
  }
  std::exit(0);
}
