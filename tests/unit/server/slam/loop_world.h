#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "common/angles.h"
#include "server/slam/place_recognizer.h"
#include "server/slam/slam_map.h"
#include "tests/unit/server/slam/random_descriptor.h"

namespace romap::slam {

// The map of a camera that turns in the middle of a round room, with one keyframe every 12 degrees. The map does not
// know when the camera comes back to a wall: it holds points seen again after a round as new points. Optionally, it has
// drifted, and opposite walls look alike.
class LoopWorld {
 public:
  static constexpr int kKeyframesPerRound = 30;

  struct Drift {
    double rotation_deg = 0;  // about z, per keyframe
    double shift_mu = 0;      // along x, per keyframe
  };

  struct Options {
    bool opposite_walls_look_alike = false;
    uint64_t ids_used = 0;              // by other maps of the room
    int first = 0;                      // number of the first keyframe along the round
    double alike_above_mu = -INFINITY;  // below this height, the walls look different than in other rooms
  };

  LoopWorld(int keyframes, Drift drift) : LoopWorld(keyframes, drift, Options{}) {}
  LoopWorld(int keyframes, Drift drift, const Options& options)
      : drift_(drift),
        first_(options.first),
        map_(SlamConfig{}, options.ids_used, options.ids_used),
        places_(SlamConfig{}, &map_) {
    MakeWall(options);
    for (int i = 0; i < keyframes; ++i) AddKeyframe(first_ + i);
  }

  SlamMap& map() { return map_; }
  const PlaceRecognizer& places() const { return places_; }
  const MapKeyframe& newest() { return map_.keyframes().rbegin()->second; }

  static SE3<World, Camera> TruePose(int i) {
    const double angle_rad = 2 * std::numbers::pi * i / kKeyframesPerRound;
    const Eigen::Vector3d forward(std::cos(angle_rad), std::sin(angle_rad), 0);
    Eigen::Matrix3d axes;
    axes << forward.y(), 0, forward.x(), -forward.x(), 0, forward.y(), 0, -1, 0;
    return {axes, Eigen::Vector3d(1.5 * forward)};
  }
  // Motion of the space around keyframe `i` by the drift.
  Sim3<World, World> DriftAt(int i) const {
    const Eigen::Quaterniond rotation(
        Eigen::AngleAxisd(i * drift_.rotation_deg * kRadPerDeg, Eigen::Vector3d::UnitZ()));
    return {1.0, rotation, Eigen::Vector3d(i * drift_.shift_mu, 0, 0)};
  }

 private:
  struct WallPoint {
    Eigen::Vector3d p_world;
    Descriptor descriptor{};
  };

  void MakeWall(const Options& options) {
    std::uniform_real_distribution<double> angle(0, std::numbers::pi), height(-2, 2), radius(5, 7);
    for (int i = 0; i < 900; ++i) {
      const double angle_rad = angle(random_);
      const Eigen::Vector3d p(radius(random_) * Eigen::Vector3d(std::cos(angle_rad), std::sin(angle_rad), 0));
      const Eigen::Vector3d up(0, 0, height(random_));
      wall_.push_back({p + up, RandomDescriptor(random_)});
      wall_.push_back(
          {-p + up, options.opposite_walls_look_alike ? wall_.back().descriptor : RandomDescriptor(random_)});
    }
    std::mt19937_64 other_random(8);
    for (WallPoint& point : wall_) {
      if (point.p_world.z() < options.alike_above_mu) point.descriptor = RandomDescriptor(other_random);
    }
  }

  void AddKeyframe(int i) {
    Frame frame;
    frame.frame_id = static_cast<uint64_t>(i + 1);
    frame.camera = {.width_px = 640, .height_px = 480, .fx_px = 500, .fy_px = 500, .cx_px = 319.5, .cy_px = 239.5};
    const SE3<Camera, World> T_camera_world = TruePose(i).Inverse();
    std::vector<Feature> features;
    std::vector<size_t> wall_points;
    std::normal_distribution<float> noise_px(0, 0.3F);
    for (size_t k = 0; k < wall_.size(); ++k) {
      const Eigen::Vector3d p_camera = T_camera_world * wall_[k].p_world;
      if (p_camera.z() < 0.5) continue;
      const Eigen::Vector2d pixel_px = frame.camera.Project(p_camera);
      if (pixel_px.x() < 0 || pixel_px.y() < 0 || pixel_px.x() > 639 || pixel_px.y() > 479) continue;
      const Eigen::Vector2f noisy_px = pixel_px.cast<float>() + Eigen::Vector2f(noise_px(random_), noise_px(random_));
      features.push_back({.pixel_px = noisy_px, .descriptor = wall_[k].descriptor});
      wall_points.push_back(k);
    }
    const Sim3<World, World> drift = DriftAt(i);
    MapKeyframe& keyframe = map_.AddKeyframe(MakeFrameFeatures(frame, features), drift.Moved(TruePose(i)));
    keyframe.parent = i == first_ ? KeyframeId{} : KeyframeId{keyframe.id.value - 1};
    for (size_t f = 0; f < wall_points.size(); ++f) Observe(i, wall_points[f], static_cast<int>(f), drift, keyframe);
    places_.Add(keyframe);
  }

  // A point that was not seen for some keyframes is not recognized, and becomes a new point.
  void Observe(int i, size_t wall_point, int feature, const Sim3<World, World>& drift, MapKeyframe& keyframe) {
    Track& track = tracks_[wall_point];
    if (!track.id || i - track.last_keyframe > 3) {
      track.id = map_.AddPoint(drift * wall_[wall_point].p_world).point.id;
    }
    track.last_keyframe = i;
    PointTrack& point = *map_.FindPoint(track.id);
    map_.AddObservation(point, keyframe, feature);
    map_.Refresh(point);
  }

  struct Track {
    MapPointId id = {};
    int last_keyframe = 0;
  };

  const Drift drift_;
  const int first_;
  std::mt19937_64 random_{7};
  std::vector<WallPoint> wall_;
  SlamMap map_;
  PlaceRecognizer places_;
  std::map<size_t, Track> tracks_;
};

}  // namespace romap::slam
