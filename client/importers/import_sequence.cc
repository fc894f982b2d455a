#include "client/importers/import_sequence.h"

#include <cmath>
#include <filesystem>
#include <opencv2/core.hpp>

#include "client/files/text_file.h"
#include "client/files/tum.h"
#include "client/importers/any_image.h"
#include "common/file_status.h"
#include "common/png_reader.h"

namespace romap::importers {
namespace {

namespace fs = std::filesystem;

absl::Status LinkOrCopy(const std::string& from, const std::string& to) {
  std::error_code error;
  const fs::path file = fs::canonical(from, error);  // a hard link to a symbolic link would be one
  if (error) return FileError(from, "read", error);
  fs::create_hard_link(file, to, error);
  if (!error) return absl::OkStatus();
  error.clear();
  fs::copy_file(file, to, error);
  return error ? FileError(to, "write", error) : absl::OkStatus();
}

std::string CsvField(const std::string& text) {
  if (text.find_first_of(",;\t\"\n#") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

// A folder in the native layout that grows frame by frame.
class SequenceWriter {
 public:
  SequenceWriter(const files::Sequence& sequence, std::string folder)
      : sequence_(sequence), folder_(std::move(folder)) {}

  absl::Status Prepare() const {
    std::error_code error;
    if (fs::exists(folder_, error) && !fs::is_empty(folder_, error)) {
      return FailedPrecondition("{}: not an empty folder; expected a new one for the sequence", folder_);
    }
    return files::MakeFolder(folder_ + "/rgb");
  }

  // INVALID_ARGUMENT or NOT_FOUND: the image cannot be read. Other errors: nothing can be written.
  absl::Status Add(size_t index) {
    const files::FrameRecord& record = sequence_.frame(index);
    std::vector<files::UnreadableFile> unreadable;
    ROMAP_ASSIGN_OR_RETURN(const FrameInput frame, sequence_.LoadReadable(index, &unreadable));
    const std::string stamp = files::FormatSeconds(frame.timestamp_ns);
    const std::string number = fmt::format("{:06}", index);
    const std::string image = "rgb/" + number + (frame.image_encoding == ImageEncoding::kPng ? ".png" : ".jpg");
    ROMAP_RETURN_IF_ERROR(Keep(record.load_image ? "" : record.paths.image, frame.image, image));
    rgb_ += stamp + " " + image + "\n";
    ++counts_.frames;
    if (frame.T_world_camera) poses_.push_back({frame.timestamp_ns, *frame.T_world_camera});
    if (frame.mask_encoding == MaskEncoding::kLabelPng) {
      const std::string mask = "mask/" + number + ".png";
      ROMAP_RETURN_IF_ERROR(Keep(record.load_masks ? "" : record.paths.mask, frame.label_png, mask));
      masks_ += stamp + " " + mask + "\n";
      ++counts_.masks;
      for (const Instance& instance : frame.instances) {
        detections_ +=
            fmt::format("{},{},{},{}\n", stamp, instance.label, CsvField(instance.class_name), instance.score);
      }
    }
    if (frame.depth_encoding != DepthEncoding::kPng16) return absl::OkStatus();
    const std::string depth = "depth/" + number + ".png";
    const bool rescale = frame.depth_scale_mu != sequence_.depth_scale();
    ROMAP_ASSIGN_OR_RETURN(const std::string png, rescale ? Rescaled(frame) : frame.depth);
    ROMAP_RETURN_IF_ERROR(Keep(record.load_depth || rescale ? "" : record.paths.depth, png, depth));
    depths_ += stamp + " " + depth + "\n";
    ++counts_.depth_images;
    return absl::OkStatus();
  }

  absl::StatusOr<ImportCounts> Finish() {
    counts_.poses = poses_.size();
    files::CameraYaml camera{.camera = sequence_.camera(),
                             .fps = sequence_.fps(),
                             .depth_scale = counts_.depth_images > 0 ? sequence_.depth_scale() : 0,
                             .world_up = sequence_.world_up()};
    ROMAP_RETURN_IF_ERROR(files::WriteCameraYaml(folder_ + "/camera.yaml", camera));
    ROMAP_RETURN_IF_ERROR(files::WriteFile(folder_ + "/rgb.txt", rgb_));
    if (counts_.masks > 0) ROMAP_RETURN_IF_ERROR(files::WriteFile(folder_ + "/mask.txt", masks_));
    if (!detections_.empty()) {
      ROMAP_RETURN_IF_ERROR(
          files::WriteFile(folder_ + "/detections.csv", "timestamp,label,class,score\n" + detections_));
    }
    if (counts_.depth_images > 0) ROMAP_RETURN_IF_ERROR(files::WriteFile(folder_ + "/depth.txt", depths_));
    if (!poses_.empty()) ROMAP_RETURN_IF_ERROR(files::WriteTum(folder_ + "/groundtruth.txt", poses_));
    if (sequence_.objects()) {
      ROMAP_RETURN_IF_ERROR(files::WriteObjects(folder_ + "/objects.yaml", *sequence_.objects()));
    }
    return counts_;
  }

 private:
  // `file`: the source of exactly these bytes; empty: there is none.
  absl::Status Keep(const std::string& file, const std::string& bytes, const std::string& name) const {
    const std::string path = folder_ + "/" + name;
    ROMAP_RETURN_IF_ERROR(files::MakeFolder(fs::path(path).parent_path().string()));
    return file.empty() ? files::WriteFile(path, bytes) : LinkOrCopy(file, path);
  }

  // The depth image in the unit of the sequence.
  absl::StatusOr<std::string> Rescaled(const FrameInput& frame) const {
    ROMAP_ASSIGN_OR_RETURN(const cv::Mat depth, DecodePng(frame.depth, PngPixels::kStored, {}));
    cv::Mat scaled;
    depth.convertTo(scaled, CV_16U, frame.depth_scale_mu / sequence_.depth_scale());
    return EncodePng(scaled);
  }

  const files::Sequence& sequence_;
  const std::string folder_;
  std::string rgb_, masks_, depths_, detections_;
  std::vector<files::StampedPose> poses_;
  ImportCounts counts_;
};

}  // namespace

absl::StatusOr<ImportCounts> WriteNativeSequence(const files::Sequence& sequence, const std::string& folder,
                                                 const std::function<bool(size_t)>& proceed) {
  SequenceWriter writer(sequence, folder);
  ROMAP_RETURN_IF_ERROR(writer.Prepare());
  size_t unreadable = 0;
  for (size_t k = 0; k < sequence.size(); ++k) {
    const absl::Status status = writer.Add(k);
    const bool is_unreadable = absl::IsInvalidArgument(status) || absl::IsNotFound(status);
    if (!status.ok() && !is_unreadable) return status;
    unreadable += is_unreadable ? 1 : 0;
    if (static_cast<double>(unreadable) > files::kMaxUnreadableShare * static_cast<double>(sequence.size())) {
      return InvalidArgument("at least {} of {} images cannot be read; the last: {}", unreadable, sequence.size(),
                             Message(status));
    }
    if (!proceed(k + 1)) return absl::CancelledError("interrupted; the sequence is not complete");
  }
  return writer.Finish();
}

}  // namespace romap::importers
