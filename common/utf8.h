#pragma once

#include <string>

namespace romap {

// True if the bytes are well-formed UTF-8 (RFC 3629). Only such strings are valid in protobuf and JSON.
bool IsUtf8(const std::string& text);

}  // namespace romap
