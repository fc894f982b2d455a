#include "server/session/trajectory_uncertainty.h"

#include <cmath>

namespace romap::session {
namespace {

constexpr double kIndependentErrors = 4;

}  // namespace

std::vector<PoseUncertainty> AlignedUncertainties(std::span<const FrameUncertainty> frames) {
  PoseUncertainty sum_of_squares;
  for (const FrameUncertainty& frame : frames) {
    sum_of_squares.position_sigma_mu += std::pow(frame.relative.position_sigma_mu, 2);
    sum_of_squares.rotation_sigma_rad += std::pow(frame.relative.rotation_sigma_rad, 2);
  }
  const double count = kIndependentErrors * static_cast<double>(frames.size());
  const PoseUncertainty alignment{std::sqrt(sum_of_squares.position_sigma_mu / count),
                                  std::sqrt(sum_of_squares.rotation_sigma_rad / count)};
  std::vector<PoseUncertainty> aligned;
  aligned.reserve(frames.size());
  for (const FrameUncertainty& frame : frames) {
    aligned.push_back(Combine(Combine(frame.reference, frame.relative), alignment));
  }
  return aligned;
}

}  // namespace romap::session
