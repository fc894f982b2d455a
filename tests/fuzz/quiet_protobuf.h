#pragma once

#include <google/protobuf/stubs/logging.h>

namespace romap::fuzz {

// Otherwise protobuf writes a line to stderr for every text that is not UTF-8. Set before the target runs.
inline const bool kIsProtobufQuiet = (google::protobuf::SetLogHandler(nullptr), true);

}  // namespace romap::fuzz
