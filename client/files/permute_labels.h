#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/client_input.h"
#include "common/status.h"

namespace romap::files {

// Renames the labels of one mask and its instances by the random permutation of 1..255 (8 bit masks) or 1..65535 (16
// bit) that `seed` chooses; 0 stays 0. Instances end up ordered by their new label, so that order tells nothing either.
// INVALID_ARGUMENT: `label_png` is not an 8 or 16 bit single-channel image.
absl::Status PermuteLabels(uint64_t seed, std::string* label_png, std::vector<Instance>* instances);

}  // namespace romap::files
