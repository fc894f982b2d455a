#include "server/slam/tentative_points.h"

#include <cmath>
#include <iterator>
#include <utility>

#include "common/angles.h"
#include "server/slam/point_maker.h"
#include "server/slam/slam_map.h"

namespace romap::slam {
namespace {

constexpr size_t kRecordedFrames = 8;

}  // namespace

void TentativePoints::Record(std::shared_ptr<const FrameFeatures> frame, const SE3<World, Camera>& T_world_camera,
                             std::vector<MapPointId> points, double depth_mu) {
  frames_.push_back({std::move(frame), T_world_camera, std::move(points), depth_mu});
  if (frames_.size() > kRecordedFrames) frames_.pop_front();
}

void TentativePoints::Correct(const ScaledPose& before, const ScaledPose& after) {
  const double scale = after.scale / before.scale;
  for (RecordedFrame& frame : frames_) {
    frame.T_world_camera = after.Compose(before.Relative(frame.T_world_camera));
    frame.depth_mu *= scale;
  }
}

const TentativePoints::RecordedFrame* TentativePoints::FindPartner() const {
  const RecordedFrame& newest = frames_.back();
  const double min_baseline_mu = newest.depth_mu * std::tan(config_.min_parallax_deg * kRadPerDeg);
  for (auto it = std::next(frames_.rbegin()); it != frames_.rend(); ++it) {
    const double baseline_mu = (it->T_world_camera.translation() - newest.T_world_camera.translation()).norm();
    if (baseline_mu > min_baseline_mu) return &*it;
  }
  return nullptr;
}

std::vector<LocalPoint> TentativePoints::Make() const {
  if (frames_.empty()) return {};
  SlamMap map(config_);
  PointMaker maker(config_, &map);
  const RecordedFrame* partner = FindPartner();
  MapKeyframe* other = partner != nullptr ? &map.AddKeyframe(partner->features, partner->T_world_camera) : nullptr;
  MapKeyframe& newest = map.AddKeyframe(frames_.back().features, frames_.back().T_world_camera);
  // Their ids belong to another map. They only mark features that need no new point.
  newest.points = frames_.back().points;
  if (other != nullptr) maker.MakePointsByParallax(newest, {other});
  maker.MakePointsByDepth(newest);
  std::vector<LocalPoint> points;
  for (const auto& [id, track] : map.points()) {
    points.push_back(MakeLocalPoint(track));
    points.back().id = {};
  }
  return points;
}

}  // namespace romap::slam
