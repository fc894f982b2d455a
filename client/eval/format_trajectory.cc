#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "client/eval/eval.h"

namespace romap::eval {
namespace {

std::string NumberOrDash(std::optional<double> value) { return value ? fmt::format("{:.3f}", *value) : "-"; }

// How many decimals lengths need in addition to those that suit positions spread over a meter: 3 for a trajectory in
// kilometers.
int ExtraDecimals(double extent_m) {
  if (!(extent_m > 0)) return 0;
  return std::clamp(-1 - static_cast<int>(std::floor(std::log10(extent_m))), 0, 9);
}

std::string ScaleLine(const MotionFigures& motion) {
  if (!motion.scale) return fmt::format("scale is not observable: {}\n", motion.scale_note);
  std::string text = fmt::format("scale {:.4f} by relative motion{}", *motion.scale,
                                 *motion.scale < 0 ? " (negative: the translation is reversed)" : "");
  const std::vector<double>& scales = motion.local_scales;
  if (scales.size() < 2) return text + "\n";
  return text + fmt::format("; drift {:.3f} (last to first path section), sections {:.3f}\n",
                            scales.back() / scales.front(), fmt::join(scales, " "));
}

std::string CoverageLine(const FrameCoverage& coverage) {
  return fmt::format("frames: {} of {} tracked ({:.1f} %), {} before the first pose, {} lost{}\n", coverage.tracked,
                     coverage.frames, 100 * coverage.TrackedShare(), coverage.before_first, coverage.lost,
                     coverage.inferred ? " (inferred from the pose period and the time of the ground truth)" : "");
}

std::string CalibrationLine(const Calibration& calibration) {
  return fmt::format(
      "uncertainty: {:.1f} % of position and {:.1f} % of rotation errors within their 95 % bound; median bound over "
      "median error {:.1f} and {:.1f}; {} poses\n",
      100 * calibration.position_coverage, 100 * calibration.rotation_coverage, calibration.position_bound_ratio,
      calibration.rotation_bound_ratio, calibration.poses);
}

}  // namespace

std::string FormatTable(const TrajectoryReport& report) {
  const MotionFigures& motion = report.motion;
  const std::string window = motion.WindowText();
  const int extra = ExtraDecimals(report.extent_m);
  std::string text = fmt::format(
      "trajectory, alignment {}: {} of {} poses matched ({} true poses), path length {:.{}f} m, scale {:.6f}\n"
      "ATE rmse {:.{}f} m  mean {:.{}f}  median {:.{}f}  max {:.{}f}; rmse is {:.1f} % of the extent {:.{}f} m (rms)\n"
      "rotation rmse {:.4f} deg  max {:.4f}\n",
      ToString(report.alignment), report.matched, report.estimated_poses, report.ground_truth_poses,
      report.path_length_m, 3 + extra, report.scale, report.ate_rmse_m, 6 + extra, report.ate_mean_m, 6 + extra,
      report.ate_median_m, 6 + extra, report.ate_max_m, 6 + extra, 100 * report.AteShare(), report.extent_m, 3 + extra,
      report.rotation_rmse_deg, report.rotation_max_deg);
  text += fmt::format("translation correlation (-1..1): {} between frames, {} {}\n",
                      NumberOrDash(motion.frame_correlation), NumberOrDash(motion.window_correlation), window);
  text += fmt::format("rotation error {}: median {:.3f} deg, 95 % {:.3f} deg\n", window, motion.rotation_median_deg,
                      motion.rotation_95_deg);
  text += ScaleLine(motion);
  text += fmt::format("largest jumps between frames: {:.{}f} m at {:.3f} s, {:.2f} deg at {:.3f} s\n",
                      motion.jumps.position_m, 4 + extra, motion.jumps.position_s, motion.jumps.rotation_deg,
                      motion.jumps.rotation_s);
  text += CoverageLine(report.coverage);
  if (report.calibration) {
    text += CalibrationLine(*report.calibration);
  }
  return text + FormatLine(report.verdict);
}

std::string FormatTrajectory(const RunReport& report) {
  if (report.trajectory) return FormatTable(*report.trajectory);
  return report.verdict ? FormatLine(*report.verdict) : "";
}

}  // namespace romap::eval
