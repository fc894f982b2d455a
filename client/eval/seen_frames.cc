#include "client/eval/seen_frames.h"

#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "client/files/sequence.h"
#include "common/label_png.h"
#include "common/parallel_for.h"
#include "common/status.h"

namespace romap::eval {
namespace {

constexpr double kMaxBehind_m = 0.02;

// Decodes an 8-bit or 16-bit single-channel PNG; empty if it is anything else.
cv::Mat DecodePng(std::string bytes) {
  try {
    cv::Mat image =
        cv::imdecode(cv::Mat(1, static_cast<int>(bytes.size()), CV_8UC1, bytes.data()), cv::IMREAD_UNCHANGED);
    return image.type() == CV_8UC1 || image.type() == CV_16UC1 ? image : cv::Mat();
  } catch (const cv::Exception&) {
    return {};
  }
}

int ValueAt(const cv::Mat& image, int u_px, int v_px) {
  return image.type() == CV_8UC1 ? image.at<uint8_t>(v_px, u_px) : image.at<uint16_t>(v_px, u_px);
}

}  // namespace

absl::StatusOr<SeenFrames> SeenFrames::Load(const std::string& sequence_dir, int every) {
  ROMAP_ASSIGN_OR_RETURN(const files::Sequence sequence,
                         files::Sequence::Open(sequence_dir, {.detections = "", .use_depth = true}));
  if (!sequence.objects())
    return FailedPrecondition("{}: objects.yaml is missing; it assigns mask labels to objects", sequence_dir);
  SeenFrames frames;
  frames.camera_ = sequence.camera();
  frames.depth_scale_m_ = sequence.depth_scale();
  for (const files::ObjectRecord& object : sequence.objects()->objects) frames.labels_[object.name] = object.id;
  int masks = 0;
  for (size_t k = 0; k < sequence.size(); ++k) {
    if (!sequence.has_mask(k) || masks++ % every != 0) continue;
    // Evaluation needs masks and depth of some frames only, so unreadable files are skipped.
    std::vector<files::UnreadableFile> unreadable;
    const absl::StatusOr<FrameInput> loaded = sequence.LoadReadable(k, &unreadable);
    if (!loaded.ok() || !unreadable.empty()) continue;
    const FrameInput& frame = *loaded;
    if (!frame.T_world_camera || frame.depth.empty()) continue;
    absl::StatusOr<cv::Mat> labels = DecodeLabelPng(frame.label_png);
    if (!labels.ok()) return InvalidArgument("{}: {}", sequence.paths(k).mask, Message(labels.status()));
    View view{frame.T_world_camera->Inverse(), *std::move(labels), DecodePng(frame.depth)};
    const cv::Size size(frames.camera_.width_px, frames.camera_.height_px);
    if (view.labels.size() != size || view.depth.size() != size) {
      return InvalidArgument("{}: mask or depth at {:.6f} s is not a single-channel PNG of {} x {} pixels",
                             sequence_dir, static_cast<double>(frame.timestamp_ns) * 1e-9, size.width, size.height);
    }
    frames.views_.push_back(std::move(view));
  }
  if (frames.views_.empty()) return FailedPrecondition("{}: no frame has a mask, depth and a pose", sequence_dir);
  return frames;
}

std::optional<int64_t> SeenFrames::LabelOf(const std::string& object_name) const {
  const auto found = labels_.find(object_name);
  return found == labels_.end() ? std::nullopt : std::optional(found->second);
}

bool SeenFrames::SeenIn(const View& view, const Eigen::Vector3d& p_world, int64_t label) const {
  const Eigen::Vector3d p_camera = view.T_camera_world * p_world;
  if (p_camera.z() <= 1e-6) return false;
  const Eigen::Vector2d pixel_px = camera_.Project(p_camera);
  const double u_px = std::nearbyint(pixel_px.x());
  const double v_px = std::nearbyint(pixel_px.y());
  if (!(u_px >= 0 && v_px >= 0 && u_px < camera_.width_px && v_px < camera_.height_px)) return false;
  const int u = static_cast<int>(u_px), v = static_cast<int>(v_px);
  const double depth_m = depth_scale_m_ * ValueAt(view.depth, u, v);
  return ValueAt(view.labels, u, v) == label && depth_m > 0 && p_camera.z() <= depth_m + kMaxBehind_m;
}

std::vector<bool> SeenFrames::Seen(const Points& points, int64_t label) const {
  std::vector<char> seen(points.size());  // not vector<bool>: its elements share bytes, which would be a data race
  ParallelFor(points.size(), [&](size_t k) {
    for (const View& view : views_) {
      if (SeenIn(view, points[k], label)) {
        seen[k] = 1;
        return;
      }
    }
  });
  return {seen.begin(), seen.end()};
}

}  // namespace romap::eval
