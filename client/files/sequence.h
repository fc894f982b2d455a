#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "client/files/camera_yaml.h"
#include "client/files/objects_yaml.h"
#include "client/files/tum.h"
#include "common/client_input.h"
#include "common/status.h"

namespace romap::files {

// Which parts of a sequence folder to read. A file left at its default name may be missing; one that was named must
// exist.
struct SequenceOptions {
  std::string masks = "mask.txt";             // list of label images; empty = no masks
  std::string detections = "detections.csv";  // empty = labels are the ids of objects.yaml
  std::string poses = "groundtruth.txt";      // camera poses to hand to the mapper; empty = none
  bool use_depth = false;                     // hand over the depth images of depth.txt
  // Renames the labels of every frame by a random permutation of its own: what a detector without a tracker delivers.
  std::optional<uint64_t> permute_labels_seed = std::nullopt;
};

// A recorded sequence in a folder: rgb.txt and camera.yaml, and where they exist mask.txt, detections.csv, depth.txt,
// groundtruth.txt and objects.yaml. Lists are matched to rgb.txt by time, one to one, within half a frame.
// Immutable after Open(), so that several threads may Load().
class Sequence {
 public:
  // Reads the lists, not the images. NOT_FOUND: the folder, or something it must hold, is missing. INVALID_ARGUMENT: a
  // malformed line (named by file and line), time going back, no frames.
  static absl::StatusOr<Sequence> Open(const std::string& dir, const SequenceOptions& options = {});

  const std::string& dir() const { return dir_; }
  const CameraModel& camera() const { return camera_.camera; }
  double fps() const { return camera_.fps; }
  double depth_scale() const { return camera_.depth_scale; }  // map units per depth unit; 0 = no depth
  size_t size() const { return frames_.size(); }              // frames, at least 1
  int64_t timestamp_ns(size_t index) const { return frames_[index].timestamp_ns; }
  bool has_mask(size_t index) const { return !frames_[index].mask_path.empty(); }
  bool has_poses() const { return !poses_.empty(); }
  const std::optional<ObjectsYaml>& objects() const { return objects_; }

  // Frame `index` (< size()) with its files' bytes as they are: image, mask (8 or 16 bit label PNG), depth (16 bit
  // PNG), instances and pose; frame_id = index + 1. Instances come from the detections at the mask's time or, without
  // such a file, list all objects of objects.yaml. The pose is interpolated, and absent when none lies within 20 ms.
  // NOT_FOUND / INVALID_ARGUMENT name the file that is missing or not a PNG or JPEG.
  absl::StatusOr<FrameInput> Load(size_t index) const;

 private:
  struct FrameFiles {
    int64_t timestamp_ns = 0;
    std::string image_path;
    std::string mask_path;   // empty = no detector ran on this frame
    std::string depth_path;  // empty = no depth
    std::vector<Instance> instances;
  };

  absl::Status OpenMasks(const SequenceOptions& options);
  absl::Status OpenDetections(const SequenceOptions& options);
  absl::Status OpenPoses(const SequenceOptions& options);
  absl::Status OpenDepth(const SequenceOptions& options);
  absl::Status AttachFiles(const std::string& list, std::string FrameFiles::*target);
  std::vector<int64_t> Timestamps() const;
  int64_t HalfFrame_ns() const;
  std::string Path(const std::string& name) const { return dir_ + "/" + name; }

  std::string dir_;
  CameraYaml camera_;
  std::vector<FrameFiles> frames_;
  std::vector<StampedPose> poses_;
  std::optional<ObjectsYaml> objects_;
  std::optional<uint64_t> permute_labels_seed_;
};

}  // namespace romap::files
