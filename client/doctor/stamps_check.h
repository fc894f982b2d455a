#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/diagnostic.h"

namespace romap::doctor {

// Whether the timestamps of the frames [ns], ascending, agree with the nominal rate, and whether frames are missing.
// Codes: frame_rate, frames_missing.
std::vector<Diagnostic> CheckStamps(std::span<const int64_t> stamps_ns, double nominal_fps);

}  // namespace romap::doctor
