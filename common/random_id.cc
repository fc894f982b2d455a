#include "common/random_id.h"

#include <fmt/format.h>
#include <sys/random.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <system_error>

namespace romap {

std::string RandomId() {
  std::array<uint64_t, 2> bits{};
  // At most 256 bytes are never returned in part, once the source is initialized. It may be interrupted before.
  while (getrandom(bits.data(), sizeof(bits), 0) != static_cast<ssize_t>(sizeof(bits))) {
    if (errno != EINTR) throw std::system_error(errno, std::generic_category(), "getrandom");
  }
  return fmt::format("{:016x}{:016x}", bits[0], bits[1]);
}

}  // namespace romap
