#include "client/files/native_sequence.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "client/files/associate.h"
#include "client/files/detections.h"
#include "client/files/pose_placeholders.h"
#include "client/files/sequence_diagnostics.h"

namespace romap::files {
namespace {

constexpr int64_t kMaxPoseDistance_ns = 20'000'000;

template <class T>
std::vector<int64_t> TimestampsOf(const std::vector<T>& items) {
  std::vector<int64_t> timestamps_ns(items.size());
  std::transform(items.begin(), items.end(), timestamps_ns.begin(), [](const T& item) { return item.timestamp_ns; });
  return timestamps_ns;
}

// Whether to read a file. A file with its default name is optional.
bool IsRequested(const std::string& dir, const std::string& name, const std::string& default_name) {
  std::error_code error;
  return !name.empty() && (name != default_name || std::filesystem::exists(dir + "/" + name, error));
}

// Reads the lists of one folder, one after the other.
class NativeFolder {
 public:
  explicit NativeFolder(const std::string& dir) : dir_(dir) { contents_.source = dir; }

  absl::Status OpenImages();
  absl::Status OpenObjects();
  absl::Status OpenMasks(const SequenceOptions& options);
  absl::Status OpenDetections(const SequenceOptions& options);
  absl::Status OpenPoses(const SequenceOptions& options);
  absl::Status OpenDepth(const SequenceOptions& options);
  CameraYaml& camera() { return contents_.camera; }
  std::string Path(const std::string& name) const { return dir_ + "/" + name; }
  SequenceContents Take();

 private:
  void AttachDetections(const std::string& name, const DetectionFile& detections);
  void NoteUnit(const std::string& file, TimeUnit unit);
  std::vector<int64_t> Timestamps() const { return TimestampsOf(contents_.frames); }
  int64_t HalfFrame_ns() const { return std::llround(0.5e9 / contents_.camera.fps); }

  std::string dir_;
  SequenceContents contents_;
  std::vector<int64_t> mask_times_ns_;                       // of the masks; 0 if a frame has none
  std::vector<std::pair<std::string, TimeUnit>> converted_;  // files whose timestamps are not in seconds
};

void NativeFolder::NoteUnit(const std::string& file, TimeUnit unit) {
  if (unit != TimeUnit::kSeconds) converted_.emplace_back(file, unit);
}

absl::Status NativeFolder::OpenImages() {
  ROMAP_ASSIGN_OR_RETURN(const FileList list, ReadFileList(dir_, "rgb.txt"));
  if (list.files.empty()) return InvalidArgument("{}: no frames listed", Path("rgb.txt"));
  NoteUnit("rgb.txt", list.unit);
  for (const ListedFile& image : list.files) {
    contents_.frames.push_back(
        {.timestamp_ns = image.timestamp_ns, .paths = {.image = image.path, .mask = {}, .depth = {}}});
  }
  return absl::OkStatus();
}

absl::Status NativeFolder::OpenObjects() {
  std::error_code error;
  if (!std::filesystem::exists(Path("objects.yaml"), error)) return absl::OkStatus();
  ROMAP_ASSIGN_OR_RETURN(contents_.objects, ReadObjects(Path("objects.yaml")));
  return absl::OkStatus();
}

absl::Status NativeFolder::OpenMasks(const SequenceOptions& options) {
  if (!IsRequested(dir_, options.masks, SequenceOptions{}.masks)) return absl::OkStatus();
  ROMAP_ASSIGN_OR_RETURN(const FileList list, ReadFileList(dir_, options.masks));
  NoteUnit(options.masks, list.unit);
  const std::vector<int64_t> times_ns = TimestampsOf(list.files);
  const auto pairs = AssociateTimestamps(Timestamps(), times_ns, HalfFrame_ns());
  mask_times_ns_.assign(contents_.frames.size(), 0);
  for (const auto& [frame, mask] : pairs) {
    contents_.frames[frame].paths.mask = list.files[mask].path;
    mask_times_ns_[frame] = list.files[mask].timestamp_ns;
  }
  if (pairs.empty() && !times_ns.empty()) {
    contents_.diagnostics.push_back(UnmatchedInTime("masks_unmatched", "masks", options.masks, times_ns, Timestamps()));
  }
  return absl::OkStatus();
}

absl::Status NativeFolder::OpenDetections(const SequenceOptions& options) {
  if (IsRequested(dir_, options.detections, SequenceOptions{}.detections)) {
    ROMAP_ASSIGN_OR_RETURN(const DetectionFile detections, ReadDetections(Path(options.detections)));
    NoteUnit(options.detections, detections.unit);
    if (detections.scores_in_percent) contents_.diagnostics.push_back(ScoresInPercent(options.detections));
    if (detections.timestamps_repeat) contents_.diagnostics.push_back(DetectionsRepeat(options.detections, detections));
    AttachDetections(options.detections, detections);
  } else if (contents_.objects) {
    std::vector<Instance> instances;
    for (const ObjectRecord& object : contents_.objects->objects) {
      if (object.id < 1 || object.id > 65535) continue;  // not representable in a 16-bit mask
      instances.push_back(
          {.label = static_cast<uint32_t>(object.id), .class_name = object.class_name, .score = 1, .track_id = {}});
    }
    for (FrameRecord& frame : contents_.frames) frame.instances = instances;
  }
  return absl::OkStatus();
}

void NativeFolder::AttachDetections(const std::string& name, const DetectionFile& detections) {
  std::vector<FrameRecord*> frames_with_mask;
  std::vector<int64_t> mask_times_ns;
  for (size_t k = 0; k < contents_.frames.size(); ++k) {
    if (contents_.frames[k].paths.mask.empty()) continue;
    frames_with_mask.push_back(&contents_.frames[k]);
    mask_times_ns.push_back(mask_times_ns_[k]);
  }
  // The nearest mask is the right one, also if the frames are a part of a recording at the rate of camera.yaml.
  const int64_t max_dt_ns = std::max(HalfFrame_ns(), MedianStep_ns(Timestamps()) / 2);
  const std::vector<int64_t> match = MatchDetections(detections, mask_times_ns, max_dt_ns);
  std::vector<bool> matched(detections.sets.size());
  for (size_t k = 0; k < match.size(); ++k) {
    if (match[k] < 0) continue;
    const auto set = static_cast<size_t>(match[k]);
    matched[set] = true;
    frames_with_mask[k]->instances = detections.sets[set].instances;
  }
  if (std::ranges::count(matched, false) > 0) {
    const auto masks_without = static_cast<size_t>(std::ranges::count(match, -1));
    contents_.diagnostics.push_back(DetectionsUnmatched(name, detections, matched, masks_without));
  }
}

absl::Status NativeFolder::OpenPoses(const SequenceOptions& options) {
  if (!IsRequested(dir_, options.poses, SequenceOptions{}.poses)) return absl::OkStatus();
  TimeUnit unit = TimeUnit::kSeconds;
  ROMAP_ASSIGN_OR_RETURN(std::vector<StampedPose> poses, ReadTum(Path(options.poses), &unit));
  NoteUnit(options.poses, unit);
  if (const size_t removed = RemovePlaceholders(&poses); removed > 0) {
    contents_.diagnostics.push_back(PosesPlaceholder(options.poses, removed));
  }
  for (StampedPose& pose : poses) pose.T_world_camera = ApplyConvention(options.convention, pose.T_world_camera);
  size_t posed = 0;
  std::optional<uint64_t> first_without;
  for (size_t k = 0; k < contents_.frames.size(); ++k) {
    contents_.frames[k].T_world_camera = PoseAt(poses, contents_.frames[k].timestamp_ns, kMaxPoseDistance_ns);
    if (contents_.frames[k].T_world_camera) {
      ++posed;
    } else if (!first_without) {
      first_without = k + 1;
    }
  }
  if (posed == 0) {
    contents_.diagnostics.push_back(
        UnmatchedInTime("poses_unmatched", "poses", options.poses, TimestampsOf(poses), Timestamps()));
  } else if (first_without) {
    contents_.diagnostics.push_back(PosesPartial(options.poses, posed, contents_.frames.size(), *first_without));
  }
  return absl::OkStatus();
}

absl::Status NativeFolder::OpenDepth(const SequenceOptions& options) {
  if (!options.use_depth) return absl::OkStatus();
  if (contents_.camera.depth_scale <= 0) {
    return InvalidArgument("{}: depth images require 'depth_scale'", Path("camera.yaml"));
  }
  ROMAP_ASSIGN_OR_RETURN(const FileList list, ReadFileList(dir_, "depth.txt"));
  NoteUnit("depth.txt", list.unit);
  const std::vector<int64_t> times_ns = TimestampsOf(list.files);
  const auto pairs = AssociateTimestamps(Timestamps(), times_ns, HalfFrame_ns());
  for (const auto& [frame, depth] : pairs) contents_.frames[frame].paths.depth = list.files[depth].path;
  if (pairs.empty() && !times_ns.empty()) {
    contents_.diagnostics.push_back(
        UnmatchedInTime("depth_unmatched", "depth images", "depth.txt", times_ns, Timestamps()));
  }
  return absl::OkStatus();
}

SequenceContents NativeFolder::Take() {
  if (!converted_.empty()) {
    contents_.diagnostics.insert(contents_.diagnostics.begin(), TimestampsConverted(converted_));
  }
  return std::move(contents_);
}

}  // namespace

absl::StatusOr<SequenceContents> ReadNativeSequence(const std::string& dir, const SequenceOptions& options) {
  std::error_code error;
  if (!std::filesystem::is_directory(dir, error)) return NotFound("{}: no such sequence folder", dir);
  for (const char* required : {"rgb.txt", "camera.yaml"}) {
    if (std::filesystem::exists(dir + "/" + required, error)) continue;
    return NotFound("{}: not a sequence folder; {} is missing", dir, required);
  }
  NativeFolder folder(dir);
  ROMAP_ASSIGN_OR_RETURN(folder.camera(), ReadCameraYaml(folder.Path("camera.yaml")));
  if (options.readout_s) folder.camera().camera.readout_s = *options.readout_s;
  ROMAP_RETURN_IF_ERROR(folder.OpenImages());
  ROMAP_RETURN_IF_ERROR(folder.OpenObjects());
  ROMAP_RETURN_IF_ERROR(folder.OpenMasks(options));
  ROMAP_RETURN_IF_ERROR(folder.OpenDetections(options));
  ROMAP_RETURN_IF_ERROR(folder.OpenPoses(options));
  ROMAP_RETURN_IF_ERROR(folder.OpenDepth(options));
  return folder.Take();
}

}  // namespace romap::files
