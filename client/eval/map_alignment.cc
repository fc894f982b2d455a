#include "client/eval/map_alignment.h"

#include <vector>

#include "common/angles.h"
#include "common/statistics.h"

namespace romap::eval {
namespace {

// The world of an estimated trajectory has an arbitrary origin, so it agrees to this degree only by chance.
constexpr double kSameWorldPosition_m = 0.01;
constexpr double kSameWorldRotation_rad = 1 * kRadPerDeg;
constexpr double kMaxDt_s = 0.02;

}  // namespace

bool HaveSameWorld(std::span<const files::StampedPose> estimated, std::span<const files::StampedPose> ground_truth,
                   double max_dt_s) {
  const absl::StatusOr<PoseAssociation> pairs = AssociatePoses(estimated, ground_truth, max_dt_s, 1);
  if (!pairs.ok()) return false;
  std::vector<double> distances_m, angles_rad;
  for (const auto& [i, j] : *pairs) {
    const SE3<World, Camera>& pose = estimated[i].T_world_camera;
    const SE3<World, Camera>& truth = ground_truth[j].T_world_camera;
    distances_m.push_back((pose.translation() - truth.translation()).norm());
    angles_rad.push_back(pose.rotation().angularDistance(truth.rotation()));
  }
  return Median(std::move(distances_m)) < kSameWorldPosition_m &&
         Median(std::move(angles_rad)) < kSameWorldRotation_rad;
}

MapAlignment DetermineAlignment(const RunRecord& record, const std::string& out_dir, const std::string& sequence_dir) {
  if (record.poses == "given") return {Alignment::kNone, "the run used the given camera poses"};
  if (record.poses) {
    return {Alignment::kSim3, fmt::format("the run estimated the camera poses (--poses {})", *record.poses)};
  }
  const auto estimated = files::ReadTum(out_dir + "/trajectory.txt");
  const auto truth = files::ReadTum(sequence_dir + "/groundtruth.txt");
  if (!estimated.ok() || !truth.ok()) {
    return {Alignment::kSim3, "the trajectories cannot be compared, so the camera poses may be estimated"};
  }
  if (HaveSameWorld(*estimated, *truth, kMaxDt_s)) {
    return {Alignment::kNone, "trajectory.txt agrees with groundtruth.txt without alignment"};
  }
  return {Alignment::kSim3, "trajectory.txt agrees with groundtruth.txt only after alignment, if at all"};
}

}  // namespace romap::eval
