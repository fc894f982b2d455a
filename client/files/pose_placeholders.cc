#include "client/files/pose_placeholders.h"

#include <algorithm>
#include <utility>

#include "common/statistics.h"

namespace romap::files {
namespace {

constexpr double kMinJump = 10;  // from a neighbor to the identity, in median steps between neighbors

bool IsIdentity(const StampedPose& pose) {
  return pose.T_world_camera.translation().isZero(0) && pose.T_world_camera.rotation().vec().isZero(0);
}

}  // namespace

size_t RemovePlaceholders(std::vector<StampedPose>* poses) {
  std::vector<double> steps_mu;
  for (size_t k = 1; k < poses->size(); ++k) {
    const StampedPose &before = (*poses)[k - 1], &after = (*poses)[k];
    if (IsIdentity(before) || IsIdentity(after)) continue;
    steps_mu.push_back((after.T_world_camera.translation() - before.T_world_camera.translation()).norm());
  }
  if (steps_mu.empty()) return 0;
  const double min_jump_mu = kMinJump * Median(std::move(steps_mu));
  const auto is_far = [&](const StampedPose& pose) { return pose.T_world_camera.translation().norm() > min_jump_mu; };
  std::vector<StampedPose> kept;
  for (auto run = poses->begin(); run != poses->end();) {
    if (!IsIdentity(*run)) {
      kept.push_back(*run++);
      continue;
    }
    const auto end = std::find_if_not(run, poses->end(), IsIdentity);
    const bool is_placeholder = (run == poses->begin() || is_far(*(run - 1))) && (end == poses->end() || is_far(*end));
    if (!is_placeholder) kept.insert(kept.end(), run, end);
    run = end;
  }
  const size_t removed = poses->size() - kept.size();
  *poses = std::move(kept);
  return removed;
}

}  // namespace romap::files
