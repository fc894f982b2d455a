#pragma once

#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "server/slam/features/feature.h"

namespace romap::slam {

// A tree of binary descriptors that grows with its entries, so that it needs no vocabulary trained in advance.
// Every inner node has up to kBranching centers, a descriptor goes to the child with the nearest one, and a leaf with
// too many entries splits around centers that are bitwise majorities of its own descriptors (after the hierarchical
// clustering trees of Muja and Lowe, "Fast Matching of Binary Features", CRV 2012). The order of insertion shapes the
// tree; the same order and seed give the same tree.
class DescriptorTree {
 public:
  struct Entry {
    Descriptor descriptor{};
    uint32_t owner = 0;  // chosen by the caller
  };

  // Buffers of a search, to be reused by the next one.
  struct Search {
    struct Branch {
      int distance;
      uint32_t node;
    };
    std::vector<Branch> open;
    std::vector<uint32_t> leaves;
  };

  explicit DescriptorTree(uint64_t seed);

  void Insert(const Entry& entry);
  // Removes all entries of the owners with is_removed[owner] != 0. Visits every entry.
  void RemoveOwners(std::span<const uint8_t> is_removed);

  // Writes up to `max_leaves` leaves that may contain similar descriptors to `search.leaves`, the most likely first
  // (best-bin-first by the distance to the centers of skipped branches).
  void FindLeaves(const Descriptor& descriptor, int max_leaves, Search& search) const;
  std::span<const Entry> entries(uint32_t leaf) const { return nodes_[leaf].entries; }

  size_t bytes() const;  // of all arrays

 private:
  // Smaller leaves need fewer comparisons but lose more neighbors across their borders.
  static constexpr size_t kLeafEntries = 256;

  struct Node {
    uint32_t first_child = 0;  // children are consecutive; 0 = leaf
    uint32_t children = 0;
    size_t split_at = kLeafEntries;  // a leaf splits when it holds more
    std::vector<Entry> entries;      // of a leaf
  };

  uint32_t NearestChild(const Node& node, const Descriptor& descriptor) const;
  void Split(uint32_t leaf);
  std::vector<Descriptor> PickCenters(std::span<const Entry> entries);

  std::vector<Node> nodes_;          // [0] is the root
  std::vector<Descriptor> centers_;  // [i] of nodes_[i]; stored apart so that siblings are close in memory
  std::mt19937_64 random_;
};

}  // namespace romap::slam
