#include "server/slam/map_initialization.h"

#include <Eigen/Geometry>
#include <utility>
#include <vector>

#include "common/statistics.h"
#include "server/slam/map_adjustment.h"
#include "server/slam/point_maker.h"

namespace romap::slam {
namespace {

constexpr size_t kMinFirstPoints = 40;
constexpr double kMaxRms_px = 2;

std::optional<KeyframeId> InitializeFromTwoViews(const InitialViews& views, const MapStart& start,
                                                 const SlamConfig& config, SlamMap& map) {
  const SE3<World, Camera>& T_world_first = start.T_world_first;
  if (views.points.size() < kMinFirstPoints) return std::nullopt;
  std::vector<double> depths;
  for (const InitialViews::Point& point : views.points) depths.push_back(point.p_first.z());
  const double unit = start.depth_mu / Median(std::move(depths));
  MapKeyframe& first = map.AddKeyframe(views.first, T_world_first);
  MapKeyframe& second = map.AddKeyframe(views.second, T_world_first * ScaleTranslation(views.T_first_second, unit));
  second.parent = first.id;
  for (const InitialViews::Point& point : views.points) {
    PointTrack& track = map.AddPoint(T_world_first * Eigen::Vector3d(unit * point.p_first));
    map.AddObservation(track, first, point.first_feature);
    map.AddObservation(track, second, point.second_feature);
    map.Refresh(track);
  }
  MapProblem problem = GlobalProblem(map, config, /*find_lens=*/false);
  const BundleSummary summary = AdjustBundle(problem.bundle, {.max_iterations = 20, .dense = true});
  if (!summary.usable || summary.final_rms_px > kMaxRms_px) return std::nullopt;
  ApplyGlobal(problem, map);
  if (map.points().size() < kMinFirstPoints) return std::nullopt;
  return second.id;
}

}  // namespace

MapStart FirstMapStart(const InitialViews& views, const Frame& frame) {
  const bool has_depth = !views.second;
  Eigen::Vector3d up_camera = -Eigen::Vector3d::UnitY();
  if (frame.gravity_camera && has_depth) up_camera = -*frame.gravity_camera;
  return {.T_world_first = {RotationFromZTo(up_camera).conjugate(), Eigen::Vector3d::Zero()}};
}

MapStart WithGravity(MapStart start, const InitialViews& views, const Frame& frame) {
  const bool has_depth = !views.second;
  if (!frame.gravity_camera || !has_depth) return start;
  const SE3<World, Camera>& T = start.T_world_first;
  const Eigen::Vector3d up_world = T.rotation() * Eigen::Vector3d(-*frame.gravity_camera);
  const Eigen::Quaterniond upright = ShortestRotation(up_world, Eigen::Vector3d::UnitZ());
  start.T_world_first = {upright * T.rotation(), T.translation()};
  return start;
}

std::optional<KeyframeId> InitializeMap(const InitialViews& views, const MapStart& start, const SlamConfig& config,
                                        SlamMap& map) {
  const bool has_depth = !views.second;
  if (!has_depth) return InitializeFromTwoViews(views, start, config, map);
  MapKeyframe& first = map.AddKeyframe(views.first, start.T_world_first);
  PointMaker(config, &map).MakePointsByDepth(first);
  return first.id;
}

}  // namespace romap::slam
