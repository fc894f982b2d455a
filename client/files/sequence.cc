#include "client/files/sequence.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "client/files/associate.h"
#include "client/files/image_file.h"
#include "client/files/permute_labels.h"
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

absl::StatusOr<std::string> ReadMask(const std::string& path, std::optional<uint64_t> permutation_seed,
                                     std::vector<Instance>* instances) {
  ROMAP_ASSIGN_OR_RETURN(std::string label_png, ReadPngFile(path));
  if (!permutation_seed) return label_png;
  if (absl::Status status = PermuteLabels(*permutation_seed, &label_png, instances); !status.ok()) {
    return InvalidArgument("{}: {}", path, Message(status));
  }
  return label_png;
}

}  // namespace

absl::StatusOr<Sequence> Sequence::Open(const std::string& dir, const SequenceOptions& options) {
  std::error_code error;
  if (!std::filesystem::is_directory(dir, error)) return NotFound("{}: no such sequence folder", dir);
  for (const char* required : {"rgb.txt", "camera.yaml"}) {
    if (std::filesystem::exists(dir + "/" + required, error)) continue;
    return NotFound("{}: not a sequence folder; {} is missing", dir, required);
  }
  Sequence sequence;
  sequence.dir_ = dir;
  sequence.permute_labels_seed_ = options.permute_labels_seed;
  ROMAP_ASSIGN_OR_RETURN(sequence.camera_, ReadCameraYaml(sequence.Path("camera.yaml")));
  if (options.readout_s) sequence.camera_.camera.readout_s = *options.readout_s;
  ROMAP_RETURN_IF_ERROR(sequence.OpenImages());
  if (std::filesystem::exists(sequence.Path("objects.yaml"), error)) {
    ROMAP_ASSIGN_OR_RETURN(sequence.objects_, ReadObjects(sequence.Path("objects.yaml")));
  }
  ROMAP_RETURN_IF_ERROR(sequence.OpenMasks(options));
  ROMAP_RETURN_IF_ERROR(sequence.OpenDetections(options));
  ROMAP_RETURN_IF_ERROR(sequence.OpenPoses(options));
  ROMAP_RETURN_IF_ERROR(sequence.OpenDepth(options));
  if (!sequence.converted_.empty()) {
    sequence.diagnostics_.insert(sequence.diagnostics_.begin(), TimestampsConverted(sequence.converted_));
  }
  return sequence;
}

void Sequence::NoteUnit(const std::string& file, TimeUnit unit) {
  if (unit != TimeUnit::kSeconds) converted_.emplace_back(file, unit);
}

absl::Status Sequence::OpenImages() {
  ROMAP_ASSIGN_OR_RETURN(const FileList list, ReadFileList(dir_, "rgb.txt"));
  if (list.files.empty()) return InvalidArgument("{}: no frames listed", Path("rgb.txt"));
  NoteUnit("rgb.txt", list.unit);
  for (const ListedFile& image : list.files) {
    frames_.push_back({.timestamp_ns = image.timestamp_ns, .paths = {.image = image.path, .mask = {}, .depth = {}}});
  }
  return absl::OkStatus();
}

absl::Status Sequence::OpenMasks(const SequenceOptions& options) {
  if (!IsRequested(dir_, options.masks, SequenceOptions{}.masks)) return absl::OkStatus();
  ROMAP_ASSIGN_OR_RETURN(const FileList list, ReadFileList(dir_, options.masks));
  NoteUnit(options.masks, list.unit);
  const std::vector<int64_t> times_ns = TimestampsOf(list.files);
  const auto pairs = AssociateTimestamps(Timestamps(), times_ns, HalfFrame_ns());
  for (const auto& [frame, mask] : pairs) {
    frames_[frame].paths.mask = list.files[mask].path;
    frames_[frame].mask_timestamp_ns = list.files[mask].timestamp_ns;
  }
  if (pairs.empty() && !times_ns.empty()) {
    diagnostics_.push_back(UnmatchedInTime("masks_unmatched", "masks", options.masks, times_ns, Timestamps()));
  }
  return absl::OkStatus();
}

absl::Status Sequence::OpenDetections(const SequenceOptions& options) {
  if (IsRequested(dir_, options.detections, SequenceOptions{}.detections)) {
    ROMAP_ASSIGN_OR_RETURN(const DetectionFile detections, ReadDetections(Path(options.detections)));
    NoteUnit(options.detections, detections.unit);
    if (detections.scores_in_percent) diagnostics_.push_back(ScoresInPercent(options.detections));
    if (detections.timestamps_repeat) diagnostics_.push_back(DetectionsRepeat(options.detections, detections));
    AttachDetections(options.detections, detections);
  } else if (objects_) {
    std::vector<Instance> instances;
    for (const ObjectRecord& object : objects_->objects) {
      if (object.id < 1 || object.id > 65535) continue;  // not representable in a 16-bit mask
      instances.push_back(
          {.label = static_cast<uint32_t>(object.id), .class_name = object.class_name, .score = 1, .track_id = {}});
    }
    for (FrameFiles& frame : frames_) frame.instances = instances;
  }
  return absl::OkStatus();
}

void Sequence::AttachDetections(const std::string& name, const DetectionFile& detections) {
  std::vector<FrameFiles*> frames_with_mask;
  std::vector<int64_t> mask_times_ns;
  for (FrameFiles& frame : frames_) {
    if (frame.paths.mask.empty()) continue;
    frames_with_mask.push_back(&frame);
    mask_times_ns.push_back(frame.mask_timestamp_ns);
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
    diagnostics_.push_back(DetectionsUnmatched(name, detections, matched, masks_without));
  }
}

absl::Status Sequence::OpenPoses(const SequenceOptions& options) {
  if (!IsRequested(dir_, options.poses, SequenceOptions{}.poses)) return absl::OkStatus();
  TimeUnit unit = TimeUnit::kSeconds;
  ROMAP_ASSIGN_OR_RETURN(poses_, ReadTum(Path(options.poses), &unit));
  NoteUnit(options.poses, unit);
  if (const size_t removed = RemovePlaceholders(&poses_); removed > 0) {
    diagnostics_.push_back(PosesPlaceholder(options.poses, removed));
  }
  for (StampedPose& pose : poses_) pose.T_world_camera = ApplyConvention(options.convention, pose.T_world_camera);
  size_t posed = 0;
  std::optional<uint64_t> first_without;
  for (size_t k = 0; k < frames_.size(); ++k) {
    if (PoseAt(poses_, frames_[k].timestamp_ns, kMaxPoseDistance_ns)) {
      ++posed;
    } else if (!first_without) {
      first_without = k + 1;
    }
  }
  if (posed == 0) {
    diagnostics_.push_back(
        UnmatchedInTime("poses_unmatched", "poses", options.poses, TimestampsOf(poses_), Timestamps()));
  } else if (first_without) {
    diagnostics_.push_back(PosesPartial(options.poses, posed, frames_.size(), *first_without));
  }
  return absl::OkStatus();
}

absl::Status Sequence::OpenDepth(const SequenceOptions& options) {
  if (!options.use_depth) return absl::OkStatus();
  if (camera_.depth_scale <= 0) {
    return InvalidArgument("{}: depth images require 'depth_scale'", Path("camera.yaml"));
  }
  ROMAP_ASSIGN_OR_RETURN(const FileList list, ReadFileList(dir_, "depth.txt"));
  NoteUnit("depth.txt", list.unit);
  const std::vector<int64_t> times_ns = TimestampsOf(list.files);
  const auto pairs = AssociateTimestamps(Timestamps(), times_ns, HalfFrame_ns());
  for (const auto& [frame, depth] : pairs) frames_[frame].paths.depth = list.files[depth].path;
  if (pairs.empty() && !times_ns.empty()) {
    diagnostics_.push_back(UnmatchedInTime("depth_unmatched", "depth images", "depth.txt", times_ns, Timestamps()));
  }
  return absl::OkStatus();
}

std::vector<int64_t> Sequence::Timestamps() const { return TimestampsOf(frames_); }

int64_t Sequence::HalfFrame_ns() const { return std::llround(0.5e9 / camera_.fps); }

absl::StatusOr<FrameInput> Sequence::Load(size_t index) const {
  std::vector<UnreadableFile> unreadable;
  ROMAP_ASSIGN_OR_RETURN(FrameInput frame, LoadReadable(index, &unreadable));
  if (!unreadable.empty()) return unreadable.front().reason;
  return frame;
}

absl::StatusOr<FrameInput> Sequence::LoadReadable(size_t index, std::vector<UnreadableFile>* unreadable) const {
  if (index >= frames_.size())
    return InvalidArgument("{}: frame index {} is out of range; the sequence has {} frames", dir_, index,
                           frames_.size());
  const FrameFiles& files = frames_[index];
  FrameInput frame;
  frame.frame_id = index + 1;
  frame.timestamp_ns = files.timestamp_ns;
  ROMAP_ASSIGN_OR_RETURN(ImageFile image, ReadImageFile(files.paths.image));
  frame.image = std::move(image.bytes);
  frame.image_encoding = image.encoding;
  if (!files.paths.mask.empty()) {
    // Any odd multiplier gives different seeds; this one is 2^64 divided by the golden ratio.
    const auto seed =
        permute_labels_seed_ ? std::optional(*permute_labels_seed_ + 0x9e3779b97f4a7c15 * (index + 1)) : std::nullopt;
    std::vector<Instance> instances = files.instances;
    absl::StatusOr<std::string> label_png = ReadMask(files.paths.mask, seed, &instances);
    if (label_png.ok()) {
      frame.label_png = *std::move(label_png);
      frame.mask_encoding = MaskEncoding::kLabelPng;
      frame.instances = std::move(instances);
    } else {
      unreadable->push_back({FileKind::kMask, label_png.status()});
    }
  }
  if (!files.paths.depth.empty()) {
    absl::StatusOr<std::string> depth = ReadPngFile(files.paths.depth);
    if (depth.ok()) {
      frame.depth = *std::move(depth);
      frame.depth_encoding = DepthEncoding::kPng16;
      frame.depth_scale_mu = camera_.depth_scale;
    } else {
      unreadable->push_back({FileKind::kDepth, depth.status()});
    }
  }
  frame.T_world_camera = PoseAt(poses_, files.timestamp_ns, kMaxPoseDistance_ns);
  return frame;
}

}  // namespace romap::files
