#include "client/pictures/cuboids.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <utility>

#include "client/pictures/pictures.h"

namespace romap::pictures {
namespace {

// Edges connect the corners whose indices differ in one bit.
constexpr std::array<std::pair<int, int>, 12> kEdges = {
    {{0, 1}, {2, 3}, {4, 5}, {6, 7}, {0, 2}, {1, 3}, {4, 6}, {5, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}}};

// Clips a line to the image plus a margin, because distant end points would overflow in cv::line. False if nothing is
// left.
bool ClipToImage(const CameraModel& camera, cv::Point2d& from, cv::Point2d& to) {
  constexpr double kMargin_px = 16;
  double begin = 0;
  double end = 1;
  const cv::Point2d along = to - from;
  const auto clip = [&](double start, double step, double low, double high) {
    if (step == 0) return start >= low && start <= high;
    const double a = (low - start) / step;
    const double b = (high - start) / step;
    begin = std::max(begin, std::min(a, b));
    end = std::min(end, std::max(a, b));
    return begin <= end;
  };
  if (!clip(from.x, along.x, -kMargin_px, camera.width_px + kMargin_px)) return false;
  if (!clip(from.y, along.y, -kMargin_px, camera.height_px + kMargin_px)) return false;
  to = from + end * along;
  from = from + begin * along;
  return true;
}

// Projects an edge and clips it at the near plane and at the image. nullopt if nothing is left.
std::optional<std::pair<cv::Point2d, cv::Point2d>> ProjectEdge(const CameraModel& camera, Eigen::Vector3d from,
                                                               Eigen::Vector3d to, double near_mu) {
  if (from.z() < near_mu && to.z() < near_mu) return std::nullopt;
  if (from.z() < near_mu) from += (near_mu - from.z()) / (to.z() - from.z()) * (to - from);
  if (to.z() < near_mu) to += (near_mu - to.z()) / (from.z() - to.z()) * (from - to);
  const Eigen::Vector2d a = camera.Project(from);
  const Eigen::Vector2d b = camera.Project(to);
  cv::Point2d first(a.x(), a.y());
  cv::Point2d last(b.x(), b.y());
  if (!a.allFinite() || !b.allFinite() || !ClipToImage(camera, first, last)) return std::nullopt;
  return std::pair{first, last};
}

// Draws text on a filled rectangle with its lower left corner at `anchor`, shifted to stay inside the image.
void DrawLabel(cv::Mat& image_bgr, const std::string& text, cv::Point anchor, const cv::Scalar& color) {
  constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
  constexpr double kScale = 0.45;
  constexpr int kPad_px = 3;
  int below_px = 0;
  const cv::Size size = cv::getTextSize(text, kFont, kScale, 1, &below_px);
  const cv::Size plate(size.width + 2 * kPad_px, size.height + below_px + 2 * kPad_px);
  anchor.x = std::max(0, std::min(anchor.x, image_bgr.cols - plate.width));
  anchor.y = std::max(plate.height, std::min(anchor.y, image_bgr.rows));
  cv::rectangle(image_bgr, cv::Rect(anchor.x, anchor.y - plate.height, plate.width, plate.height), color, cv::FILLED);
  const double brightness = 0.114 * color[0] + 0.587 * color[1] + 0.299 * color[2];
  cv::putText(image_bgr, text, {anchor.x + kPad_px, anchor.y - kPad_px - below_px}, kFont, kScale,
              brightness > 140 ? cv::Scalar(0, 0, 0) : cv::Scalar(255, 255, 255), 1, cv::LINE_AA);
}

}  // namespace

std::vector<cv::Point> DrawCuboidEdges(cv::Mat& image_bgr, const CameraModel& camera,
                                       const SE3<World, Camera>& T_world_camera, const Cuboid& cuboid,
                                       const cv::Scalar& color_bgr) {
  const double near_mu = 1e-3 * cuboid.half_extents.norm();
  std::array<Eigen::Vector3d, 8> corners = CuboidCorners(cuboid);
  for (Eigen::Vector3d& corner : corners) corner = T_world_camera.Inverse() * corner;
  std::vector<cv::Point> drawn;
  for (const auto& [from, to] : kEdges) {
    const auto edge =
        ProjectEdge(camera, corners[static_cast<size_t>(from)], corners[static_cast<size_t>(to)], near_mu);
    if (!edge) continue;
    const cv::Point first(cvRound(edge->first.x), cvRound(edge->first.y));
    const cv::Point last(cvRound(edge->second.x), cvRound(edge->second.y));
    cv::line(image_bgr, first, last, color_bgr, 2, cv::LINE_AA);
    drawn.push_back(first);
    drawn.push_back(last);
  }
  return drawn;
}

cv::Scalar ObjectColorBgr(ObjectId id) {
  // The golden ratio spreads the hues of consecutive ids.
  const double hue = std::fmod(0.05 + 0.618033988749895 * static_cast<double>(id.value % 100000), 1.0);
  cv::Mat pixel(1, 1, CV_8UC3, cv::Scalar(180 * hue, 210, 245));
  cv::cvtColor(pixel, pixel, cv::COLOR_HSV2BGR);
  const cv::Vec3b bgr = pixel.at<cv::Vec3b>(0, 0);
  return {static_cast<double>(bgr[0]), static_cast<double>(bgr[1]), static_cast<double>(bgr[2])};
}

void DrawCuboids(cv::Mat& image_bgr, const CameraModel& camera, const SE3<World, Camera>& T_world_camera,
                 std::span<const ObjectUpdate> objects) {
  // Labels are drawn last, so that no wireframe crosses them.
  std::vector<std::pair<const ObjectUpdate*, cv::Point>> labels;
  for (const ObjectUpdate& object : objects) {
    if (object.state == ObjectState::kLost) continue;
    const std::vector<cv::Point> ends =
        DrawCuboidEdges(image_bgr, camera, T_world_camera, object.cuboid, ObjectColorBgr(object.id));
    if (ends.empty()) continue;
    const cv::Point top =
        *std::min_element(ends.begin(), ends.end(), [](const cv::Point& a, const cv::Point& b) { return a.y < b.y; });
    labels.emplace_back(&object, top);
  }
  for (const auto& [object, anchor] : labels) {
    DrawLabel(image_bgr, fmt::format("{} #{}", object->class_name, object->id.value), anchor,
              ObjectColorBgr(object->id));
  }
}

}  // namespace romap::pictures
