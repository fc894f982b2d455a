#pragma once

#include <string>
#include <vector>

#include "client/bench/true_views.h"
#include "client/files/objects_yaml.h"
#include "common/status.h"

namespace romap::measure {

// Frames and true cuboids for the benchmarks of fields and meshes.
struct TrainingScene {
  bench::TrueFrames frames;
  std::vector<files::ObjectRecord> objects;
};

// A synthetic world in 25 images of 640x480 px. Needs no data.
TrainingScene SyntheticTrainingScene();

// Every fourth frame of a sequence, or the synthetic scene if `path` is empty. Errors: see LoadTrueFrames.
absl::StatusOr<TrainingScene> LoadTrainingScene(const std::string& path);

}  // namespace romap::measure
