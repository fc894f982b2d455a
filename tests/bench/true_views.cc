#include "tests/bench/true_views.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>

#include "common/status.h"

namespace romap {
namespace {

cv::Mat Decode(const std::string& bytes, int flags) {
  return cv::imdecode(cv::Mat(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data())), flags);
}

cv::Rect Crop(const TrueFrame& frame, const ObjectRecord& object, const cv::Mat& is_object) {
  const SE3<Camera, Object> T_camera_object = frame.T_world_camera.Inverse() * object.T_world_object;
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

}  // namespace

absl::StatusOr<std::vector<TrueFrame>> LoadTrueFrames(const Sequence& sequence, int offset, int every) {
  std::vector<TrueFrame> frames;
  for (size_t i = static_cast<size_t>(offset); i < sequence.size(); i += static_cast<size_t>(every)) {
    if (!sequence.has_mask(i)) continue;
    ROMAP_ASSIGN_OR_RETURN(const FrameInput input, sequence.Load(i));
    if (!input.T_world_camera) continue;
    TrueFrame frame{KeyframeId{i + 1},
                    sequence.camera(),
                    *input.T_world_camera,
                    Decode(input.image, cv::IMREAD_COLOR),
                    Decode(input.label_png, cv::IMREAD_UNCHANGED),
                    {}};
    frame.labels.convertTo(frame.labels, CV_16U);
    if (!input.depth.empty()) {
      Decode(input.depth, cv::IMREAD_UNCHANGED).convertTo(frame.depth_mu, CV_32F, input.depth_scale_mu);
    }
    frames.push_back(std::move(frame));
  }
  return frames;
}

std::optional<ObjectView> MakeTrueView(const TrueFrame& frame, const ObjectRecord& object) {
  const cv::Mat is_object = frame.labels == static_cast<int>(object.id);
  if (cv::countNonZero(is_object) < 100) return std::nullopt;
  const cv::Rect roi = Crop(frame, object, is_object);
  if (roi.empty()) return std::nullopt;
  ObjectView view;
  view.object = ObjectId{static_cast<uint64_t>(object.id)};
  view.keyframe = frame.id;
  view.camera = frame.camera;
  view.T_world_camera = frame.T_world_camera;
  view.roi_px = roi;
  view.color_bgr = frame.image_bgr(roi).clone();
  view.ray_kind = cv::Mat(roi.size(), CV_8UC1, cv::Scalar(static_cast<int>(RayKind::kOccluder)));
  view.ray_kind.setTo(static_cast<int>(RayKind::kObject), is_object(roi));
  view.ray_kind.setTo(static_cast<int>(RayKind::kBackground), frame.labels(roi) == 0);
  if (!frame.depth_mu.empty()) view.depth_mu = frame.depth_mu(roi).clone();
  return view;
}

}  // namespace romap
