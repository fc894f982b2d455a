#include "client/files/sequence.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "client/files/associate.h"
#include "client/files/permute_labels.h"
#include "client/files/text_file.h"
#include "common/utf8.h"

namespace romap::files {
namespace {

constexpr int64_t kMaxPoseDistance_ns = 20'000'000;

struct ListedFile {
  int64_t timestamp_ns = 0;
  std::string path;
};

// All detections with the same timestamp.
struct DetectionSet {
  int64_t timestamp_ns = 0;
  std::vector<Instance> instances;
};

template <class T>
std::vector<int64_t> TimestampsOf(const std::vector<T>& items) {
  std::vector<int64_t> timestamps_ns(items.size());
  std::transform(items.begin(), items.end(), timestamps_ns.begin(), [](const T& item) { return item.timestamp_ns; });
  return timestamps_ns;
}

// Reads lines of `timestamp filename`. The filename is relative to `dir`; timestamps must strictly increase.
absl::StatusOr<std::vector<ListedFile>> ReadFileList(const std::string& dir, const std::string& name) {
  const std::string path = dir + "/" + name;
  ROMAP_ASSIGN_OR_RETURN(const std::vector<TableLine> lines, ReadTable(path, ' '));
  std::vector<ListedFile> files;
  for (const TableLine& line : lines) {
    const std::optional<int64_t> timestamp_ns = ParseSeconds(line.fields[0]);
    if (!timestamp_ns || line.fields.size() != 2) {
      return InvalidArgument("{}:{}: expected 'timestamp filename' (timestamp in seconds)", path, line.number);
    }
    if (!files.empty() && *timestamp_ns <= files.back().timestamp_ns) {
      return InvalidArgument("{}:{}: timestamps must increase; got {} after {}", path, line.number, line.fields[0],
                             FormatSeconds(files.back().timestamp_ns));
    }
    const std::string file = dir + "/" + line.fields[1];
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) {
      return NotFound("{}:{}: {} does not exist", path, line.number, file);
    }
    files.push_back({*timestamp_ns, file});
  }
  return files;
}

absl::StatusOr<Instance> ParseDetection(const TableLine& line, const std::string& path) {
  const std::vector<std::string>& fields = line.fields;
  if (fields.size() != 3 && fields.size() != 4) {
    return InvalidArgument("{}:{}: {} fields; expected timestamp,label,class[,score]", path, line.number,
                           fields.size());
  }
  const std::optional<double> label = ParseNumber(fields[1]);
  if (!label || *label < 1 || *label > 65535 || *label != std::floor(*label)) {
    return InvalidArgument("{}:{}: label '{}' must be an integer from 1 to 65535", path, line.number, fields[1]);
  }
  if (!IsUtf8(fields[2])) return InvalidArgument("{}:{}: class name is not valid UTF-8", path, line.number);
  const std::optional<double> score = fields.size() == 4 ? ParseNumber(fields[3]) : std::optional(1.0);
  if (!score || *score < 0 || *score > 1) {
    return InvalidArgument("{}:{}: score '{}' must be a number from 0 to 1", path, line.number, fields[3]);
  }
  return Instance{.label = static_cast<uint32_t>(*label), .class_name = fields[2], .score = *score, .track_id = {}};
}

absl::StatusOr<std::vector<DetectionSet>> ReadDetections(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<TableLine> lines, ReadTable(path, ','));
  std::vector<DetectionSet> sets;
  for (const TableLine& line : lines) {
    if (&line == &lines.front() && line.fields[0] == "timestamp") continue;  // header
    const std::optional<int64_t> timestamp_ns = ParseSeconds(line.fields[0]);
    if (!timestamp_ns) return InvalidArgument("{}:{}: '{}' is not a timestamp", path, line.number, line.fields[0]);
    ROMAP_ASSIGN_OR_RETURN(Instance instance, ParseDetection(line, path));
    if (!sets.empty() && *timestamp_ns < sets.back().timestamp_ns) {
      return InvalidArgument("{}:{}: timestamps must not decrease; got {} after {}", path, line.number, line.fields[0],
                             FormatSeconds(sets.back().timestamp_ns));
    }
    if (sets.empty() || sets.back().timestamp_ns != *timestamp_ns) sets.push_back({*timestamp_ns, {}});
    sets.back().instances.push_back(std::move(instance));
  }
  return sets;
}

// Whether to read a file. A file with its default name is optional.
bool IsRequested(const std::string& dir, const std::string& name, const std::string& default_name) {
  std::error_code error;
  return !name.empty() && (name != default_name || std::filesystem::exists(dir + "/" + name, error));
}

absl::StatusOr<ImageEncoding> EncodingOf(const std::string& bytes, const std::string& path) {
  if (bytes.starts_with("\x89PNG\r\n\x1a\n")) return ImageEncoding::kPng;
  if (bytes.starts_with("\xff\xd8\xff")) return ImageEncoding::kJpeg;
  return InvalidArgument("{}: neither a PNG nor a JPEG file", path);
}

absl::StatusOr<std::string> ReadPng(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(std::string bytes, ReadFile(path));
  ROMAP_ASSIGN_OR_RETURN(const ImageEncoding encoding, EncodingOf(bytes, path));
  if (encoding != ImageEncoding::kPng) return InvalidArgument("{}: expected a PNG file (JPEG is lossy)", path);
  return bytes;
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
  ROMAP_ASSIGN_OR_RETURN(const std::vector<ListedFile> images, ReadFileList(dir, "rgb.txt"));
  if (images.empty()) return InvalidArgument("{}/rgb.txt: no frames listed", dir);
  for (const ListedFile& image : images) sequence.frames_.push_back({image.timestamp_ns, image.path, {}, {}, {}});
  if (std::filesystem::exists(sequence.Path("objects.yaml"), error)) {
    ROMAP_ASSIGN_OR_RETURN(sequence.objects_, ReadObjects(sequence.Path("objects.yaml")));
  }
  ROMAP_RETURN_IF_ERROR(sequence.OpenMasks(options));
  ROMAP_RETURN_IF_ERROR(sequence.OpenDetections(options));
  ROMAP_RETURN_IF_ERROR(sequence.OpenPoses(options));
  ROMAP_RETURN_IF_ERROR(sequence.OpenDepth(options));
  return sequence;
}

absl::Status Sequence::OpenMasks(const SequenceOptions& options) {
  if (!IsRequested(dir_, options.masks, SequenceOptions{}.masks)) return absl::OkStatus();
  return AttachFiles(options.masks, &FrameFiles::mask_path);
}

absl::Status Sequence::OpenDetections(const SequenceOptions& options) {
  if (IsRequested(dir_, options.detections, SequenceOptions{}.detections)) {
    ROMAP_ASSIGN_OR_RETURN(std::vector<DetectionSet> sets, ReadDetections(Path(options.detections)));
    for (const auto& [frame, set] : AssociateTimestamps(Timestamps(), TimestampsOf(sets), HalfFrame_ns())) {
      frames_[frame].instances = std::move(sets[set].instances);
    }
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

absl::Status Sequence::OpenPoses(const SequenceOptions& options) {
  if (!IsRequested(dir_, options.poses, SequenceOptions{}.poses)) return absl::OkStatus();
  ROMAP_ASSIGN_OR_RETURN(poses_, ReadTum(Path(options.poses)));
  for (StampedPose& pose : poses_) pose.T_world_camera = ApplyConvention(options.convention, pose.T_world_camera);
  return absl::OkStatus();
}

absl::Status Sequence::OpenDepth(const SequenceOptions& options) {
  if (!options.use_depth) return absl::OkStatus();
  if (camera_.depth_scale <= 0) {
    return InvalidArgument("{}: depth images require 'depth_scale'", Path("camera.yaml"));
  }
  return AttachFiles("depth.txt", &FrameFiles::depth_path);
}

absl::Status Sequence::AttachFiles(const std::string& list, std::string FrameFiles::*target) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<ListedFile> files, ReadFileList(dir_, list));
  for (const auto& [frame, file] : AssociateTimestamps(Timestamps(), TimestampsOf(files), HalfFrame_ns())) {
    frames_[frame].*target = files[file].path;
  }
  return absl::OkStatus();
}

std::vector<int64_t> Sequence::Timestamps() const { return TimestampsOf(frames_); }

int64_t Sequence::HalfFrame_ns() const { return std::llround(0.5e9 / camera_.fps); }

absl::StatusOr<FrameInput> Sequence::Load(size_t index) const {
  if (index >= frames_.size())
    return InvalidArgument("{}: frame index {} is out of range; the sequence has {} frames", dir_, index,
                           frames_.size());
  const FrameFiles& files = frames_[index];
  FrameInput frame;
  frame.frame_id = index + 1;
  frame.timestamp_ns = files.timestamp_ns;
  ROMAP_ASSIGN_OR_RETURN(frame.image, ReadFile(files.image_path));
  ROMAP_ASSIGN_OR_RETURN(frame.image_encoding, EncodingOf(frame.image, files.image_path));
  if (!files.mask_path.empty()) {
    ROMAP_ASSIGN_OR_RETURN(frame.label_png, ReadPng(files.mask_path));
    frame.mask_encoding = MaskEncoding::kLabelPng;
    frame.instances = files.instances;
    if (permute_labels_seed_) {
      // Any odd multiplier gives different seeds; this one is 2^64 divided by the golden ratio.
      const uint64_t seed = *permute_labels_seed_ + 0x9e3779b97f4a7c15 * (index + 1);
      if (absl::Status status = PermuteLabels(seed, &frame.label_png, &frame.instances); !status.ok()) {
        return InvalidArgument("{}: {}", files.mask_path, Message(status));
      }
    }
  }
  if (!files.depth_path.empty()) {
    ROMAP_ASSIGN_OR_RETURN(frame.depth, ReadPng(files.depth_path));
    frame.depth_encoding = DepthEncoding::kPng16;
    frame.depth_scale_mu = camera_.depth_scale;
  }
  frame.T_world_camera = PoseAt(poses_, files.timestamp_ns, kMaxPoseDistance_ns);
  return frame;
}

}  // namespace romap::files
