#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <set>

#include "client/cli/command.h"
#include "client/cli/format_diagnostic.h"
#include "client/cli/run_stream.h"
#include "client/cli/sequence_arguments.h"
#include "client/cli/service_options.h"
#include "client/doctor/camera_check.h"
#include "client/doctor/image_check.h"
#include "client/doctor/stamps_check.h"
#include "client/files/sequence.h"
#include "common/color_image.h"
#include "common/label_png.h"
#include "common/printable.h"
#include "common/status.h"
#include "server/masks/mask_image_check.h"
#include "server/masks/mask_thumbnail.h"

namespace romap::cli {
namespace {

// Enough to see what is wrong; mapping all frames would take minutes.
constexpr size_t kMaxMappedFrames = 150;
constexpr size_t kMaxCheckedImages = 100;
constexpr size_t kMaskCheckImages = 100;  // consecutive

// What evenly spaced frames of a recording contain.
struct Survey {
  size_t frames = 0, with_pose = 0;
  std::set<std::string> classes = {};
  std::vector<Diagnostic> diagnostics = {};  // about images and masks
};

// At most `count` frames, evenly spaced.
std::vector<size_t> Spread(size_t frames, size_t count) {
  std::vector<size_t> indices;
  const size_t step = std::max<size_t>(1, (frames + count - 1) / count);
  for (size_t i = 0; i < frames; i += step) indices.push_back(i);
  return indices;
}

// Whether the masks belong to their frames.
std::optional<Diagnostic> CheckMaskImages(const files::Sequence& sequence) {
  masks::MaskImageCheck check;
  SampleRange range;
  for (size_t index = 0; index < std::min(sequence.size(), kMaskCheckImages); ++index) {
    std::vector<files::UnreadableFile> unreadable;
    const auto frame = sequence.LoadReadable(index, &unreadable);
    if (!frame.ok()) continue;
    const absl::StatusOr<cv::Mat> decoded = DecodeColor(frame->image, &range);
    if (!decoded.ok()) continue;
    const cv::Mat& image = *decoded;
    const cv::Mat gray = masks::MakeGray(image);
    check.AddImage(frame->frame_id, frame->timestamp_ns, gray);
    const auto labels = DecodeLabelPng(frame->label_png);
    if (!labels.ok() || labels->size() != image.size()) continue;
    check.AddMasks(frame->frame_id, masks::MakeThumbnail(*labels, gray));
  }
  return check.Check();
}

Survey SurveyFrames(const files::Sequence& sequence) {
  Survey survey;
  doctor::ImageCheck check;
  SampleRange range;
  for (const size_t index : Spread(sequence.size(), kMaxCheckedImages)) {
    std::vector<files::UnreadableFile> unreadable;
    const auto frame = sequence.LoadReadable(index, &unreadable);
    if (!frame.ok()) continue;
    ++survey.frames;
    survey.with_pose += frame->T_world_camera ? 1 : 0;
    for (const Instance& instance : frame->instances) survey.classes.insert(instance.class_name);
    const absl::StatusOr<cv::Mat> image = DecodeColor(frame->image, &range);
    if (!image.ok()) continue;
    const auto labels =
        frame->label_png.empty() ? absl::StatusOr<cv::Mat>(cv::Mat()) : DecodeLabelPng(frame->label_png);
    check.Add(frame->frame_id, *image, labels.value_or(cv::Mat()));
  }
  survey.diagnostics = check.Diagnostics();
  if (const auto contradiction = CheckMaskImages(sequence)) survey.diagnostics.push_back(*contradiction);
  return survey;
}

// Maps some frames without training, and returns what the client and the server say about them.
absl::StatusOr<std::vector<Diagnostic>> CheckByMapping(const files::Sequence& sequence,
                                                       const SequenceArguments& arguments, bool use_poses) {
  ServiceOptions service_options;
  service_options.local = true;
  service_options.settings = {"objects.confirm_frames=1000"};  // no object is confirmed, so none is trained
  ROMAP_ASSIGN_OR_RETURN(const auto service, service_options.Connect());
  StreamOptions options;
  arguments.SetPoseUse(sequence, &options);
  options.max_training_s = 30;
  options.say_diagnostics = false;  // they are printed together, most severe first
  if (use_poses) {
    options.stride = (sequence.size() + kMaxMappedFrames - 1) / kMaxMappedFrames;
  } else {
    options.frame_count = kMaxMappedFrames;  // tracking needs consecutive frames
  }
  MapCollector collector;
  ROMAP_ASSIGN_OR_RETURN(const StreamResult result, StreamSequence(sequence, *service, options, collector));
  std::vector<Diagnostic> found = DiagnosticsOf(result, collector);
  // A consequence of the setting above.
  std::erase_if(found, [](const Diagnostic& diagnostic) { return diagnostic.code == "no_object_confirmed"; });
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

std::string Describe(const files::Sequence& sequence, const Survey& survey) {
  const CameraModel& camera = sequence.camera();
  size_t with_masks = 0, with_depth = 0;
  for (size_t i = 0; i < sequence.size(); ++i) {
    with_masks += sequence.has_mask(i) ? 1 : 0;
    with_depth += sequence.paths(i).depth.empty() ? 0 : 1;
  }
  return fmt::format(
      "{}: {} frames of {}x{} px, {:.1f} s at {:.4g} frames per second\n"
      "masks in {} frames, poses for about {}, depth in {}; classes: {}\n",
      sequence.dir(), sequence.size(), camera.width_px, camera.height_px,
      1e-9 * static_cast<double>(sequence.timestamp_ns(sequence.size() - 1) - sequence.timestamp_ns(0)), sequence.fps(),
      with_masks, survey.with_pose * sequence.size() / std::max<size_t>(1, survey.frames), with_depth,
      survey.classes.empty() ? "none" : Printable(fmt::format("{}", fmt::join(survey.classes, ", "))));
}

absl::Status Diagnose(const SequenceArguments& arguments) {
  ROMAP_ASSIGN_OR_RETURN(const files::Sequence sequence, arguments.Open());
  const Survey survey = SurveyFrames(sequence);
  fmt::print("{}", Describe(sequence, survey));
  std::vector<Diagnostic> found = sequence.diagnostics();
  Append(doctor::CheckCamera(sequence.camera()), &found);
  std::vector<int64_t> stamps_ns;
  for (size_t i = 0; i < sequence.size(); ++i) stamps_ns.push_back(sequence.timestamp_ns(i));
  Append(doctor::CheckStamps(stamps_ns, sequence.fps()), &found);
  Append(survey.diagnostics, &found);
  ROMAP_ASSIGN_OR_RETURN(std::vector<Diagnostic> mapped, CheckByMapping(sequence, arguments, survey.with_pose > 0));
  Append(std::move(mapped), &found);
  std::stable_sort(found.begin(), found.end(),
                   [](const Diagnostic& a, const Diagnostic& b) { return a.severity > b.severity; });
  size_t errors = 0, warnings = 0;
  for (const Diagnostic& diagnostic : found) {
    fmt::print("{}\n", FormatDiagnostic(diagnostic));
    errors += diagnostic.severity == Severity::kError ? 1 : 0;
    warnings += diagnostic.severity == Severity::kWarning ? 1 : 0;
  }
  fmt::print("{} errors, {} warnings\n", errors, warnings);
  if (errors > 0) return InvalidArgument("{} cannot be mapped correctly as it is", arguments.dir);
  return absl::OkStatus();
}

}  // namespace

void AddDoctorCommand(CLI::App& app, Command* chosen) {
  auto options = std::make_shared<SequenceArguments>();
  CLI::App* command =
      app.add_subcommand("doctor",
                         "Check a recorded sequence before mapping: calibration, timestamps, poses, masks, "
                         "images and depth");
  options->AddSourceTo(*command);
  options->AddUseTo(*command);
  command->callback([options, chosen] { *chosen = [options] { return Diagnose(*options); }; });
}

}  // namespace romap::cli
