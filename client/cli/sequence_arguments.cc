#include "client/cli/sequence_arguments.h"

#include <CLI/CLI.hpp>
#include <map>

#include "client/files/pose_convention.h"
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

void SequenceArguments::AddTo(CLI::App& app) {
  app.add_option("sequence", dir, "Sequence folder")->required();
  app.add_option("--poses", poses,
                 "Use of the camera poses of the sequence: given (exact), prior (initial values, corrected by "
                 "tracking) or none (the camera is tracked from the images only)")
      ->transform(CLI::CheckedTransformer(kPoseUses))
      ->option_text("given|prior|none [given]");
  app.add_option("--pose-file", file_options.poses, "File with the camera poses in the sequence folder (TUM format)")
      ->capture_default_str();
  app.add_option("--pose-convention", conventions,
                 "Convention of the poses, if it is not camera to world with x right, y down, z forward: opengl (y up, "
                 "z backward), world_to_camera, wxyz (quaternions with w first); several are separated by commas")
      ->option_text("NAME,... [opencv]");
  app.add_option("--pose-offset", pose_offset,
                 "Pose of the camera on the body, if the poses are those of a body that carries the camera")
      ->option_text("\"tx ty tz qx qy qz qw\"");
  app.add_option("--up", up, "Up in the world of the poses; auto: estimated from gravity or the images")
      ->check(CLI::IsMember({"x", "-x", "y", "-y", "z", "-z", "auto"}))
      ->option_text("x|-x|y|-y|z|-z|auto [z]");
  app.add_option("--readout-ms", readout_ms,
                 "Rolling shutter: the time from the first to the last row of an image [ms]; 0 = global shutter")
      ->check(CLI::Range(0.0, 1000.0))
      ->option_text("MS [readout_s of camera.yaml]");
  app.add_option("--masks", file_options.masks, "File with the list of mask images in the sequence folder")
      ->capture_default_str();
  app.add_option("--detections", file_options.detections,
                 "File with the class and score of each label in the sequence folder")
      ->capture_default_str();
  app.add_flag("--depth", file_options.use_depth, "Also use the depth images");
}

absl::StatusOr<files::SequenceOptions> SequenceArguments::FileOptions() const {
  files::SequenceOptions options = file_options;
  for (const std::string& names : conventions) {
    ROMAP_RETURN_IF_ERROR(files::ParseConvention(names, &options.convention));
  }
  if (!pose_offset.empty()) {
    ROMAP_ASSIGN_OR_RETURN(options.convention.offset, files::ParsePoseOffset(pose_offset));
  }
  if (poses == PoseUse::kIgnore) options.poses.clear();
  if (readout_ms >= 0) options.readout_s = 1e-3 * readout_ms;
  return options;
}

void SequenceArguments::SetPoseUse(StreamOptions* stream) const {
  stream->pose_use = poses;
  stream->estimate_up = up == "auto";
  if (!up.empty() && up != "auto") stream->up_world = AxisOf(up);
}

}  // namespace romap::cli
