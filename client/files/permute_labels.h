#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/client_input.h"
#include "common/status.h"

namespace romap::files {

// Replaces the labels of one mask and its instances by a random permutation, determined by `seed`, of 1..255 (masks
// of up to 8 bits) or 1..65535 (16-bit masks). 0 stays 0. Sorts the instances by their new labels, so that their order
// does not identify the objects. Errors as DecodeLabelPng.
absl::Status PermuteLabels(uint64_t seed, std::string* label_png, std::vector<Instance>* instances);

}  // namespace romap::files
