#include "server/slam/places/descriptor_tree.h"

#include <algorithm>
#include <array>
#include <utility>

namespace romap::slam {
namespace {

constexpr size_t kBranching = 8;
constexpr int kMajorityRounds = 2;

size_t NearestCenter(std::span<const Descriptor> centers, const Descriptor& descriptor) {
  size_t best = 0;
  int best_distance = HammingDistance(centers[0], descriptor);
  for (size_t i = 1; i < centers.size(); ++i) {
    const int distance = HammingDistance(centers[i], descriptor);
    if (distance < best_distance) {
      best_distance = distance;
      best = i;
    }
  }
  return best;
}

// Moves every center to the bitwise majority of the entries that are nearest to it: one round of k-majority (Grana et
// al., "A fast approach for integrating ORB descriptors in the bag of words model", 2013).
void MoveToMajority(std::span<const DescriptorTree::Entry> entries, std::vector<Descriptor>& centers) {
  std::vector<std::array<int, 256>> ones(centers.size(), std::array<int, 256>{});
  std::vector<int> members(centers.size(), 0);
  for (const auto& entry : entries) {
    const size_t center = NearestCenter(centers, entry.descriptor);
    ++members[center];
    for (size_t bit = 0; bit < 256; ++bit) ones[center][bit] += (entry.descriptor[bit / 64] >> (bit % 64)) & 1;
  }
  for (size_t c = 0; c < centers.size(); ++c) {
    if (members[c] == 0) continue;
    centers[c] = {};
    for (size_t bit = 0; bit < 256; ++bit) {
      if (2 * ones[c][bit] > members[c]) centers[c][bit / 64] |= uint64_t{1} << (bit % 64);
    }
  }
}

}  // namespace

DescriptorTree::DescriptorTree(uint64_t seed) : random_(seed) {
  nodes_.emplace_back();
  centers_.emplace_back();
}

uint32_t DescriptorTree::NearestChild(const Node& node, const Descriptor& descriptor) const {
  const std::span children = std::span(centers_).subspan(node.first_child, node.children);
  return node.first_child + static_cast<uint32_t>(NearestCenter(children, descriptor));
}

void DescriptorTree::Insert(const Entry& entry) {
  uint32_t at = 0;
  while (nodes_[at].first_child != 0) at = NearestChild(nodes_[at], entry.descriptor);
  nodes_[at].entries.push_back(entry);
  if (nodes_[at].entries.size() > nodes_[at].split_at) Split(at);
}

std::vector<Descriptor> DescriptorTree::PickCenters(std::span<const Entry> entries) {
  std::vector<Descriptor> centers;
  // Draws of a descriptor that is already a center are wasted; a few extra draws compensate.
  for (size_t draw = 0; draw < 2 * kBranching && centers.size() < kBranching; ++draw) {
    const Descriptor& drawn = entries[random_() % entries.size()].descriptor;
    if (std::ranges::find(centers, drawn) == centers.end()) centers.push_back(drawn);
  }
  for (int round = 0; round < kMajorityRounds; ++round) MoveToMajority(entries, centers);
  std::ranges::sort(centers);
  const auto repeated = std::ranges::unique(centers);
  centers.erase(repeated.begin(), repeated.end());
  return centers;
}

void DescriptorTree::Split(uint32_t leaf) {
  const std::vector<Descriptor> centers = PickCenters(nodes_[leaf].entries);
  if (centers.size() < 2) {
    // All descriptors are equal. Retry when there are twice as many.
    nodes_[leaf].split_at *= 2;
    return;
  }
  const auto first_child = static_cast<uint32_t>(nodes_.size());
  const std::vector<Entry> entries = std::exchange(nodes_[leaf].entries, {});
  nodes_[leaf].first_child = first_child;
  nodes_[leaf].children = static_cast<uint32_t>(centers.size());
  for (const Descriptor& center : centers) {
    nodes_.emplace_back();
    centers_.push_back(center);
  }
  for (const Entry& entry : entries) nodes_[NearestChild(nodes_[leaf], entry.descriptor)].entries.push_back(entry);
}

void DescriptorTree::RemoveOwners(std::span<const uint8_t> is_removed) {
  for (Node& node : nodes_) {
    std::erase_if(node.entries, [&](const Entry& entry) { return is_removed[entry.owner] != 0; });
  }
}

void DescriptorTree::FindLeaves(const Descriptor& descriptor, int max_leaves, Search& search) const {
  const auto farther = [](const Search::Branch& a, const Search::Branch& b) { return a.distance > b.distance; };
  search.open.clear();
  search.leaves.clear();
  search.open.push_back({0, 0});
  while (!search.open.empty() && std::ssize(search.leaves) < max_leaves) {
    std::ranges::pop_heap(search.open, farther);
    uint32_t at = search.open.back().node;
    search.open.pop_back();
    while (nodes_[at].first_child != 0) {
      const Node& node = nodes_[at];
      Search::Branch nearest{.distance = 257, .node = 0};
      for (uint32_t child = node.first_child; child < node.first_child + node.children; ++child) {
        Search::Branch branch{HammingDistance(centers_[child], descriptor), child};
        if (branch.distance < nearest.distance) std::swap(branch, nearest);
        if (branch.distance > 256) continue;  // the initial distance, greater than any other
        search.open.push_back(branch);
        std::ranges::push_heap(search.open, farther);
      }
      at = nearest.node;
    }
    search.leaves.push_back(at);
  }
}

size_t DescriptorTree::bytes() const {
  size_t bytes = nodes_.capacity() * sizeof(Node) + centers_.capacity() * sizeof(Descriptor);
  for (const Node& node : nodes_) bytes += node.entries.capacity() * sizeof(Entry);
  return bytes;
}

}  // namespace romap::slam
