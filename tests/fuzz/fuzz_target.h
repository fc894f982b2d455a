#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

// What a target defines. libFuzzer calls it, or replay_main.cc where the compiler has no libFuzzer.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

namespace romap::fuzz {

// Also defined by each target: small valid inputs, which are mutated. Those that found a fault are in corpus/NAME.
std::vector<std::string> Seeds();

inline std::string TextOf(const uint8_t* data, size_t size) {
  return size == 0 ? std::string() : std::string(reinterpret_cast<const char*>(data), size);
}

// Ends the process with the message, which is a finding, unless `holds`.
void Require(bool holds, std::string_view what);

}  // namespace romap::fuzz
