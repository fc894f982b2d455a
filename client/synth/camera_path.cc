#include "client/synth/camera_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/synth/noise.h"

namespace romap::synth {
namespace {

constexpr double kPi = std::numbers::pi;

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

// A smooth random function of time with values of about -1..1 that varies over `period_s`.
double SmoothNoise(double time_s, double period_s, uint32_t seed) {
  const Eigen::Vector3f along(static_cast<float>(time_s), 0.37F, 0.71F);
  return FractalNoise(along, static_cast<float>(period_s), 2, 0.4F, 1e-6F, seed);
}

Viewpoint OrbitView(const SynthOptions& options, double share, double start_rad, double distance_m) {
  Viewpoint view;
  view.azimuth_rad = start_rad + 2 * kPi * options.rounds * share;
  view.elevation_rad = options.elevation_deg * kPi / 180;
  view.distance_m = distance_m;
  return view;
}

// Motion along an arc with slow variations of height, distance, aim and roll, and the tremor of a hand.
Viewpoint HandheldView(const SynthOptions& options, double share, double time_s, double start_rad, double sweep_rad,
                       double distance_m) {
  const auto seed = static_cast<uint32_t>(Scramble(options.seed));
  Viewpoint view;
  view.azimuth_rad = start_rad + 0.5 * sweep_rad * (1 - std::cos(kPi * options.rounds * share)) +
                     0.05 * SmoothNoise(time_s, 3, seed + 10) + 0.002 * SmoothNoise(time_s, 0.4, seed + 20);
  const double motion = options.hand_motion;
  const double elevation_deg = options.elevation_deg + 13 * motion * SmoothNoise(time_s, 4.5, seed + 30);
  view.elevation_rad = std::clamp(elevation_deg, 5.0, 80.0) * kPi / 180 + 0.002 * SmoothNoise(time_s, 0.4, seed + 40);
  view.distance_m = distance_m * std::max(0.97 + 0.14 * motion * SmoothNoise(time_s, 5, seed + 50), 0.5);
  view.roll_rad = 0.05 * motion * SmoothNoise(time_s, 2.5, seed + 60) + 0.002 * SmoothNoise(time_s, 0.3, seed + 70);
  view.target_m = 0.07 * motion * distance_m *
                  Eigen::Vector3d(SmoothNoise(time_s, 3, seed + 80), SmoothNoise(time_s, 3, seed + 90),
                                  SmoothNoise(time_s, 4, seed + 99));
  return view;
}

// A walk around the room on a circle that starts near the table. The camera faces the table at first and turns to the
// walls on the far side, where everything is visible only briefly. The plain wall is at +y.
Viewpoint TwoRoundsView(const SynthOptions& options, double share, double time_s, const Scene& scene) {
  constexpr double kStart_rad = -10 * kPi / 180;  // the camera faces the plain wall after about a third of the path
  constexpr double kSwing_rad = 150 * kPi / 180;
  const auto seed = static_cast<uint32_t>(Scramble(options.seed));
  const double motion = options.hand_motion;
  const double turn_rad = 2 * 2 * kPi * options.rounds * share;
  const double away = 0.5 * (1 - std::cos(turn_rad));  // 0 at the start of a round, 1 halfway
  const auto toward = [](double azimuth_rad) { return Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad)); };
  const Eigen::Vector2d sway_m =
      0.08 * motion * Eigen::Vector2d(SmoothNoise(time_s, 3, seed + 10), SmoothNoise(time_s, 3, seed + 20));
  const Eigen::Vector2d position_m =
      scene.room_half_m * (0.48 * toward(kStart_rad + turn_rad) - 0.14 * toward(kStart_rad)) + sway_m;
  const double heading_rad = std::atan2(-position_m.y(), -position_m.x()) + kSwing_rad * away +
                             0.06 * motion * SmoothNoise(time_s, 2.5, seed + 30) +
                             0.002 * SmoothNoise(time_s, 0.4, seed + 40);
  Viewpoint view;
  view.distance_m = 0;
  view.target_m = {position_m.x(), position_m.y(),
                   scene.table_height_m + 0.55 + 0.1 * motion * SmoothNoise(time_s, 4, seed + 50)};
  view.azimuth_rad = heading_rad + kPi;
  view.elevation_rad = std::lerp(0.45, 0.1, away) + 0.06 * motion * SmoothNoise(time_s, 3.5, seed + 60) +
                       0.002 * SmoothNoise(time_s, 0.4, seed + 70);
  view.roll_rad = 0.05 * motion * SmoothNoise(time_s, 2.5, seed + 80) + 0.002 * SmoothNoise(time_s, 0.3, seed + 90);
  return view;
}

}  // namespace

CameraModel SynthCamera(const SynthOptions& options) {
  CameraModel camera;
  camera.width_px = options.width_px;
  camera.height_px = options.height_px;
  switch (options.lens) {
    case SynthLens::kPinhole:
      camera.fx_px = 0.9 * options.width_px;
      break;
    case SynthLens::kRadialTangential:
      camera.fx_px = 0.6 * options.width_px;
      camera.distortion = {-0.28, 0.07, 4e-4, 2e-4, 0};
      break;
    case SynthLens::kFisheye:
      camera.fx_px = 0.45 * options.width_px;
      camera.lens = LensModel::kFisheye;
      camera.distortion = {3.4e-3, 7e-4, -2e-3, 2e-4, 0};
      break;
  }
  camera.fy_px = camera.fx_px;
  camera.cx_px = 0.5 * (options.width_px - 1);
  camera.cy_px = 0.5 * (options.height_px - 1);
  return camera;
}

std::vector<SE3<World, Camera>> MakeCameraPath(const SynthOptions& options, const Scene& scene,
                                               const CameraModel& camera) {
  double tallest_m = 0;
  for (const SceneObject& object : scene.objects) tallest_m = std::max(tallest_m, 2 * object.half_extents_m.z());
  const double half_side_px = 0.5 * std::min(camera.width_px, camera.height_px);
  const double half_view_rad = std::atan(half_side_px / camera.fx_px);
  // The bounding sphere of all objects fills most of the smaller image side. The distance has a minimum for small
  // objects.
  const double radius_m = std::hypot(scene.layout_radius_m, 0.4 * tallest_m);
  const double distance_m = std::clamp(0.88 * radius_m / std::sin(half_view_rad), 0.4, 0.8 * scene.room_half_m);
  const Eigen::Vector3d target_m(0, 0, scene.table_height_m + 0.35 * tallest_m);

  Random random(options.seed, 3);
  const double start_rad = random.Uniform(-kPi, kPi);
  const double sweep_rad = random.Uniform(120, 200) * kPi / 180 * (random.Chance(0.5) ? 1 : -1);
  std::vector<SE3<World, Camera>> path;
  path.reserve(static_cast<size_t>(options.frames));
  for (int i = 0; i < options.frames; ++i) {
    if (options.path == PathKind::kTwoRounds) {
      const double path_share =
          static_cast<double>(i) / std::max(options.frames - 1, 1);  // the last frame is at the start
      path.push_back(PoseOf(TwoRoundsView(options, path_share, i / options.fps, scene)));
      continue;
    }
    const double share = static_cast<double>(i) / options.frames;
    Viewpoint view = options.path == PathKind::kOrbit
                         ? OrbitView(options, share, start_rad, distance_m)
                         : HandheldView(options, share, i / options.fps, start_rad, sweep_rad, distance_m);
    view.target_m += target_m;
    path.push_back(PoseOf(view));
  }
  return path;
}

}  // namespace romap::synth
