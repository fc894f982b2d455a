#include "client/bench/true_views.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "server/session/ingest.h"

namespace romap::bench {
namespace {

constexpr int kMinPixels = 100;

// The crop around the mask and the projected cuboid, enlarged by half. Empty if a corner is behind the camera.
cv::Rect Crop(const Frame& frame, const files::ObjectRecord& object, const cv::Mat& is_object) {
  const SE3<Camera, Object> T_camera_object = frame.T_world_camera->Inverse() * object.T_world_object;
  std::vector<cv::Point2f> corners;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
    const Eigen::Vector3d p = T_camera_object * (1.5 * sign.cwiseProduct(object.half_extents));
    if (p.z() <= 0) return {};
    const Eigen::Vector2d pixel = frame.camera.Project(p);
    corners.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
  }
  const cv::Rect image(0, 0, frame.camera.width_px, frame.camera.height_px);
  return (cv::boundingRect(corners) | cv::boundingRect(is_object)) & image;
}

absl::Status CheckLabels(const files::Sequence& sequence, const FrameInput& input) {
  for (const files::ObjectRecord& object : sequence.objects()->objects) {
    const auto instance = std::ranges::find(input.instances, static_cast<uint32_t>(object.id), &Instance::label);
    if (instance != input.instances.end() && instance->class_name != object.class_name) {
      return InvalidArgument(
          "{}: label {} of frame {} has class {}, but {} in objects.yaml; labels must be the ids of objects.yaml",
          sequence.dir(), object.id, input.frame_id, instance->class_name, object.class_name);
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<TrueFrames> LoadTrueFrames(const files::Sequence& sequence, int every, int offset) {
  if (!sequence.objects())
    return FailedPrecondition("{}: objects.yaml with the true cuboids is missing", sequence.dir());
  session::Ingest ingest(sequence.camera(), /*max_mask_delay_s=*/0);
  TrueFrames frames;
  for (size_t i = static_cast<size_t>(offset); i < sequence.size(); i += static_cast<size_t>(every)) {
    if (!sequence.has_mask(i)) continue;
    ROMAP_ASSIGN_OR_RETURN(const FrameInput input, sequence.Load(i));
    if (!input.T_world_camera) continue;
    ROMAP_RETURN_IF_ERROR(CheckLabels(sequence, input));
    ROMAP_ASSIGN_OR_RETURN(std::shared_ptr<const Frame> frame, ingest.Accept(input));
    frames.push_back(std::move(frame));
  }
  if (frames.empty()) return FailedPrecondition("{}: no frame has both a mask and a pose", sequence.dir());
  return frames;
}

std::optional<ObjectView> MakeTrueView(const Frame& frame, const files::ObjectRecord& object, bool with_depth) {
  const cv::Mat is_object = frame.labels == static_cast<int>(object.id);
  if (cv::countNonZero(is_object) < kMinPixels) return std::nullopt;
  const cv::Rect roi = Crop(frame, object, is_object);
  if (roi.empty()) return std::nullopt;
  ObjectView view;
  view.object = ObjectId{static_cast<uint64_t>(object.id)};
  view.keyframe = KeyframeId{frame.frame_id};
  view.camera = frame.camera;
  view.T_world_camera = *frame.T_world_camera;
  view.roi_px = roi;
  view.color_bgr = frame.image_bgr(roi).clone();
  view.ray_kind = cv::Mat(roi.size(), CV_8UC1, cv::Scalar(static_cast<int>(RayKind::kOccluder)));
  view.ray_kind.setTo(static_cast<int>(RayKind::kObject), is_object(roi));
  view.ray_kind.setTo(static_cast<int>(RayKind::kBackground), frame.labels(roi) == 0);
  if (with_depth && !frame.depth_mu.empty()) view.depth_mu = frame.depth_mu(roi).clone();
  return view;
}

std::vector<ObjectView> MakeTrueViews(const TrueFrames& frames, const files::ObjectRecord& object, bool with_depth) {
  std::vector<ObjectView> views;
  for (const std::shared_ptr<const Frame>& frame : frames) {
    if (std::optional<ObjectView> view = MakeTrueView(*frame, object, with_depth)) views.push_back(std::move(*view));
  }
  return views;
}

}  // namespace romap::bench
