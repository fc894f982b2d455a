#pragma once

#include <cstdint>
#include <stop_token>

namespace romap {

// What the decoder of an image from outside may use. It checks the limits with the header that the library read, before
// it allocates the image.
struct DecodeLimits {
  int64_t max_pixels = 1 << 27;
  std::stop_token stop = {};  // decoding ends with CANCELLED soon after a stop was requested
};

}  // namespace romap
