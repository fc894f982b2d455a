#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/files/camera_yaml.h"
#include "client/files/detections.h"
#include "client/files/file_list.h"
#include "client/files/objects_yaml.h"
#include "client/files/pose_convention.h"
#include "client/files/time_unit.h"
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

// The files of one frame; empty = none.
struct FramePaths {
  std::string image;
  std::string mask;
  std::string depth;
};

// A recorded sequence in a folder: rgb.txt and camera.yaml, and optionally mask.txt, detections.csv, depth.txt,
// groundtruth.txt and objects.yaml. Entries of the lists are associated with those of rgb.txt by time, one to one,
// within half a frame period; detections with the masks. Immutable after Open(); Load() is thread-safe.
class Sequence {
 public:
  // Reads the lists, not the images. INVALID_ARGUMENT: a malformed line (the message names the file and the line),
  // timestamps that do not increase, or no frames. Otherwise as ReadFileList, e.g. NOT_FOUND if a required file is
  // missing.
  static absl::StatusOr<Sequence> Open(const std::string& dir, const SequenceOptions& options = {});

  const std::string& dir() const { return dir_; }
  const CameraModel& camera() const { return camera_.camera; }
  double fps() const { return camera_.fps; }
  double depth_scale() const { return camera_.depth_scale; }  // map units per depth unit; 0 = no depth
  size_t size() const { return frames_.size(); }              // number of frames, at least 1
  int64_t timestamp_ns(size_t index) const { return frames_[index].timestamp_ns; }
  const FramePaths& paths(size_t index) const { return frames_[index].paths; }
  bool has_mask(size_t index) const { return !frames_[index].paths.mask.empty(); }
  bool has_poses() const { return !poses_.empty(); }
  const std::optional<ObjectsYaml>& objects() const { return objects_; }
  // How ambiguous input was read, and what does not fit together. client/README.md lists the codes.
  const std::vector<Diagnostic>& diagnostics() const { return diagnostics_; }

  // Loads frame `index` (< size()): the encoded image, mask (label PNG) and depth (16-bit PNG), the
  // instances and the pose; frame_id = index + 1. The instances are the detections at the time of the mask or, without
  // a detections file, all objects of objects.yaml. The pose is interpolated; it is absent if none is within 20 ms.
  // Errors as ReadImageFile.
  absl::StatusOr<FrameInput> Load(size_t index) const;

  // As Load(), but a mask or depth image that cannot be read is omitted and appended to `unreadable`. An error concerns
  // the color image.
  absl::StatusOr<FrameInput> LoadReadable(size_t index, std::vector<UnreadableFile>* unreadable) const;

 private:
  struct FrameFiles {
    int64_t timestamp_ns = 0;
    FramePaths paths;
    int64_t mask_timestamp_ns = 0;  // if there is a mask
    std::vector<Instance> instances = {};
  };

  absl::Status OpenImages();
  absl::Status OpenMasks(const SequenceOptions& options);
  absl::Status OpenDetections(const SequenceOptions& options);
  absl::Status OpenPoses(const SequenceOptions& options);
  absl::Status OpenDepth(const SequenceOptions& options);
  void AttachDetections(const std::string& name, const DetectionFile& detections);
  void NoteUnit(const std::string& file, TimeUnit unit);
  std::vector<int64_t> Timestamps() const;
  int64_t HalfFrame_ns() const;
  std::string Path(const std::string& name) const { return dir_ + "/" + name; }

  std::string dir_;
  CameraYaml camera_;
  std::vector<FrameFiles> frames_;
  std::vector<StampedPose> poses_;
  std::optional<ObjectsYaml> objects_;
  std::optional<uint64_t> permute_labels_seed_;
  std::vector<std::pair<std::string, TimeUnit>> converted_;  // files whose timestamps are not in seconds
  std::vector<Diagnostic> diagnostics_;
};

}  // namespace romap::files
