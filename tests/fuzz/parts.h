#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace romap::fuzz {

// Several messages as one input: each with its length before it, in two bytes (little-endian). The last one may be cut.
inline std::vector<std::string> SplitParts(std::string_view input) {
  std::vector<std::string> parts;
  while (input.size() >= 2) {
    const size_t length =
        static_cast<unsigned char>(input[0]) | static_cast<size_t>(static_cast<unsigned char>(input[1])) << 8;
    parts.emplace_back(input.substr(2, length));
    input.remove_prefix(2 + parts.back().size());
  }
  return parts;
}

inline std::string JoinParts(const std::vector<std::string>& parts) {
  std::string input;
  for (const std::string& part : parts) {
    input += static_cast<char>(part.size());
    input += static_cast<char>(part.size() >> 8);
    input += part;
  }
  return input;
}

}  // namespace romap::fuzz
