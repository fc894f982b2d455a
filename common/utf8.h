#pragma once

#include <string>

namespace romap {

// Whether the bytes are well-formed UTF-8 (RFC 3629): no stray or missing continuation bytes, no overlong forms, no
// surrogates, nothing above U+10FFFF. What is not cannot travel in protobuf or JSON strings.
bool IsUtf8(const std::string& text);

}  // namespace romap
