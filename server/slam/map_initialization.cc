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

std::optional<KeyframeId> InitializeFromTwoViews(const InitialViews& views, const SE3<World, Camera>& T_world_first,
                                                 const SlamConfig& config, SlamMap& map) {
  if (views.points.size() < kMinFirstPoints) return std::nullopt;
  std::vector<double> depths;
  for (const InitialViews::Point& point : views.points) depths.push_back(point.p_first.z());
  const double unit = 1 / Median(std::move(depths));
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

std::optional<KeyframeId> InitializeMap(const InitialViews& views, const Frame& frame, const SlamConfig& config,
                                        SlamMap& map) {
  const bool has_depth = !views.second;
  Eigen::Vector3d up_camera = -Eigen::Vector3d::UnitY();
  if (frame.gravity_camera && has_depth) up_camera = -*frame.gravity_camera;
  const SE3<World, Camera> T_world_first(RotationFromZTo(up_camera).conjugate(), Eigen::Vector3d::Zero());
  if (!has_depth) return InitializeFromTwoViews(views, T_world_first, config, map);
  MapKeyframe& first = map.AddKeyframe(views.first, T_world_first);
  PointMaker(config, &map).MakePointsByDepth(first);
  return first.id;
}

}  // namespace romap::slam
