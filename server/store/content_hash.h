#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace romap::store {

inline constexpr size_t kHashBytes = 16;

// XXH3 with 128 bits, in canonical (big-endian) order.
std::string HashOf(std::string_view content);

}  // namespace romap::store
