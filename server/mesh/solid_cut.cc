#include "server/mesh/solid_cut.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc/detail/gcgraph.hpp>
#include <vector>

#include "server/mesh/grid_flood.h"
#include "server/mesh/view_votes.h"

namespace romap::mesh {
namespace {

// Of a grid with 64 nodes along the longest side; other grids cut at the same place. Costs are relative to that of a
// face between two nodes.
constexpr float kReferenceNodes = 64.0f;
constexpr float kFaceCost = 1.0f;
constexpr float kSeenEmptyCost = 5.0f;  // of a solid node that all views observe as empty
constexpr float kUnseenCost = 4.0f;     // of an empty node that no view observes as empty
constexpr float kDetailDepth = 2.0f;    // nodes behind the cut where the field defines the surface

// Node spacing relative to that of the reference.
float SpacingScale(const FieldGrid& grid) { return kReferenceNodes / static_cast<float>(grid.nodes.maxCoeff() - 2); }

bool IsSpace(float value) { return !(value > 0) && value != kEmpty && value != kBeyondBox; }

std::vector<size_t> SpaceNodes(const FieldGrid& grid) {
  std::vector<size_t> nodes;
  for (size_t i = 0; i < grid.value.size(); ++i) {
    if (IsSpace(grid.value[i])) nodes.push_back(i);
  }
  return nodes;
}

enum Side : uint8_t { kOutside, kDeepInside, kShallowInside };

// By node of the grid: on which side of the cut the nodes of the space are; kOutside for all others.
std::vector<uint8_t> Cut(const FieldGrid& grid, const std::vector<size_t>& nodes, const std::vector<ViewVotes>& votes) {
  std::vector<int> vertex(grid.value.size(), -1);
  cv::detail::GCGraph<float> graph(static_cast<unsigned>(nodes.size()), static_cast<unsigned>(6 * nodes.size()));
  for (const size_t node : nodes) vertex[node] = graph.addVtx();
  const std::array<ptrdiff_t, 6> steps = NeighborSteps(grid);
  const float volume = SpacingScale(grid);  // of a node, relative to its faces
  for (size_t i = 0; i < nodes.size(); ++i) {
    const int own = vertex[nodes[i]];
    float if_empty = votes[i].empty == 0 ? volume * kUnseenCost : 0.0f;
    float if_solid = volume * kSeenEmptyCost * votes[i].EmptyShare();
    for (const ptrdiff_t step : steps) {
      const size_t neighbor = nodes[i] + static_cast<size_t>(step);
      if (vertex[neighbor] >= 0) {
        if (step > 0) graph.addEdges(own, vertex[neighbor], kFaceCost, kFaceCost);
      } else if (grid.value[neighbor] > 0) {
        if_empty += kFaceCost;
      } else {
        if_solid += kFaceCost;
      }
    }
    graph.addTermWeights(own, if_empty, if_solid);
  }
  graph.maxFlow();
  std::vector<uint8_t> side(grid.value.size(), kOutside);
  for (const size_t node : nodes) {
    if (graph.inSourceSegment(vertex[node])) side[node] = kDeepInside;
  }
  return side;
}

// Gives the state `to` to the nodes of state `from` that are at most kDetailDepth from the nodes of `front`.
void Spread(const FieldGrid& grid, std::vector<size_t> front, uint8_t from, uint8_t to, std::vector<uint8_t>* side) {
  const std::array<ptrdiff_t, 6> steps = NeighborSteps(grid);
  const long depth_nodes = std::lround(kDetailDepth / SpacingScale(grid));
  for (long depth = 0; depth < depth_nodes; ++depth) {
    std::vector<size_t> next;
    for (const size_t node : front) {
      for (const ptrdiff_t step : steps) {
        const size_t neighbor = node + static_cast<size_t>(step);
        if ((*side)[neighbor] != from) continue;
        (*side)[neighbor] = to;
        next.push_back(neighbor);
      }
    }
    front.swap(next);
  }
}

// Nodes outside the cut and outside the surface.
std::vector<size_t> OutsideNodes(const FieldGrid& grid, const std::vector<uint8_t>& side) {
  std::vector<size_t> outside;
  for (size_t i = 0; i < side.size(); ++i) {
    if (side[i] == kOutside && !(grid.value[i] > 0) && grid.value[i] != kBeyondBox) outside.push_back(i);
  }
  return outside;
}

}  // namespace

bool CutSolid(FieldGrid& grid, const FieldSnapshot& snapshot) {
  const std::vector<size_t> nodes = SpaceNodes(grid);
  const std::vector<ViewVotes> votes = CountViewVotes(grid, nodes, snapshot);
  if (std::none_of(votes.begin(), votes.end(), [](const ViewVotes& v) { return v.views > 0; })) return false;
  std::vector<uint8_t> side = Cut(grid, nodes, votes);
  Spread(grid, OutsideNodes(grid, side), kDeepInside, kShallowInside, &side);
  std::vector<size_t> deep;
  for (const size_t node : nodes) {
    if (side[node] == kDeepInside) deep.push_back(node);
  }
  // What lies between deep space and the cut closes its opening.
  Spread(grid, deep, kShallowInside, kDeepInside, &side);
  for (const size_t node : nodes) {
    if (side[node] == kDeepInside) grid.Edit(node, kSolid);
  }
  return true;
}

}  // namespace romap::mesh
