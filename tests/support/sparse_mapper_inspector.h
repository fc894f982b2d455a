#pragma once

#include "server/slam/sparse_mapper.h"

namespace romap::slam {

// Gives tests and benchmarks access to the map and the counts of a SparseMapper.
class SparseMapperInspector {
 public:
  explicit SparseMapperInspector(const SparseMapper& mapper) : mapper_(mapper) {}

  const SlamMap& map() const { return mapper_.current().map; }
  const MapAtlas& atlas() const { return mapper_.atlas_; }
  size_t keyframes_made() const { return map().keyframe_count(); }
  int loops_corrected() const { return mapper_.counts_.loops_corrected; }
  int loops_merged() const { return mapper_.counts_.loops_merged; }
  int relocalizations() const { return mapper_.counts_.relocalizations; }
  int maps_begun() const { return mapper_.counts_.maps_begun; }
  int maps_merged() const { return mapper_.counts_.maps_merged; }
  double up_confidence() const { return mapper_.current().up.confidence(); }
  const LocalAdjuster::Times& local_adjustment() const { return mapper_.local_adjuster_.times(); }

 private:
  const SparseMapper& mapper_;
};

}  // namespace romap::slam
