#include "server/store/content_hash.h"

#include <xxhash.h>

namespace romap::store {

std::string HashOf(std::string_view content) {
  XXH128_canonical_t canonical;
  XXH128_canonicalFromHash(&canonical, XXH3_128bits(content.data(), content.size()));
  static_assert(sizeof(canonical.digest) == kHashBytes);
  return {reinterpret_cast<const char*>(canonical.digest), kHashBytes};
}

}  // namespace romap::store
