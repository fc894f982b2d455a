#pragma once

#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "common/ids.h"
#include "server/slam/features/feature.h"
#include "server/slam/places/descriptor_tree.h"

namespace romap::slam {

// A keyframe with descriptors similar to the query.
struct PlaceMatch {
  KeyframeId keyframe;
  double score = 0;  // 0..1, comparable between queries
};

// Finds keyframes that show the same place, by their binary descriptors alone and without a vocabulary file. Not
// thread-safe.
//
// An inverted index whose words are the leaves of a tree that grows with the keyframes. A word stores whole
// descriptors, so that a feature votes only for keyframes with a similar descriptor (Hamming embedding: Jegou et al.,
// ECCV 2008), and its votes have less weight if it is similar to many keyframes (inverse document frequency: Sivic and
// Zisserman, ICCV 2003). About 60 bytes per feature.
class PlaceIndex {
 public:
  explicit PlaceIndex(uint64_t seed = 1);

  // Replaces the features of a keyframe that was added before.
  void Add(KeyframeId keyframe, std::span<const Feature> features);
  void Remove(KeyframeId keyframe);  // ignored if unknown
  // At most `max_results` matches, best first. Features that match many keyframes score less. The same image scores
  // about 1; on hand-held video, other views of the same place score 0.005 to 0.04, and views of other places up to
  // 0.01.
  std::vector<PlaceMatch> Query(std::span<const Feature> features, int max_results) const;
  size_t size() const { return slots_of_.size(); }
  size_t bytes() const;  // approximate, for statistics

 private:
  // A keyframe. DescriptorTree::Entry::owner is the index of its slot.
  struct Slot {
    KeyframeId keyframe;  // none: removed, or free
    size_t features = 0;
  };

  void SweepRemoved();

  DescriptorTree tree_;
  std::vector<Slot> slots_;
  std::vector<uint32_t> free_slots_;
  std::unordered_map<KeyframeId, uint32_t> slots_of_;
  // Entries of removed keyframes stay in the tree and are ignored until there are many, because removing them visits
  // the whole tree.
  std::vector<uint32_t> removed_slots_;
  size_t live_entries_ = 0;
  size_t removed_entries_ = 0;
};

}  // namespace romap::slam
