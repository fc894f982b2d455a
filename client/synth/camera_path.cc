#include "client/synth/camera_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/synth/noise.h"
#include "common/angles.h"

namespace romap::synth {
namespace {

// A camera pose relative to its target.
struct Viewpoint {
  double azimuth_rad = 0;
  double elevation_rad = 0;
  double distance_m = 1;
  double roll_rad = 0;
  Eigen::Vector3d target_m = Eigen::Vector3d::Zero();
};

SE3<World, Camera> PoseOf(const Viewpoint& view) {
  const Eigen::Vector3d to_camera(std::cos(view.elevation_rad) * std::cos(view.azimuth_rad),
                                  std::cos(view.elevation_rad) * std::sin(view.azimuth_rad),
                                  std::sin(view.elevation_rad));
  const Eigen::Vector3d forward = -to_camera;
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d rotation;
  rotation << right, forward.cross(right), forward;
  rotation = rotation * Eigen::AngleAxisd(view.roll_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return {rotation, view.target_m + view.distance_m * to_camera};
}

Viewpoint OrbitView(const SynthOptions& options, double share, double start_rad, double distance_m) {
  const double circle_rad = options.arc_deg > 0 ? options.arc_deg * kRadPerDeg : 2 * std::numbers::pi;
  Viewpoint view;
  view.azimuth_rad = start_rad + circle_rad * options.rounds * share;
  view.elevation_rad = options.elevation_deg * kRadPerDeg;
  view.distance_m = distance_m;
  return view;
}

// Motion along an arc with slow variations of height, distance, aim and roll, and the tremor of a hand.
Viewpoint HandheldView(const SynthOptions& options, double share, double time_s, double start_rad, double sweep_rad,
                       double distance_m) {
  const auto seed = static_cast<uint32_t>(Scramble(options.seed));
  Viewpoint view;
  view.azimuth_rad = start_rad + 0.5 * sweep_rad * (1 - std::cos(std::numbers::pi * options.rounds * share)) +
                     0.05 * SmoothNoise(time_s, 3, seed + 10) + 0.002 * SmoothNoise(time_s, 0.4, seed + 20);
  const double motion = options.hand_motion;
  const double elevation_deg = options.elevation_deg + 13 * motion * SmoothNoise(time_s, 4.5, seed + 30);
  view.elevation_rad = std::clamp(elevation_deg, 5.0, 80.0) * kRadPerDeg + 0.002 * SmoothNoise(time_s, 0.4, seed + 40);
  view.distance_m = distance_m * std::max(0.97 + 0.14 * motion * SmoothNoise(time_s, 5, seed + 50), 0.5);
  view.roll_rad = 0.05 * motion * SmoothNoise(time_s, 2.5, seed + 60) + 0.002 * SmoothNoise(time_s, 0.3, seed + 70);
  view.target_m = 0.07 * motion * distance_m *
                  Eigen::Vector3d(SmoothNoise(time_s, 3, seed + 80), SmoothNoise(time_s, 3, seed + 90),
                                  SmoothNoise(time_s, 4, seed + 99));
  return view;
}

// A walk around the room on a circle that starts near the table. The camera faces the table at first and turns to the
// walls on the far side, where everything is visible only briefly. The plain wall is at +y.
Viewpoint TwoRoundsView(const SynthOptions& options, double share, double time_s, double room_half_m,
                        double table_height_m) {
  constexpr double kStart_rad = -10 * kRadPerDeg;  // the camera faces the plain wall after about a third of the path
  constexpr double kSwing_rad = 150 * kRadPerDeg;
  const auto seed = static_cast<uint32_t>(Scramble(options.seed));
  const double motion = options.hand_motion;
  const double turn_rad = 2 * 2 * std::numbers::pi * options.rounds * share;
  const double away = 0.5 * (1 - std::cos(turn_rad));  // 0 at the start of a round, 1 halfway
  const auto toward = [](double azimuth_rad) { return Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad)); };
  const Eigen::Vector2d sway_m =
      0.08 * motion * Eigen::Vector2d(SmoothNoise(time_s, 3, seed + 10), SmoothNoise(time_s, 3, seed + 20));
  const Eigen::Vector2d position_m =
      room_half_m * (0.48 * toward(kStart_rad + turn_rad) - 0.14 * toward(kStart_rad)) + sway_m;
  const double heading_rad = std::atan2(-position_m.y(), -position_m.x()) + kSwing_rad * away +
                             0.06 * motion * SmoothNoise(time_s, 2.5, seed + 30) +
                             0.002 * SmoothNoise(time_s, 0.4, seed + 40);
  Viewpoint view;
  view.distance_m = 0;
  view.target_m = {position_m.x(), position_m.y(),
                   table_height_m + 0.55 + 0.1 * motion * SmoothNoise(time_s, 4, seed + 50)};
  view.azimuth_rad = heading_rad + std::numbers::pi;
  view.elevation_rad = std::lerp(0.45, 0.1, away) + 0.06 * motion * SmoothNoise(time_s, 3.5, seed + 60) +
                       0.002 * SmoothNoise(time_s, 0.4, seed + 70);
  view.roll_rad = 0.05 * motion * SmoothNoise(time_s, 2.5, seed + 80) + 0.002 * SmoothNoise(time_s, 0.3, seed + 90);
  return view;
}

}  // namespace

CameraPath::CameraPath(const SynthOptions& options, const Scene& scene, const CameraModel& camera)
    : options_(options),
      room_half_m_(scene.room_half_m),
      table_height_m_(scene.table_height_m),
      rotating_frames_(options.path == PathKind::kRotation ? options.frames : options.rotation.first_frames),
      bursts_(options.rotation, rotating_frames_, options.seed),
      shake_(options) {
  double tallest_m = 0;
  for (const SceneObject& object : scene.objects) tallest_m = std::max(tallest_m, 2 * object.half_extents_m.z());
  const double half_view_rad =
      std::atan(0.5 * std::min(camera.width_px / camera.fx_px, camera.height_px / camera.fy_px));
  // The bounding sphere of all objects fills most of the smaller image side. The distance has a minimum for small
  // objects.
  const double radius_m = std::hypot(scene.layout_radius_m, 0.4 * tallest_m);
  distance_m_ = std::clamp(0.88 * radius_m / std::sin(half_view_rad), 0.4, 0.8 * scene.room_half_m);
  target_m_ = {0, 0, scene.table_height_m + 0.35 * tallest_m};

  Random random(options.seed, 3);
  start_rad_ = random.Uniform(-std::numbers::pi, std::numbers::pi);
  const double random_sweep_rad = random.Uniform(120, 200) * kRadPerDeg;
  sweep_rad_ = (options.arc_deg > 0 ? options.arc_deg * kRadPerDeg : random_sweep_rad) * (random.Chance(0.5) ? 1 : -1);
}

SE3<World, Camera> CameraPath::PoseOnPath(double time) const {
  const int frames = std::max(options_.frames - rotating_frames_, 1);
  const double time_s = time / options_.fps;
  if (options_.path == PathKind::kTwoRounds) {
    const double share = time / std::max(frames - 1, 1);  // the last frame is at the start
    return PoseOf(TwoRoundsView(options_, share, time_s, room_half_m_, table_height_m_));
  }
  const double share = time / frames;
  Viewpoint view = options_.path == PathKind::kHandheld
                       ? HandheldView(options_, share, time_s, start_rad_, sweep_rad_, distance_m_)
                       : OrbitView(options_, share, start_rad_, distance_m_);
  view.target_m += target_m_;
  return PoseOf(view);
}

SE3<World, Camera> CameraPath::Pose(int frame, double offset_frames) const {
  const double time = frame + offset_frames;
  const SE3<World, Camera> pose = PoseOnPath(std::max(time - rotating_frames_, 0.0));
  Eigen::Quaterniond rotation = pose.rotation() * bursts_.Rotation(time) * shake_.Rotation(time);
  if (options_.jump.frame > 0 && frame + 1 >= options_.jump.frame) {
    rotation = Eigen::AngleAxisd(options_.jump.turn_deg * kRadPerDeg, Eigen::Vector3d::UnitZ()) * rotation;
  }
  return {rotation, pose.translation() + bursts_.Sway_m(time) + shake_.Displacement_m(time)};
}

}  // namespace romap::synth
