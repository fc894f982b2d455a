#include "client/eval/calibration.h"

#include <utility>
#include <vector>

#include "common/angles.h"
#include "common/statistics.h"

namespace romap::eval {
namespace {

// Errors with their 95 % bounds.
struct BoundedErrors {
  std::vector<double> errors;
  std::vector<double> bounds;

  void Add(double error, double sigma) {
    errors.push_back(error);
    bounds.push_back(kSigmasTo95 * sigma);
  }
  double Coverage() const {
    size_t covered = 0;
    for (size_t k = 0; k < errors.size(); ++k) covered += errors[k] <= bounds[k] ? 1 : 0;
    return static_cast<double>(covered) / static_cast<double>(errors.size());
  }
  double BoundRatio() const { return Quantile(bounds, 0.5) / Quantile(errors, 0.5); }
};

}  // namespace

std::optional<Calibration> MeasureCalibration(std::span<const PoseError> errors,
                                              std::span<const std::optional<PoseUncertainty>> uncertainties,
                                              double scale) {
  BoundedErrors position, rotation;
  for (size_t k = 0; k < errors.size(); ++k) {
    if (!uncertainties[k]) continue;
    position.Add(errors[k].position_m, scale * uncertainties[k]->position_sigma_mu);
    rotation.Add(errors[k].rotation_deg, uncertainties[k]->rotation_sigma_rad * kDegPerRad);
  }
  if (position.errors.empty()) return std::nullopt;
  return Calibration{.poses = position.errors.size(),
                     .position_coverage = position.Coverage(),
                     .rotation_coverage = rotation.Coverage(),
                     .position_bound_ratio = position.BoundRatio(),
                     .rotation_bound_ratio = rotation.BoundRatio()};
}

}  // namespace romap::eval
