#pragma once

#include <chrono>
#include <cstdint>

namespace romap {

// Nanoseconds since 1970-01-01 00:00 UTC. The system clock may jump.
inline int64_t UnixNow_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace romap
