#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "client/cli/command.h"
#include "client/cli/run_stream.h"
#include "client/cli/service_options.h"
#include "client/doctor/camera_check.h"
#include "client/doctor/image_check.h"
#include "client/doctor/stamps_check.h"
#include "client/files/format_diagnostic.h"
#include "client/files/sequence.h"
#include "common/color_image.h"
#include "common/label_png.h"
#include "common/status.h"

namespace romap::cli {
namespace {

// Enough to see what is wrong; mapping all frames would take minutes.
constexpr size_t kMaxMappedFrames = 150;
constexpr size_t kMaxCheckedImages = 100;

struct DoctorOptions {
  std::string sequence_dir;
  files::SequenceOptions sequence;
  bool no_poses = false;
};

// What the recording contains, for the first lines of the report.
struct Contents {
  size_t frames = 0, with_masks = 0, with_poses = 0, with_depth = 0;
  std::set<std::string> classes = {};
};

Contents ContentsOf(const files::Sequence& sequence, const std::vector<size_t>& indices) {
  Contents contents{.frames = sequence.size()};
  for (size_t i = 0; i < sequence.size(); ++i) {
    contents.with_masks += sequence.has_mask(i) ? 1 : 0;
    contents.with_depth += sequence.paths(i).depth.empty() ? 0 : 1;
  }
  size_t posed = 0;
  for (const size_t index : indices) {
    std::vector<files::UnreadableFile> unreadable;
    const auto frame = sequence.LoadReadable(index, &unreadable);
    if (!frame.ok()) continue;
    posed += frame->T_world_camera ? 1 : 0;
    for (const Instance& instance : frame->instances) contents.classes.insert(instance.class_name);
  }
  contents.with_poses = posed * sequence.size() / std::max<size_t>(1, indices.size());
  return contents;
}

// At most `count` frames, evenly spaced.
std::vector<size_t> Spread(size_t frames, size_t count) {
  std::vector<size_t> indices;
  const size_t step = std::max<size_t>(1, (frames + count - 1) / count);
  for (size_t i = 0; i < frames; i += step) indices.push_back(i);
  return indices;
}

std::vector<Diagnostic> CheckImages(const files::Sequence& sequence, const std::vector<size_t>& indices) {
  doctor::ImageCheck check;
  SampleRange range;
  for (const size_t index : indices) {
    std::vector<files::UnreadableFile> unreadable;
    const auto frame = sequence.LoadReadable(index, &unreadable);
    if (!frame.ok()) continue;
    const cv::Mat image = DecodeColor(frame->image, &range);
    if (image.empty()) continue;
    const auto labels =
        frame->label_png.empty() ? absl::StatusOr<cv::Mat>(cv::Mat()) : DecodeLabelPng(frame->label_png);
    check.Add(frame->frame_id, image, labels.value_or(cv::Mat()));
  }
  return check.Diagnostics();
}

// Maps some frames without training, and returns what the client and the server say about them.
absl::StatusOr<std::vector<Diagnostic>> CheckByMapping(const files::Sequence& sequence, bool use_poses) {
  ServiceOptions service_options;
  service_options.local = true;
  service_options.settings = {"objects.confirm_frames=1000"};  // no object is confirmed, so none is trained
  ROMAP_ASSIGN_OR_RETURN(const auto service, service_options.Connect());
  StreamOptions options;
  options.pose_use = use_poses ? PoseUse::kGiven : PoseUse::kIgnore;
  options.max_training_s = 30;
  if (use_poses) {
    options.stride = (sequence.size() + kMaxMappedFrames - 1) / kMaxMappedFrames;
  } else {
    options.frame_count = kMaxMappedFrames;  // tracking needs consecutive frames
  }
  MapCollector collector;
  ROMAP_ASSIGN_OR_RETURN(const StreamResult result, StreamSequence(sequence, *service, options, collector));
  std::vector<Diagnostic> found = result.diagnostics;
  if (collector.statistics()) {
    const std::vector<Diagnostic>& server = collector.statistics()->diagnostics;
    found.insert(found.end(), server.begin(), server.end());
  }
  const MapCollector::Tracking& tracking = collector.tracking();
  if (!use_poses && tracking.tracked == 0) {
    found.push_back({.code = "camera_not_tracked",
                     .severity = Severity::kError,
                     .text = fmt::format("the camera cannot be tracked from the first {} frames: {}", collector.sent(),
                                         tracking.last_reason),
                     .advice = "start with sideways motion over a textured scene, send depth images, or give poses"});
  }
  if (!result.status.ok()) {
    found.push_back({.code = "mapping_failed", .severity = Severity::kError, .text = Message(result.status)});
  }
  return found;
}

void Append(std::vector<Diagnostic> more, std::vector<Diagnostic>* all) {
  for (Diagnostic& diagnostic : more) {
    const bool is_known =
        std::any_of(all->begin(), all->end(), [&](const auto& d) { return d.code == diagnostic.code; });
    if (!is_known) all->push_back(std::move(diagnostic));
  }
}

std::string Describe(const files::Sequence& sequence, const Contents& contents) {
  const CameraModel& camera = sequence.camera();
  std::string classes;
  for (const std::string& name : contents.classes) classes += (classes.empty() ? "" : ", ") + name;
  return fmt::format(
      "{}: {} frames of {}x{} px, {:.1f} s at {:.4g} frames per second\n"
      "masks in {} frames, poses for about {}, depth in {}; classes: {}\n",
      sequence.dir(), contents.frames, camera.width_px, camera.height_px,
      1e-9 * static_cast<double>(sequence.timestamp_ns(sequence.size() - 1) - sequence.timestamp_ns(0)), sequence.fps(),
      contents.with_masks, contents.with_poses, contents.with_depth, classes.empty() ? "none" : classes);
}

absl::Status Diagnose(const DoctorOptions& options) {
  files::SequenceOptions sequence_options = options.sequence;
  if (options.no_poses) sequence_options.poses.clear();
  ROMAP_ASSIGN_OR_RETURN(const files::Sequence sequence, files::Sequence::Open(options.sequence_dir, sequence_options));
  const std::vector<size_t> indices = Spread(sequence.size(), kMaxCheckedImages);
  const Contents contents = ContentsOf(sequence, indices);
  fmt::print("{}", Describe(sequence, contents));
  std::vector<Diagnostic> found = sequence.diagnostics();
  Append(doctor::CheckCamera(sequence.camera()), &found);
  std::vector<int64_t> stamps_ns;
  for (size_t i = 0; i < sequence.size(); ++i) stamps_ns.push_back(sequence.timestamp_ns(i));
  Append(doctor::CheckStamps(stamps_ns, sequence.fps()), &found);
  Append(CheckImages(sequence, indices), &found);
  ROMAP_ASSIGN_OR_RETURN(std::vector<Diagnostic> mapped, CheckByMapping(sequence, contents.with_poses > 0));
  Append(std::move(mapped), &found);
  std::stable_sort(found.begin(), found.end(),
                   [](const Diagnostic& a, const Diagnostic& b) { return a.severity > b.severity; });
  size_t errors = 0, warnings = 0;
  for (const Diagnostic& diagnostic : found) {
    fmt::print("{}\n", files::FormatDiagnostic(diagnostic));
    errors += diagnostic.severity == Severity::kError ? 1 : 0;
    warnings += diagnostic.severity == Severity::kWarning ? 1 : 0;
  }
  fmt::print("{} errors, {} warnings\n", errors, warnings);
  if (errors > 0) return InvalidArgument("{} cannot be mapped rightly as it is", options.sequence_dir);
  return absl::OkStatus();
}

}  // namespace

void AddDoctorCommand(CLI::App& app, Command* chosen) {
  auto options = std::make_shared<DoctorOptions>();
  CLI::App* command =
      app.add_subcommand("doctor",
                         "Check a recorded sequence before mapping: calibration, timestamps, poses, masks, "
                         "images and depth");
  command->add_option("sequence", options->sequence_dir, "Sequence folder")->required();
  command->add_flag("--depth", options->sequence.use_depth, "Also check the depth images");
  command->add_flag("--no-poses", options->no_poses, "Ignore the poses; check tracking from the images");
  command->add_option("--pose-file", options->sequence.poses, "File with the camera poses in the sequence folder")
      ->capture_default_str();
  command->add_option("--masks", options->sequence.masks, "File with the list of mask images in the sequence folder")
      ->capture_default_str();
  command->add_option("--detections", options->sequence.detections, "File with the class and score of each label")
      ->capture_default_str();
  command->callback([options, chosen] { *chosen = [options] { return Diagnose(*options); }; });
}

}  // namespace romap::cli
