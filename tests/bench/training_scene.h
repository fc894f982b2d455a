#pragma once

#include <string>
#include <vector>

#include "client/bench/true_views.h"
#include "client/files/objects_yaml.h"
#include "common/status.h"

namespace romap::measure {

// Frames and true cuboids that benches of fields and meshes work on.
struct TrainingScene {
  bench::TrueFrames frames;
  std::vector<files::ObjectRecord> objects;
};

// A made world seen in 25 pictures of 640x480 px. Needs no data.
TrainingScene SyntheticTrainingScene();

// Every fourth frame of a sequence, or the synthetic scene when `path` is empty. Errors: see LoadTrueFrames.
absl::StatusOr<TrainingScene> LoadTrainingScene(const std::string& path);

}  // namespace romap::measure
