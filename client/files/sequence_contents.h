#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "client/files/camera_yaml.h"
#include "client/files/image_file.h"
#include "client/files/objects_yaml.h"
#include "common/client_input.h"
#include "common/diagnostic.h"
#include "common/geometry.h"
#include "common/status.h"

namespace romap::files {

// The files of one frame, for messages; empty = none.
struct FramePaths {
  std::string image;
  std::string mask;
  std::string depth;
};

// One frame of a sequence. A part without a loader is the file that `paths` names, as it is. Loaders are thread-safe;
// their errors name the file.
struct FrameRecord {
  int64_t timestamp_ns = 0;
  FramePaths paths = {};
  std::vector<Instance> instances = {};  // of the labels in the file paths.mask; a mask loader returns its own
  std::optional<SE3<World, Camera>> T_world_camera = std::nullopt;
  double depth_scale_mu = 0;  // map units per unit of the depth image; 0: that of the sequence

  std::function<absl::StatusOr<ImageFile>()> load_image = nullptr;
  std::function<absl::StatusOr<EncodedMasks>()> load_masks = nullptr;
  std::function<absl::StatusOr<std::string>()> load_depth = nullptr;  // 16-bit PNG, z depth, size of the image
};

// A recorded sequence before any image of it is loaded.
struct SequenceContents {
  std::string source;  // the folder or file it was read from
  CameraYaml camera = {};
  std::vector<FrameRecord> frames = {};  // at least one; timestamps strictly increase
  std::optional<ObjectsYaml> objects = std::nullopt;
  std::vector<Diagnostic> diagnostics = {};
};

}  // namespace romap::files
