#pragma once

namespace romap::testing_support {

// Whether this build uses AddressSanitizer or ThreadSanitizer, which make code about ten times slower. Slow tests use
// less data then.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kUnderSanitizer = true;
#else
inline constexpr bool kUnderSanitizer = false;
#endif

}  // namespace romap::testing_support
