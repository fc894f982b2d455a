#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/field_snapshot.h"
#include "server/mesh/field_grid.h"

namespace romap::mesh {

// The observations of one node by the training views.
struct ViewVotes {
  uint8_t views = 0;  // whose depth image covers the node
  uint8_t empty = 0;  // of these, the views that observe it as empty

  // 0..1; 0 if no depth image covers the node.
  float EmptyShare() const { return views == 0 ? 0.0f : static_cast<float>(empty) / static_cast<float>(views); }
};

// The votes of up to 32 views, evenly spread over the snapshot's, on the given nodes. See ViewDepth.
std::vector<ViewVotes> CountViewVotes(const FieldGrid& grid, std::span<const size_t> nodes,
                                      const FieldSnapshot& snapshot);

}  // namespace romap::mesh
