#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/files/file_list.h"
#include "client/files/pose_convention.h"
#include "client/files/sequence_contents.h"
#include "client/files/tum.h"
#include "common/client_input.h"
#include "common/diagnostic.h"
#include "common/status.h"

namespace romap::files {

// Which parts of a sequence folder to read. A file with its default name is optional; a file with another name must
// exist.
struct SequenceOptions {
  std::string masks = "mask.txt";             // list of label images; empty = no masks
  std::string detections = "detections.csv";  // class and score per label; empty = labels are the ids of objects.yaml
  std::string poses = "groundtruth.txt";      // camera poses to send with the frames; empty = none
  PoseConvention convention = {};             // of `poses`
  bool use_depth = false;                     // load the depth images of depth.txt
  std::optional<double> readout_s = std::nullopt;  // replaces CameraModel::readout_s of camera.yaml
  // Permutes the labels at random in each frame, like the output of a detector without a tracker.
  std::optional<uint64_t> permute_labels_seed = std::nullopt;
};

enum class FileKind { kImage, kMask, kDepth };

struct UnreadableFile {
  FileKind kind = FileKind::kImage;
  absl::Status reason;  // names the file
};

// A recorded sequence: a folder with rgb.txt and camera.yaml (native_sequence.h), or what a reader of another layout
// found (client/importers). Immutable; Load() is thread-safe.
class Sequence {
 public:
  // Opens a folder in the native layout. Errors as ReadNativeSequence.
  static absl::StatusOr<Sequence> Open(const std::string& dir, const SequenceOptions& options = {});

  // `permute_labels_seed`: see SequenceOptions.
  explicit Sequence(SequenceContents contents, std::optional<uint64_t> permute_labels_seed = std::nullopt);

  const std::string& dir() const { return contents_.source; }
  const CameraModel& camera() const { return contents_.camera.camera; }
  double fps() const { return contents_.camera.fps; }
  // Map units per depth unit; 0 = no depth.
  double depth_scale() const { return contents_.camera.depth_scale; }
  // Up in the world of the poses: "x" to "-z", "auto" (not known), or empty (not stated: z).
  const std::string& world_up() const { return contents_.camera.world_up; }
  size_t size() const { return contents_.frames.size(); }  // number of frames, at least 1
  int64_t timestamp_ns(size_t index) const { return contents_.frames[index].timestamp_ns; }
  const FramePaths& paths(size_t index) const { return contents_.frames[index].paths; }
  const FrameRecord& frame(size_t index) const { return contents_.frames[index]; }
  bool has_mask(size_t index) const { return !paths(index).mask.empty(); }
  const std::optional<ObjectsYaml>& objects() const { return contents_.objects; }
  // How ambiguous input was read, and what does not fit together. client/README.md lists the codes.
  const std::vector<Diagnostic>& diagnostics() const { return contents_.diagnostics; }

  // Loads frame `index` (< size()): the encoded image, mask (label PNG) and depth (16-bit PNG), the instances and the
  // pose; frame_id = index + 1. Errors as ReadImageFile.
  absl::StatusOr<FrameInput> Load(size_t index) const;

  // As Load(), but a mask or depth image that cannot be read is omitted and appended to `unreadable`. An error concerns
  // the color image.
  absl::StatusOr<FrameInput> LoadReadable(size_t index, std::vector<UnreadableFile>* unreadable) const;

 private:
  absl::StatusOr<EncodedMasks> LoadMasks(size_t index) const;

  SequenceContents contents_;
  std::optional<uint64_t> permute_labels_seed_;
};

}  // namespace romap::files
