#include "tests/support/synthetic_world.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "common/angles.h"

namespace romap {
namespace {

Eigen::Matrix3d YawMatrix(double yaw_rad) {
  return Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

// Distance along `direction` (any length) to the solid, or infinity.
double IntersectSolid(const SyntheticObject& object, const Eigen::Matrix3d& R_object_scene,
                      const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d o = (R_object_scene * (origin - object.center)).cwiseQuotient(object.half_extents);
  const Eigen::Vector3d d = (R_object_scene * direction).cwiseQuotient(object.half_extents);
  constexpr double kMiss = std::numeric_limits<double>::infinity();
  if (object.shape == SyntheticShape::kEllipsoid) {
    const double a = d.squaredNorm();
    const double b = o.dot(d);
    const double c = o.squaredNorm() - 1;
    const double discriminant = b * b - a * c;
    if (discriminant < 0) return kMiss;
    const double t = (-b - std::sqrt(discriminant)) / a;
    return t > 0 ? t : kMiss;
  }
  double near = 0;
  double far = kMiss;
  for (int axis = 0; axis < 3; ++axis) {
    const double t0 = (-1 - o[axis]) / d[axis];
    const double t1 = (1 - o[axis]) / d[axis];
    near = std::max(near, std::min(t0, t1));
    far = std::min(far, std::max(t0, t1));
  }
  return near <= far && near > 0 ? near : kMiss;
}

// A random texture that gives every surface features: constant in cells of 0.02 map units, different for each object.
cv::Vec3b Texture(const Eigen::Vector3d& p, int object) {
  uint64_t hash = 0x9E3779B97F4A7C15ull * static_cast<uint64_t>(object + 2);
  for (int axis = 0; axis < 3; ++axis) {
    hash ^= static_cast<uint64_t>(static_cast<int64_t>(std::floor(p[axis] / 0.02 + 0.137)));
    hash *= 0xBF58476D1CE4E5B9ull;
    hash ^= hash >> 29;
  }
  const auto base = static_cast<uint8_t>(60 + (hash & 127));
  return {base, static_cast<uint8_t>(base + 15 * ((object + 1) % 4)), static_cast<uint8_t>(255 - base)};
}

Eigen::Vector3d RandomSurfacePoint(const SyntheticObject& object, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  Eigen::Vector3d p(uniform(random), uniform(random), uniform(random));
  if (object.shape == SyntheticShape::kEllipsoid) {
    while (p.norm() > 1 || p.norm() < 0.1) p = {uniform(random), uniform(random), uniform(random)};
    p.normalize();
  } else {
    const int axis = static_cast<int>(random() % 3);
    p[axis] = random() % 2 == 0 ? -1 : 1;
  }
  return object.center + YawMatrix(object.yaw_rad) * p.cwiseProduct(object.half_extents);
}

}  // namespace

std::vector<SyntheticObject> DefaultSyntheticObjects() {
  return {
      {"book", SyntheticShape::kBox, {-0.22, -0.05, 0.02}, {0.10, 0.07, 0.02}, 0.4},
      {"cup", SyntheticShape::kEllipsoid, {0.20, -0.12, 0.06}, {0.05, 0.05, 0.06}, 0.0},
      {"ball", SyntheticShape::kEllipsoid, {0.15, 0.22, 0.08}, {0.08, 0.08, 0.08}, 0.0},
      {"carton", SyntheticShape::kBox, {-0.10, 0.25, 0.09}, {0.06, 0.09, 0.09}, -0.3},
  };
}

SyntheticWorld::SyntheticWorld(SyntheticWorldOptions options) : options_(std::move(options)) {
  if (options_.objects.empty()) options_.objects = DefaultSyntheticObjects();
  camera_ = {.width_px = options_.width_px,
             .height_px = options_.height_px,
             .fx_px = options_.focal_px,
             .fy_px = options_.focal_px,
             .cx_px = (options_.width_px - 1) / 2.0,
             .cy_px = (options_.height_px - 1) / 2.0};
  R_world_scene_ = RotationFromZTo(options_.up_world.normalized()).toRotationMatrix();
  for (const SyntheticObject& object : options_.objects) {
    R_object_scene_.emplace_back(YawMatrix(object.yaw_rad).transpose());
    all_objects_.push_back(static_cast<int>(all_objects_.size()));
  }
  MakePoints();
}

std::mt19937_64 SyntheticWorld::Random(uint64_t stream, uint64_t index) const {
  std::seed_seq sequence{options_.seed, stream, index};
  return std::mt19937_64(sequence);
}

void SyntheticWorld::MakePoints() {
  std::mt19937_64 random = Random(1, 0);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0, 1);
  const auto add = [&](const Eigen::Vector3d& p_scene) {
    const Eigen::Vector3d surface = R_world_scene_ * p_scene;
    Eigen::Vector3d mapped = surface;
    for (int axis = 0; axis < 3; ++axis) mapped[axis] += options_.point_noise_mu * normal(random);
    // An outlier is displaced along the ray of a random camera, like a wrongly triangulated point.
    const double shift_mu = (uniform(random) - 0.5) * options_.orbit_radius_mu;
    const int viewpoint = static_cast<int>(random() % static_cast<uint64_t>(options_.frames));
    if (uniform(random) < options_.outlier_share) {
      mapped += shift_mu * (surface - CameraPose(viewpoint).translation()).normalized();
    }
    points_.push_back({surface, mapped});
  };
  for (size_t i = 0; i < options_.objects.size(); ++i) {
    const auto& textureless = options_.textureless;
    if (std::find(textureless.begin(), textureless.end(), static_cast<int>(i)) != textureless.end()) continue;
    for (int n = 0; n < options_.points_per_object; ++n) add(RandomSurfacePoint(options_.objects[i], random));
  }
  for (int n = 0; n < options_.points_on_table; ++n) add({uniform(random) - 0.5, uniform(random) - 0.5, 0});
}

SE3<World, Camera> SyntheticWorld::CameraPose(int index) const {
  const double share = options_.frames > 1 ? static_cast<double>(index) / options_.frames : 0;
  const double azimuth = (options_.start_azimuth_deg + share * options_.sweep_deg) * kRadPerDeg;
  const double elevation = options_.elevation_deg * kRadPerDeg;
  const Eigen::Vector3d direction(std::cos(azimuth) * std::cos(elevation), std::sin(azimuth) * std::cos(elevation),
                                  std::sin(elevation));
  const Eigen::Vector3d position = options_.orbit_radius_mu * direction;
  Eigen::Vector3d forward = -direction;
  for (const auto& [first, last] : options_.away_frames) {
    if (index >= first && index < last) forward = direction;
  }
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d R_scene_camera;
  R_scene_camera << right, forward.cross(right), forward;
  return {Eigen::Matrix3d(R_world_scene_ * R_scene_camera), R_world_scene_ * position};
}

SyntheticWorld::Hit SyntheticWorld::Cast(const Eigen::Vector3d& origin_scene, const Eigen::Vector3d& direction_scene,
                                         std::span<const int> candidates) const {
  Hit hit;
  double nearest = std::numeric_limits<double>::infinity();
  const double table = -origin_scene.z() / direction_scene.z();
  if (table > 0) nearest = table;
  for (const int i : candidates) {
    const auto k = static_cast<size_t>(i);
    const double t = IntersectSolid(options_.objects[k], R_object_scene_[k], origin_scene, direction_scene);
    if (t >= nearest) continue;
    nearest = t;
    hit.object = i;
  }
  if (!std::isfinite(nearest)) return hit;
  hit.depth_mu = nearest;  // directions have z = 1 in the camera, so the ray parameter is the z depth
  hit.point_scene = origin_scene + nearest * direction_scene;
  return hit;
}

cv::Rect SyntheticWorld::BoundsInImage(int object, const SE3<World, Camera>& T_world_camera) const {
  constexpr int kMargin_px = 2;  // for rounding
  const cv::Rect image(0, 0, options_.width_px, options_.height_px);
  std::vector<cv::Point2f> pixels;
  for (const Eigen::Vector3d& corner : CuboidCorners(TrueCuboid(object))) {
    const Eigen::Vector3d p_camera = T_world_camera.Inverse() * corner;
    if (p_camera.z() <= 0) return image;
    const Eigen::Vector2d pixel = camera_.Project(p_camera);
    pixels.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
  }
  const cv::Rect bounds = cv::boundingRect(pixels);
  return cv::Rect(bounds.tl() - cv::Point(kMargin_px, kMargin_px), bounds.br() + cv::Point(kMargin_px, kMargin_px)) &
         image;
}

void SyntheticWorld::RenderInto(const SE3<World, Camera>& T_world_camera, cv::Mat* image_bgr, cv::Mat* object_index,
                                cv::Mat* depth_mu) const {
  image_bgr->create(options_.height_px, options_.width_px, CV_8UC3);
  object_index->create(options_.height_px, options_.width_px, CV_16SC1);
  depth_mu->create(options_.height_px, options_.width_px, CV_32FC1);
  const Eigen::Matrix3d R_scene_camera = R_world_scene_.transpose() * T_world_camera.RotationMatrix();
  const Eigen::Vector3d origin = R_world_scene_.transpose() * T_world_camera.translation();
  std::vector<cv::Rect> bounds;  // per object
  for (const int i : all_objects_) bounds.push_back(BoundsInImage(i, T_world_camera));
  std::vector<int> candidates;
  for (int v = 0; v < options_.height_px; ++v) {
    for (int u = 0; u < options_.width_px; ++u) {
      candidates.clear();
      for (const int i : all_objects_) {
        if (bounds[static_cast<size_t>(i)].contains({u, v})) candidates.push_back(i);
      }
      const Hit hit = Cast(origin, R_scene_camera * camera_.Unproject(u, v), candidates);
      object_index->at<int16_t>(v, u) = static_cast<int16_t>(hit.object);
      depth_mu->at<float>(v, u) = static_cast<float>(hit.depth_mu);
      image_bgr->at<cv::Vec3b>(v, u) = hit.depth_mu > 0 ? Texture(hit.point_scene, hit.object) : cv::Vec3b(90, 90, 90);
    }
  }
}

void SyntheticWorld::DetectInto(int index, const cv::Mat& object_index, Frame* frame) const {
  std::mt19937_64 random = Random(2, static_cast<uint64_t>(index));
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<uint16_t> label(options_.objects.size());
  std::iota(label.begin(), label.end(), uint16_t{1});
  if (options_.permute_labels) std::shuffle(label.begin(), label.end(), random);
  frame->has_masks = true;
  frame->labels = cv::Mat::zeros(object_index.size(), CV_16UC1);
  for (size_t i = 0; i < label.size(); ++i) {
    cv::Mat mask = object_index == static_cast<int>(i);
    const int jitter = options_.mask_jitter_px;
    const int grow = jitter > 0 ? static_cast<int>(random() % static_cast<uint64_t>(2 * jitter + 1)) - jitter : 0;
    const cv::Mat kernel =
        cv::getStructuringElement(cv::MORPH_ELLIPSE, cv::Size(2 * std::abs(grow) + 1, 2 * std::abs(grow) + 1));
    if (grow > 0) cv::dilate(mask, mask, kernel);
    if (grow < 0) cv::erode(mask, mask, kernel);
    const bool dropped = uniform(random) < options_.dropped_mask_share;
    const bool wrong_class = uniform(random) < options_.wrong_class_share;
    if (dropped || cv::countNonZero(mask) == 0) continue;
    frame->labels.setTo(label[i], mask);
    frame->instances.push_back({.label = label[i],
                                .class_name = wrong_class ? "person" : options_.objects[i].class_name,
                                .score = 0.9,
                                .track_id = {}});
  }
  auto next_label = static_cast<uint16_t>(label.size() + 1);
  for (const auto& [frame_index, rectangle] : options_.false_detections) {
    if (frame_index != index) continue;
    frame->labels(rectangle & cv::Rect({}, frame->labels.size())).setTo(next_label);
    frame->instances.push_back(
        {.label = next_label++, .class_name = kFalseDetectionClass, .score = 0.5, .track_id = {}});
  }
}

TrackedFrame SyntheticWorld::MakeFrame(int index) const {
  TrackedFrame tracked;
  tracked.T_world_camera = CameraPose(index);
  tracked.up_world = options_.up_world.normalized();
  tracked.is_keyframe = IsKeyframe(index);
  auto frame = std::make_shared<Frame>();
  frame->frame_id = static_cast<uint64_t>(index) + 1;
  frame->timestamp_ns = index * 40'000'000ll;
  frame->camera = camera_;
  frame->T_world_camera = tracked.T_world_camera;
  cv::Mat object_index;
  cv::Mat depth_mu;
  RenderInto(tracked.T_world_camera, &frame->image_bgr, &object_index, &depth_mu);
  if (options_.with_depth) frame->depth_mu = depth_mu;
  DetectInto(index, object_index, frame.get());
  tracked.frame = std::move(frame);
  return tracked;
}

KeyframeView SyntheticWorld::MakeKeyframe(int index, const TrackedFrame& tracked) const {
  KeyframeView view;
  view.id = KeyframeId{static_cast<uint64_t>(index) + 1};
  view.frame = tracked.frame;
  view.T_world_camera = tracked.T_world_camera;
  view.up_world = tracked.up_world;
  std::mt19937_64 random = Random(3, static_cast<uint64_t>(index));
  std::normal_distribution<double> normal;
  const SE3<Camera, World> T_camera_world = tracked.T_world_camera.Inverse();
  const Eigen::Vector3d origin = R_world_scene_.transpose() * tracked.T_world_camera.translation();
  for (size_t i = 0; i < points_.size(); ++i) {
    const Eigen::Vector3d p_camera = T_camera_world * points_[i].surface_world;
    if (p_camera.z() <= 0.05) continue;
    Eigen::Vector2d pixel = camera_.Project(p_camera);
    pixel += options_.pixel_noise_px * Eigen::Vector2d(normal(random), normal(random));
    const auto u = static_cast<int>(std::lround(pixel.x()));
    const auto v = static_cast<int>(std::lround(pixel.y()));
    if (u < 0 || v < 0 || u >= options_.width_px || v >= options_.height_px) continue;
    const Eigen::Vector3d direction =
        R_world_scene_.transpose() * (points_[i].surface_world - tracked.T_world_camera.translation());
    // The point is at ray parameter 1; a surface with a clearly smaller parameter occludes it.
    if (Cast(origin, direction, all_objects_).depth_mu < 0.995) continue;
    const MapPointId id{i + 1};
    view.observations.push_back({id, pixel.cast<float>(), tracked.frame->labels.at<uint16_t>(v, u)});
    view.points.push_back({id, points_[i].mapped_world, 3, 0.2});
  }
  return view;
}

Cuboid SyntheticWorld::TrueCuboid(int object) const {
  const SyntheticObject& o = options_.objects[static_cast<size_t>(object)];
  return {.T_world_object = {Eigen::Matrix3d(R_world_scene_ * YawMatrix(o.yaw_rad)), R_world_scene_ * o.center},
          .half_extents = o.half_extents,
          .confidence = 1};
}

std::vector<Eigen::Vector3d> SyntheticWorld::SurfacePoints(int object, int count) const {
  std::mt19937_64 random = Random(4, static_cast<uint64_t>(object));
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < count; ++n) {
    points.push_back(R_world_scene_ * RandomSurfacePoint(options_.objects[static_cast<size_t>(object)], random));
  }
  return points;
}

double CuboidIou(const Cuboid& a, const Cuboid& b) {
  constexpr int kCells = 40;
  const SE3<Object, World> T_b_world = b.T_world_object.Inverse();
  int inside = 0;
  for (int i = 0; i < kCells * kCells * kCells; ++i) {
    const Eigen::Vector3d cell(i % kCells, i / kCells % kCells, i / (kCells * kCells));
    const Eigen::Vector3d unit = (cell.array() + 0.5) * (2.0 / kCells) - 1;
    const Eigen::Vector3d p_b = T_b_world * (a.T_world_object * unit.cwiseProduct(a.half_extents));
    inside += (p_b.cwiseAbs().array() <= b.half_extents.array()).all() ? 1 : 0;
  }
  const double volume_a = 8 * a.half_extents.prod();
  const double volume_b = 8 * b.half_extents.prod();
  const double intersection = volume_a * inside / (kCells * kCells * kCells);
  return intersection / (volume_a + volume_b - intersection);
}

double ContainedShare(const Cuboid& cuboid, std::span<const Eigen::Vector3d> points_world, double enlargement) {
  const SE3<Object, World> T_object_world = cuboid.T_world_object.Inverse();
  const Eigen::Vector3d half_extents = enlargement * cuboid.half_extents;
  const auto inside = std::count_if(points_world.begin(), points_world.end(), [&](const Eigen::Vector3d& p) {
    return ((T_object_world * p).cwiseAbs().array() <= half_extents.array()).all();
  });
  return points_world.empty() ? 0 : static_cast<double>(inside) / static_cast<double>(points_world.size());
}

}  // namespace romap
