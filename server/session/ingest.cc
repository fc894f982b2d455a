#include "server/session/ingest.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <set>
#include <utility>

#include "common/image_bytes.h"
#include "common/label_image.h"
#include "common/status.h"
#include "common/utf8.h"
#include "server/session/encoded_image.h"

namespace romap::session {
namespace {

constexpr size_t kMaxClassNameBytes = 100;
// World coordinates are in double precision, which resolves 1.5e-8 map units at this distance from the origin.
// Earth-centered coordinates in meters reach 6.4e6.
constexpr double kMaxDistance_mu = 1e8;

absl::Status CheckPose(const FrameInput& input) {
  if (input.T_world_camera && !input.T_world_camera->IsFinite()) {
    return InvalidArgument("t_world_camera: all numbers must be finite");
  }
  if (input.T_world_camera && input.T_world_camera->translation().norm() > kMaxDistance_mu) {
    return InvalidArgument("t_world_camera: must be within {:.0e} map units of the origin, is {:.3g} away",
                           kMaxDistance_mu, input.T_world_camera->translation().norm());
  }
  if (input.gravity_camera) {
    const double norm = input.gravity_camera->norm();
    if (!(norm >= 1e-9 && norm <= 1e9)) {
      return InvalidArgument("gravity_camera: must have a length in 1e-9..1e9, has {}", norm);
    }
  }
  return absl::OkStatus();
}

absl::Status CheckInstances(const std::vector<Instance>& instances) {
  std::set<uint32_t> seen;
  for (const Instance& instance : instances) {
    if (instance.label == 0 || instance.label >= kIgnoreLabel) {
      return InvalidArgument("masks: instance label must be in 1..65534, is {}", instance.label);
    }
    if (!seen.insert(instance.label).second) {
      return InvalidArgument("masks: instance label {} is listed twice", instance.label);
    }
    if (instance.class_name.size() > kMaxClassNameBytes || !IsUtf8(instance.class_name)) {
      return InvalidArgument("masks: class_name of label {} must be UTF-8 of at most {} bytes", instance.label,
                             kMaxClassNameBytes);
    }
    if (!(instance.score >= 0 && instance.score <= 1)) {
      return InvalidArgument("masks: score of label {} must be in 0..1, is {}", instance.label, instance.score);
    }
  }
  return absl::OkStatus();
}

// Whether the masks are an image with at most 8 bits per pixel.
bool HasEightBits(const EncodedMasks& masks) {
  if (masks.mask_encoding != MaskEncoding::kLabelPng) return false;
  const auto header = PngHeader(masks.label_png);
  return header && header->bits <= 8;
}

}  // namespace

Ingest::Ingest(const CameraModel& camera, double max_mask_delay_s, std::stop_token stop)
    : camera_(camera), max_mask_delay_s_(max_mask_delay_s), stop_(std::move(stop)) {}

bool Ingest::IsDuplicate(const SessionInput& input) const {
  if (const auto* masks = std::get_if<MasksInput>(&input)) {
    return masks->resent && newest_late_masks_ > 0 && masks->frame_id <= newest_late_masks_;
  }
  const FrameInput& frame = std::get<FrameInput>(input);
  return frame.resent && !accepted_.empty() && frame.frame_id <= accepted_.back().frame_id;
}

absl::Status Ingest::CheckOrder(const FrameInput& input) const {
  if (accepted_.empty()) return absl::OkStatus();
  const AcceptedFrame& last = accepted_.back();
  if (input.frame_id <= last.frame_id) {
    return InvalidArgument("frame_id must increase: got {} after {}", input.frame_id, last.frame_id);
  }
  if (input.timestamp_ns <= last.timestamp_ns) {
    return InvalidArgument("timestamp_ns must increase: got {} after {}", input.timestamp_ns, last.timestamp_ns);
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
  SampleRange range = range_;
  ROMAP_ASSIGN_OR_RETURN(frame->image_bgr, DecodeColorImage(input, camera_, &range, stop_));
  ROMAP_ASSIGN_OR_RETURN(frame->labels, DecodeLabels(input, camera_, stop_));
  ROMAP_ASSIGN_OR_RETURN(frame->depth_mu, DecodeDepth(input, camera_, stop_));
  range_ = range;
  depth_sentinels_.Remove(frame->frame_id, input.depth_scale_mu, &frame->depth_mu);
  frame->has_masks = !frame->labels.empty();
  if (camera_.HasDistortion()) {
    if (maps_.xy.empty()) maps_ = MakeUndistortionMaps(camera_);
    Undistort(*frame);
  }
  if (frame->has_masks) unlisted_labels_.Add(frame->frame_id, HasEightBits(input), frame->labels, &frame->instances);
  mask_interpreter_.Interpret(HasEightBits(input), frame.get());
  AddAccepted(*frame);
  return std::shared_ptr<const Frame>(std::move(frame));
}

void Ingest::AddAccepted(const Frame& frame) {
  accepted_.push_back({frame.frame_id, frame.timestamp_ns, frame.has_masks});
  const auto is_too_old = [&](const AcceptedFrame& old) {
    // Unsigned, because timestamps have an arbitrary epoch and the signed difference could overflow.
    const uint64_t behind_ns = static_cast<uint64_t>(frame.timestamp_ns) - static_cast<uint64_t>(old.timestamp_ns);
    return static_cast<double>(behind_ns) > 1e9 * max_mask_delay_s_;
  };
  while (is_too_old(accepted_.front())) {
    accepted_.pop_front();
    any_expired_ = true;
  }
}

absl::StatusOr<FrameMasks> Ingest::AcceptMasks(const MasksInput& input) {
  ROMAP_ASSIGN_OR_RETURN(AcceptedFrame* const frame, FindFrameWithoutMasks(input.frame_id));
  if (input.mask_encoding == MaskEncoding::kNone) return InvalidArgument("masks: missing");
  ROMAP_RETURN_IF_ERROR(CheckInstances(input.instances));
  FrameMasks masks{.frame_id = input.frame_id, .labels = {}, .instances = input.instances};
  ROMAP_ASSIGN_OR_RETURN(masks.labels, DecodeLabels(input, camera_, stop_));
  if (camera_.HasDistortion()) UndistortNearest(masks.labels);
  unlisted_labels_.Add(masks.frame_id, HasEightBits(input), masks.labels, &masks.instances);
  mask_interpreter_.Interpret(HasEightBits(input), &masks);
  frame->has_masks = true;
  newest_late_masks_ = std::max(newest_late_masks_, input.frame_id);
  return masks;
}

std::vector<Diagnostic> Ingest::Diagnostics() const {
  std::vector<Diagnostic> diagnostics = mask_interpreter_.Diagnostics();
  for (auto& found : {depth_sentinels_.diagnostic(), depth_sentinels_.CheckEmpty(), unlisted_labels_.Check()}) {
    if (found) diagnostics.push_back(*found);
  }
  return diagnostics;
}

absl::StatusOr<Ingest::AcceptedFrame*> Ingest::FindFrameWithoutMasks(uint64_t frame_id) {
  const auto found = std::lower_bound(accepted_.begin(), accepted_.end(), frame_id,
                                      [](const AcceptedFrame& frame, uint64_t id) { return frame.frame_id < id; });
  if (found == accepted_.begin() && any_expired_ && found->frame_id != frame_id) {
    return InvalidArgument(
        "masks: too late: frame {} is more than {} s (objects.max_mask_delay_s) older than the newest frame", frame_id,
        max_mask_delay_s_);
  }
  if (found == accepted_.end() || found->frame_id != frame_id) {
    return InvalidArgument("frame_id: no accepted frame has id {}", frame_id);
  }
  if (found->has_masks) return InvalidArgument("masks: frame {} already has masks", frame_id);
  return &*found;
}

void Ingest::Undistort(Frame& frame) const {
  cv::cvtColor(frame.image_bgr, frame.source_gray, cv::COLOR_BGR2GRAY);
  frame.source_camera = camera_;
  cv::Mat undistorted;
  cv::remap(frame.image_bgr, undistorted, maps_.xy, maps_.fraction, cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  frame.image_bgr = undistorted;
  UndistortNearest(frame.labels);
  UndistortNearest(frame.depth_mu);
}

// Nearest neighbor, because labels and depths must not be interpolated. Pixels from outside the image get 0.
void Ingest::UndistortNearest(cv::Mat& image) const {
  if (image.empty()) return;
  cv::Mat undistorted;
  cv::remap(image, undistorted, maps_.xy, maps_.fraction, cv::INTER_NEAREST, cv::BORDER_CONSTANT);
  image = undistorted;
}

}  // namespace romap::session
