#include "client/importers/open_recording.h"

#include <algorithm>
#include <exception>
#include <filesystem>

#include "client/files/pose_convention.h"
#include "client/files/sequence_diagnostics.h"
#include "client/files/text_file.h"
#include "client/importers/any_image.h"
#include "client/importers/folder.h"
#include "client/importers/join_masks.h"
#include "client/importers/one_camera.h"
#include "client/importers/readers.h"

namespace romap::importers {
namespace {

absl::StatusOr<const SequenceReader*> FindReader(const std::string& source) {
  std::error_code error;
  if (!std::filesystem::exists(source, error)) return NotFound("{}: no such file or folder", source);
  std::vector<std::string> expected;
  for (const auto& reader : AllReaders()) {
    if (reader->Fits(source)) return reader.get();
    expected.push_back(fmt::format("{} ({})", reader->Name(), reader->Expected()));
  }
  return InvalidArgument("{}: not a known layout of recordings; found {}; looked for {}", source,
                         DescribeSource(source), fmt::join(expected, "; "));
}

// nlohmann::json throws where a value has another type than a reader expects.
absl::StatusOr<RecordingContents> ReadWith(const SequenceReader& reader, const std::string& source,
                                           const ReadOptions& options) {
  try {
    return reader.Read(source, options);
  } catch (const std::exception& e) {
    return InvalidArgument("{}: malformed {}: {}", source, reader.Name(), e.what());
  }
}

// Whether --masks names a list of a folder in the native layout, instead of masks that are joined by name.
bool IsNativeMaskList(const std::string& source, const std::string& masks) {
  if (masks.empty() || masks == files::SequenceOptions{}.masks) return true;
  const std::string path = source + "/" + masks;
  if (!IsFile(path)) return false;
  const auto lines = files::ReadLines(path);
  return lines.ok() && (lines->empty() ||
                        files::ParseNumber(lines->front().text.substr(0, lines->front().text.find_first_of(" \t"))));
}

absl::Status CheckFilesExist(const RecordingContents& contents, const char* kind,
                             std::string files::FramePaths::*path) {
  size_t listed = 0, missing = 0;
  std::string first;
  for (const RecordedFrame& frame : contents.frames) {
    if ((frame.paths.*path).empty()) continue;
    ++listed;
    if ((path == &files::FramePaths::image && frame.load_image) || IsFile(frame.paths.*path)) continue;
    if (missing++ == 0) first = frame.paths.*path;
  }
  if (static_cast<double>(missing) <= files::kMaxUnreadableShare * static_cast<double>(listed)) {
    return absl::OkStatus();
  }
  return NotFound("{} does not exist; {} of {} {} are missing", first, missing, listed, kind);
}

// Applies the options that a native sequence applies while it is read.
void ApplyFileOptions(const files::SequenceOptions& options, RecordingContents* contents) {
  size_t posed = 0;
  std::optional<uint64_t> first_without;
  for (size_t k = 0; k < contents->frames.size(); ++k) {
    RecordedFrame& frame = contents->frames[k];
    if (options.masks.empty()) frame.paths.mask.clear();
    if (!options.use_depth) frame.paths.depth.clear();
    if (options.poses.empty()) frame.T_world_camera.reset();
    if (frame.T_world_camera) {
      ++posed;
      frame.T_world_camera = files::ApplyConvention(options.convention, *frame.T_world_camera);
    } else if (!first_without) {
      first_without = k + 1;
    }
  }
  if (options.readout_s) contents->camera.camera.readout_s = *options.readout_s;
  if (posed > 0 && first_without) {
    contents->diagnostics.push_back(
        files::PosesPartial(contents->source, posed, contents->frames.size(), *first_without));
  }
}

void TakeEvery(size_t every, RecordingContents* contents) {
  if (every <= 1) return;
  std::vector<RecordedFrame> kept;
  for (size_t k = 0; k < contents->frames.size(); k += every) kept.push_back(std::move(contents->frames[k]));
  contents->frames = std::move(kept);
  contents->camera.fps /= static_cast<double>(every);
}

// Images of a data set are often scaled down without its calibration.
absl::Status CheckImageSize(const RecordingContents& contents) {
  const RecordedFrame& first = contents.frames.front();
  const CameraModel& camera = contents.camera.camera;
  if (first.load_image) return absl::OkStatus();
  const absl::StatusOr<cv::Size> size_px = ImageSize(first.paths.image);
  if (!size_px.ok() || *size_px == cv::Size(camera.width_px, camera.height_px)) return absl::OkStatus();
  return InvalidArgument("{}: {}x{} px; the calibration is for {}x{} px", first.paths.image, size_px->width,
                         size_px->height, camera.width_px, camera.height_px);
}

absl::Status CheckContents(const std::string& layout, const RecordingContents& contents) {
  if (contents.frames.empty()) return InvalidArgument("{}: the {} has no frames", contents.source, layout);
  if (absl::Status status = ValidateCameraModel(contents.camera.camera); !status.ok()) {
    return InvalidArgument("{}: camera: {}", contents.source, Message(status));
  }
  ROMAP_RETURN_IF_ERROR(CheckFilesExist(contents, "images", &files::FramePaths::image));
  ROMAP_RETURN_IF_ERROR(CheckImageSize(contents));
  return CheckFilesExist(contents, "depth images", &files::FramePaths::depth);
}

files::SequenceContents ToSequence(RecordingContents contents) {
  files::SequenceContents sequence{.source = std::move(contents.source),
                                   .camera = std::move(contents.camera),
                                   .frames = {},
                                   .objects = std::move(contents.objects),
                                   .diagnostics = std::move(contents.diagnostics)};
  for (RecordedFrame& frame : contents.frames) sequence.frames.push_back(std::move(frame));
  return sequence;
}

}  // namespace

absl::StatusOr<files::Sequence> OpenRecording(const std::string& source, const ReadOptions& options) {
  ROMAP_ASSIGN_OR_RETURN(const SequenceReader* const reader, FindReader(source));
  const bool is_native = reader == AllReaders().front().get();
  const std::string& masks = options.files.masks;
  const bool joins_masks = !IsNativeMaskList(source, masks) || (!is_native && masks != files::SequenceOptions{}.masks);
  ReadOptions read_options = options;
  if (joins_masks && !masks.empty()) {
    read_options.files.masks.clear();
    read_options.files.detections.clear();
  }
  ROMAP_ASSIGN_OR_RETURN(RecordingContents contents, ReadWith(*reader, source, read_options));
  CameraModel& camera = contents.camera.camera;
  if (options.focal_px > 0) camera.fx_px = camera.fy_px = options.focal_px;
  TakeEvery(options.every, &contents);
  if (!is_native) {
    contents.diagnostics.insert(
        contents.diagnostics.begin(),
        {.code = "layout", .severity = Severity::kInfo, .text = fmt::format("read as {}", reader->Name())});
    ApplyFileOptions(read_options.files, &contents);
    ROMAP_RETURN_IF_ERROR(CheckContents(reader->Name(), contents));
  }
  if (joins_masks && !masks.empty()) ROMAP_RETURN_IF_ERROR(JoinMasks(masks, source, &contents));
  ApplyIgnoreMasks(&contents);
  ROMAP_RETURN_IF_ERROR(UseOneCamera(&contents));
  return files::Sequence(ToSequence(std::move(contents)), options.files.permute_labels_seed);
}

}  // namespace romap::importers
