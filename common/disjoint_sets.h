#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace romap {

// Sets of the numbers below a count, which are joined two at a time (union-find with path halving; Tarjan and van
// Leeuwen 1984). At first each number is a set of its own.
class DisjointSets {
 public:
  explicit DisjointSets(size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0u); }

  // The same number for all members of a set, one of them.
  uint32_t Root(uint32_t member) {
    while (parent_[member] != member) member = parent_[member] = parent_[parent_[member]];
    return member;
  }
  void Join(uint32_t a, uint32_t b) { parent_[Root(a)] = Root(b); }

 private:
  std::vector<uint32_t> parent_;
};

}  // namespace romap
