#include "server/slam/places/place_index.h"

#include <algorithm>
#include <cmath>

namespace romap::slam {
namespace {

// ORB descriptors of the same corner in two views differ in about 10 to 20 % of the 256 bits, those of different
// corners in about half.
constexpr int kMaxDistanceBits = 50;
// Number of words searched per feature. With only one word, most neighbors across its border would be lost.
constexpr int kLeavesPerFeature = 2;

// Accumulates the votes of one query, feature by feature.
class Votes {
 public:
  explicit Votes(size_t slots) : votes_(slots, 0.0), nearest_(slots, kNone) {}

  // Records a descriptor of `slot` that is similar to the current feature.
  void AddSimilar(uint32_t slot, int distance) {
    if (nearest_[slot] == kNone) similar_slots_.push_back(slot);
    nearest_[slot] = std::min(nearest_[slot], distance);
  }

  // Adds the votes of the current feature and starts the next one. Returns the feature's weight.
  double FinishFeature(double keyframes) {
    const double weight = std::log((keyframes + 1) / (static_cast<double>(similar_slots_.size()) + 0.5));
    for (const uint32_t slot : similar_slots_) {
      // True neighbors mostly have a smaller distance than wrong ones.
      votes_[slot] += weight * (1 - static_cast<double>(nearest_[slot]) / (kMaxDistanceBits + 1));
      nearest_[slot] = kNone;
    }
    similar_slots_.clear();
    return weight;
  }

  double operator[](size_t slot) const { return votes_[slot]; }

 private:
  static constexpr int kNone = 257;
  std::vector<double> votes_;
  std::vector<int> nearest_;  // of the current feature, by slot
  std::vector<uint32_t> similar_slots_;
};

}  // namespace

PlaceIndex::PlaceIndex(uint64_t seed) : tree_(seed) {}

void PlaceIndex::Add(KeyframeId keyframe, std::span<const Feature> features) {
  Remove(keyframe);
  uint32_t slot = static_cast<uint32_t>(slots_.size());
  if (free_slots_.empty()) {
    slots_.emplace_back();
  } else {
    slot = free_slots_.back();
    free_slots_.pop_back();
  }
  slots_[slot] = {.keyframe = keyframe, .features = features.size()};
  slots_of_.emplace(keyframe, slot);
  live_entries_ += features.size();
  for (const Feature& feature : features) tree_.Insert({.descriptor = feature.descriptor, .owner = slot});
}

void PlaceIndex::Remove(KeyframeId keyframe) {
  const auto found = slots_of_.find(keyframe);
  if (found == slots_of_.end()) return;
  const uint32_t slot = found->second;
  slots_of_.erase(found);
  slots_[slot].keyframe = {};
  removed_slots_.push_back(slot);
  live_entries_ -= slots_[slot].features;
  removed_entries_ += slots_[slot].features;
  if (removed_entries_ > live_entries_ / 4) SweepRemoved();
}

void PlaceIndex::SweepRemoved() {
  std::vector<uint8_t> is_removed(slots_.size(), 0);
  for (const uint32_t slot : removed_slots_) is_removed[slot] = 1;
  tree_.RemoveOwners(is_removed);
  free_slots_.insert(free_slots_.end(), removed_slots_.begin(), removed_slots_.end());
  removed_slots_.clear();
  removed_entries_ = 0;
}

std::vector<PlaceMatch> PlaceIndex::Query(std::span<const Feature> features, int max_results) const {
  Votes votes(slots_.size());
  DescriptorTree::Search search;
  double total_weight = 0;
  for (const Feature& feature : features) {
    tree_.FindLeaves(feature.descriptor, kLeavesPerFeature, search);
    for (const uint32_t leaf : search.leaves) {
      for (const DescriptorTree::Entry& entry : tree_.entries(leaf)) {
        const int distance = HammingDistance(entry.descriptor, feature.descriptor);
        if (distance <= kMaxDistanceBits && slots_[entry.owner].keyframe) votes.AddSimilar(entry.owner, distance);
      }
    }
    total_weight += votes.FinishFeature(static_cast<double>(size()));
  }

  std::vector<PlaceMatch> matches;
  for (size_t slot = 0; slot < slots_.size(); ++slot) {
    if (votes[slot] <= 0) continue;
    // A keyframe with many features gets more wrong votes.
    const double features_ratio = static_cast<double>(features.size()) / static_cast<double>(slots_[slot].features);
    matches.push_back({slots_[slot].keyframe, std::min(1.0, votes[slot] / total_weight * std::sqrt(features_ratio))});
  }
  const auto better = [](const PlaceMatch& a, const PlaceMatch& b) {
    return a.score != b.score ? a.score > b.score : a.keyframe < b.keyframe;
  };
  const size_t kept = std::min(matches.size(), static_cast<size_t>(std::max(0, max_results)));
  std::ranges::partial_sort(matches, matches.begin() + static_cast<std::ptrdiff_t>(kept), better);
  matches.resize(kept);
  return matches;
}

size_t PlaceIndex::bytes() const {
  return tree_.bytes() + slots_.capacity() * sizeof(Slot) + slots_of_.size() * (sizeof(KeyframeId) + 3 * sizeof(void*));
}

}  // namespace romap::slam
