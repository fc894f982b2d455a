#include "client/cli/sequence_arguments.h"

#include <CLI/CLI.hpp>
#include <map>

#include "client/files/pose_convention.h"
#include "client/importers/open_recording.h"
#include "common/status.h"

namespace romap::cli {
namespace {

const std::map<std::string, PoseUse> kPoseUses = {
    {"given", PoseUse::kGiven}, {"prior", PoseUse::kPrior}, {"none", PoseUse::kIgnore}};

// "x" to "-z".
Eigen::Vector3d AxisOf(const std::string& name) {
  const double sign = name.front() == '-' ? -1 : 1;
  return sign * Eigen::Vector3d::Unit(name.back() - 'x');
}

}  // namespace

void SequenceArguments::AddSourceTo(CLI::App& app) {
  app.add_option("sequence", dir,
                 "Recording: a sequence folder, a data set of another known layout, a folder of images, or a video")
      ->required();
  app.add_option("--fps", read.fps, "Frames per second, if the recording has no timestamps")
      ->check(CLI::PositiveNumber)
      ->option_text("HZ [30]");
  app.add_option("--every", read.every, "Use every N-th frame")->check(CLI::PositiveNumber)->option_text("N [1]");
  app.add_option("--focal", read.focal_px, "Focal length, instead of that of the calibration or a guess")
      ->check(CLI::PositiveNumber)
      ->option_text("PX");
  app.add_option("--pose-file", read.files.poses, "File with the camera poses in the sequence folder (TUM format)")
      ->capture_default_str();
  app.add_option("--pose-convention", conventions,
                 "Convention of the poses, if it is not camera to world with x right, y down, z forward: opengl (y up, "
                 "z backward), world_to_camera, wxyz (quaternions with w first); several are separated by commas")
      ->option_text("NAME,... [opencv]");
  app.add_option("--pose-offset", pose_offset,
                 "Pose of the camera on the body, if the poses are those of a body that carries the camera")
      ->option_text("\"tx ty tz qx qy qz qw\"");
  app.add_option("--readout-ms", readout_ms,
                 "Rolling shutter: the time from the first to the last row of an image [ms]; 0 = global shutter")
      ->check(CLI::Range(0.0, 1000.0))
      ->option_text("MS [readout_s of camera.yaml]");
  app.add_option("--masks", read.files.masks,
                 "File with the list of mask images in the sequence folder; or masks that are joined by file name: a "
                 "folder of label images, instance images or YOLO segmentations, or a COCO file")
      ->capture_default_str();
  app.add_option("--detections", read.files.detections,
                 "File with the class and score of each label in the sequence folder")
      ->capture_default_str();
}

void SequenceArguments::AddUseTo(CLI::App& app) {
  app.add_option("--poses", poses,
                 "Use of the camera poses of the sequence: given (exact), prior (initial values, corrected by "
                 "tracking) or none (the camera is tracked from the images only)")
      ->transform(CLI::CheckedTransformer(kPoseUses))
      ->option_text("given|prior|none [given]");
  app.add_option("--up", up, "Up in the world of the poses; auto: estimated from gravity or the images")
      ->check(CLI::IsMember(files::kWorldUps))
      ->option_text("x|-x|y|-y|z|-z|auto [that of the sequence, or z]");
  app.add_flag("--depth", read.files.use_depth, "Also use the depth images");
}

absl::StatusOr<files::Sequence> SequenceArguments::Open() const {
  importers::ReadOptions options = read;
  for (const std::string& names : conventions) {
    ROMAP_RETURN_IF_ERROR(files::ParseConvention(names, &options.files.convention));
  }
  if (!pose_offset.empty()) {
    ROMAP_ASSIGN_OR_RETURN(options.files.convention.offset, files::ParsePoseOffset(pose_offset));
  }
  if (poses == PoseUse::kIgnore) options.files.poses.clear();
  if (readout_ms >= 0) options.files.readout_s = 1e-3 * readout_ms;
  return importers::OpenRecording(dir, options);
}

void SequenceArguments::SetPoseUse(const files::Sequence& sequence, StreamOptions* stream) const {
  const std::string& direction = up.empty() ? sequence.world_up() : up;
  stream->pose_use = poses;
  stream->estimate_up = direction == "auto";
  if (!direction.empty() && direction != "auto") stream->up_world = AxisOf(direction);
}

}  // namespace romap::cli
