#include "server/slam/readout_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace romap::slam {
namespace {

constexpr double kMinReadoutError_s = 0.004;
constexpr double kReadoutErrorSigmas = 4;

}  // namespace

void ReadoutCheck::AddFrame(const Frame& frame, const FrameFeatures& rolling, const PoseFromPoints& pose,
                            const LocalMapTracking& tracking, const ReadoutMotion& motion) {
  const RollingShutter rows(frame, {});
  std::vector<ReadoutEstimator::Observation> observations;
  for (size_t i = 0; i < rolling.size(); ++i) {
    const int point = pose.point_of_feature[i];
    if (point < 0) continue;
    observations.push_back({.observation = tracking.Observe(static_cast<int>(i), point),
                            .read_at = rows.ReadAt(rolling.image_px[i].cast<double>())});
  }
  estimator_.AddFrame(frame.camera, pose.T_world_camera, observations, motion);
}

std::optional<Diagnostic> ReadoutCheck::Check(double stated_s) const {
  const std::optional<ReadoutError> error = estimator_.Estimate();
  if (!error || std::abs(error->value_s) < std::max(kMinReadoutError_s, kReadoutErrorSigmas * error->sigma_s)) {
    return std::nullopt;
  }
  // The map absorbs a part of the error.
  return Diagnostic{.code = "readout_time",
                    .text = fmt::format(
                        "the images fit a rolling shutter whose readout time is at least {:.0f} ms {} than the camera "
                        "states ({:.0f} ms): poses and objects are less accurate; set readout_s of the camera",
                        1e3 * std::abs(error->value_s), error->value_s > 0 ? "longer" : "shorter", 1e3 * stated_s)};
}

}  // namespace romap::slam
