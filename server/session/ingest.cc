#include "server/session/ingest.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <set>

#include "common/status.h"
#include "common/utf8.h"
#include "server/session/encoded_image.h"

namespace romap {
namespace {

constexpr size_t kMaxClassNameBytes = 100;
// Farther from the origin single-precision geometry falls apart.
constexpr double kFarthest_mu = 1e6;

absl::Status CheckPose(const FrameInput& input) {
  if (input.T_world_camera && !input.T_world_camera->IsFinite()) {
    return InvalidArgument("T_world_camera has a number that is not finite");
  }
  if (input.T_world_camera && input.T_world_camera->translation().norm() > kFarthest_mu) {
    return InvalidArgument("T_world_camera lies {:.3g} map units from the origin, at most {:.0e} are allowed",
                           input.T_world_camera->translation().norm(), kFarthest_mu);
  }
  if (input.gravity_camera) {
    const double norm = input.gravity_camera->norm();
    if (!std::isfinite(norm) || norm < 1e-9) return InvalidArgument("gravity must be a finite vector longer than 0");
  }
  return absl::OkStatus();
}

absl::Status CheckInstances(const std::vector<Instance>& instances) {
  std::set<uint32_t> seen;
  for (const Instance& instance : instances) {
    if (instance.label == 0 || instance.label > 65535) {
      return InvalidArgument("instance label {} must lie in 1..65535", instance.label);
    }
    if (!seen.insert(instance.label).second)
      return InvalidArgument("instance label {} is listed twice", instance.label);
    if (instance.class_name.size() > kMaxClassNameBytes || !IsUtf8(instance.class_name)) {
      return InvalidArgument("class name of label {} must be UTF-8 of at most {} bytes", instance.label,
                             kMaxClassNameBytes);
    }
    if (!(instance.score >= 0 && instance.score <= 1)) {
      return InvalidArgument("score {} of label {} must lie in 0..1", instance.score, instance.label);
    }
  }
  return absl::OkStatus();
}

// Every label in the mask gets an entry, so that later stages need not ask whether one is listed.
void ListAllLabels(Frame& frame) {
  std::vector<bool> listed(65536, false);
  listed[0] = true;
  for (const Instance& instance : frame.instances) listed[instance.label] = true;
  for (int y = 0; y < frame.labels.rows; ++y) {
    const auto* row = frame.labels.ptr<uint16_t>(y);
    for (int x = 0; x < frame.labels.cols; ++x) {
      if (listed[row[x]]) continue;
      listed[row[x]] = true;
      frame.instances.push_back({.label = row[x], .class_name = "object", .score = 1.0, .track_id = std::nullopt});
    }
  }
}

}  // namespace

Ingest::Ingest(const CameraModel& camera) : camera_(camera) {
  if (camera_.HasDistortion()) maps_ = MakeUndistortionMaps(camera_);
}

absl::Status Ingest::CheckOrder(const FrameInput& input) const {
  if (!any_accepted_) return absl::OkStatus();
  if (input.frame_id <= last_frame_id_) {
    return InvalidArgument("frame id does not grow: {} after {}", input.frame_id, last_frame_id_);
  }
  if (input.timestamp_ns <= last_timestamp_ns_) {
    return InvalidArgument("timestamp goes back: {} ns after {} ns", input.timestamp_ns, last_timestamp_ns_);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::shared_ptr<const Frame>> Ingest::Accept(const FrameInput& input) {
  ROMAP_RETURN_IF_ERROR(CheckOrder(input));
  ROMAP_RETURN_IF_ERROR(CheckPose(input));
  ROMAP_RETURN_IF_ERROR(CheckInstances(input.instances));

  auto frame = std::make_shared<Frame>();
  frame->frame_id = input.frame_id;
  frame->timestamp_ns = input.timestamp_ns;
  frame->camera = camera_.Pinhole();
  frame->instances = input.instances;
  frame->T_world_camera = input.T_world_camera;
  if (input.gravity_camera) frame->gravity_camera = input.gravity_camera->normalized();
  ROMAP_ASSIGN_OR_RETURN(frame->image_bgr, DecodeColorImage(input, camera_));
  ROMAP_ASSIGN_OR_RETURN(frame->labels, DecodeLabels(input, camera_));
  ROMAP_ASSIGN_OR_RETURN(frame->depth_mu, DecodeDepth(input, camera_));
  frame->has_masks = !frame->labels.empty();
  if (camera_.HasDistortion()) Undistort(*frame);
  if (frame->has_masks) ListAllLabels(*frame);

  any_accepted_ = true;
  last_frame_id_ = input.frame_id;
  last_timestamp_ns_ = input.timestamp_ns;
  return std::shared_ptr<const Frame>(std::move(frame));
}

void Ingest::Undistort(Frame& frame) const {
  cv::cvtColor(frame.image_bgr, frame.source_grey, cv::COLOR_BGR2GRAY);
  frame.source_camera = camera_;
  // Labels and depth must not be blended; what comes from outside the image is black, unlabelled and without depth.
  const auto remap = [&](cv::Mat& image, int interpolation) {
    if (image.empty()) return;
    cv::Mat undistorted;
    cv::remap(image, undistorted, maps_.xy, maps_.fraction, interpolation, cv::BORDER_CONSTANT);
    image = undistorted;
  };
  remap(frame.image_bgr, cv::INTER_LINEAR);
  remap(frame.labels, cv::INTER_NEAREST);
  remap(frame.depth_mu, cv::INTER_NEAREST);
}

}  // namespace romap
