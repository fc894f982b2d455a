#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/files/sequence_contents.h"
#include "common/camera_model.h"

namespace romap::importers {

// A frame as a reader finds it.
struct RecordedFrame : files::FrameRecord {
  std::string name = {};  // by which masks are joined; empty: that of the image file
  // If frames may have different intrinsics; otherwise that of the recording.
  std::optional<CameraModel> camera = std::nullopt;
  // An image whose black pixels are unknown in the masks; empty = none.
  std::string ignore_mask = {};
};

// What a reader finds. See files::SequenceContents.
struct RecordingContents {
  std::string source;
  files::CameraYaml camera = {};
  std::vector<RecordedFrame> frames = {};
  std::optional<files::ObjectsYaml> objects = std::nullopt;
  std::vector<Diagnostic> diagnostics = {};
};

}  // namespace romap::importers
