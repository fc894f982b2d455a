#include "client/eval/calibration.h"

#include <cstddef>

namespace romap::eval {
namespace {

// The length of a vector of three independent normal errors is below this multiple of their standard deviation in 95 %
// of the cases: the square root of the 95 % quantile of the chi-square distribution with 3 degrees of freedom.
constexpr double kBound95 = 2.7955;

}  // namespace

std::optional<Calibration> MeasureCalibration(std::span<const PoseError> errors, std::span<const PoseSigma> sigmas,
                                              double scale) {
  if (errors.empty()) return std::nullopt;
  size_t position = 0, rotation = 0;
  for (size_t k = 0; k < errors.size(); ++k) {
    if (errors[k].position_m <= kBound95 * scale * sigmas[k].position) ++position;
    if (errors[k].rotation_deg <= kBound95 * sigmas[k].rotation_deg) ++rotation;
  }
  const double count = static_cast<double>(errors.size());
  return Calibration{static_cast<double>(position) / count, static_cast<double>(rotation) / count};
}

}  // namespace romap::eval
