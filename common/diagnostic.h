#pragma once

#include <cstdint>
#include <string>

namespace romap {

enum class Severity {
  kInfo,     // nothing is wrong; states how an ambiguous input was read
  kWarning,  // the map is less accurate or less complete
  kError,    // the map is wrong, or a large part of the input is unusable
};

// What a person should know about the input or the map of a session, in one sentence. Any stage may report one; the
// codes are listed in proto/romap/v1/mapping.proto.
struct Diagnostic {
  std::string code = {};  // stable identifier for programs, e.g. "up_unknown"
  Severity severity = Severity::kWarning;
  uint64_t first_frame_id = 0;  // the first frame that it concerns; 0: none, or not known
  uint64_t count = 1;           // number of frames, or of other parts of the input, that it concerns
  std::string text = {};        // one sentence: what is the case
  std::string advice = {};      // what to do; may be empty
};

}  // namespace romap
