#include "client/eval/verdict.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "client/eval/trajectory_eval.h"

namespace romap::eval {
namespace {

// A figure up to `good` is GOOD, up to `degraded` is DEGRADED, above is WRONG.
struct Limits {
  double good;
  double degraded;
};

// 1 - correlation of translation directions. 0.1 = a mean angle of 26 degrees, 0.5 = 60 degrees.
constexpr Limits kCorrelationDeficit{0.1, 0.5};
// ATE relative to the rms distance of the true positions from their mean. A map unrelated to the truth has about 1,
// because the alignment then shrinks it to a point.
constexpr Limits kAteShare{0.05, 0.3};
// 95 % quantile of the error of the relative rotation over a window [deg]. Tracking errors are mostly below 1 degree; a
// rotation that is wrong by 15 degrees within a second is a lost or mirrored camera.
constexpr Limits kRotation95_deg{3, 15};
// Largest to smallest local scale along the path.
constexpr Limits kScaleSpread{1.1, 2};
// Largest position jump between frames, relative to the rms distance of the true positions from their mean.
constexpr Limits kJumpShare{0.1, 0.5};
// Largest rotation jump between frames [deg].
constexpr Limits kJumpRotation_deg{5, 30};
// 1 - share of tracked frames. The first second of a sequence is often needed to initialize the map.
constexpr Limits kUntrackedShare{0.1, 0.7};

VerdictLevel LevelOf(double value, const Limits& limits) {
  if (value <= limits.good) return VerdictLevel::kGood;
  return value <= limits.degraded ? VerdictLevel::kDegraded : VerdictLevel::kWrong;  // also WRONG if NaN
}

// Collects the reasons of the worst level.
class Reasons {
 public:
  void Add(VerdictLevel level, std::string reason) {
    if (level < verdict_.level || level == VerdictLevel::kGood) return;
    if (level > verdict_.level) verdict_ = {level, {}};
    verdict_.reasons.push_back(std::move(reason));
  }

  Verdict Take() { return std::move(verdict_); }

 private:
  Verdict verdict_;
};

void JudgeScale(const MotionFigures& motion, Reasons* reasons) {
  const std::vector<double>& scales = motion.local_scales;
  const auto reversed = std::count_if(scales.begin(), scales.end(), [](double scale) { return scale < 0; });
  if (reversed > 0) {
    reasons->Add(VerdictLevel::kWrong,
                 fmt::format("translation is reversed in {} of {} path sections", reversed, scales.size()));
  } else if (!scales.empty()) {
    const auto [least, most] = std::minmax_element(scales.begin(), scales.end());
    reasons->Add(
        LevelOf(*most / *least, kScaleSpread),
        fmt::format("scale varies by a factor of {:.2f} along the path (limit {})", *most / *least, kScaleSpread.good));
  }
}

void JudgeTranslation(const TrajectoryReport& report, Reasons* reasons) {
  const double correlation = report.motion.window_correlation.value_or(0);
  reasons->Add(LevelOf(1 - correlation, kCorrelationDeficit),
               fmt::format("translation correlation {} is {:.2f} (at least {} required)", report.motion.WindowText(),
                           correlation, 1 - kCorrelationDeficit.good));
  reasons->Add(LevelOf(report.AteShare(), kAteShare),
               fmt::format("ATE is {:.1f} % of the extent of the true positions (limit {} %)", 100 * report.AteShare(),
                           100 * kAteShare.good));
  JudgeScale(report.motion, reasons);
  const Jumps& jumps = report.motion.jumps;
  reasons->Add(LevelOf(jumps.position_m / report.extent_m, kJumpShare),
               fmt::format("position jumps by {:.3f} m at {:.3f} s", jumps.position_m, jumps.position_s));
}

}  // namespace

std::string ToString(VerdictLevel level) {
  switch (level) {
    case VerdictLevel::kGood:
      return "GOOD";
    case VerdictLevel::kDegraded:
      return "DEGRADED";
    case VerdictLevel::kWrong:
      return "WRONG";
  }
  return "unknown";
}

Verdict Judge(const TrajectoryReport& report) {
  Reasons reasons;
  const bool judges_translation = report.extent_m >= kMinExtent_m;
  if (judges_translation) JudgeTranslation(report, &reasons);
  const MotionFigures& motion = report.motion;
  reasons.Add(LevelOf(motion.rotation_95_deg, kRotation95_deg),
              fmt::format("rotation error {} is {:.1f} deg (95 % quantile; limit {} deg)", motion.WindowText(),
                          motion.rotation_95_deg, kRotation95_deg.good));
  reasons.Add(
      LevelOf(motion.jumps.rotation_deg, kJumpRotation_deg),
      fmt::format("orientation jumps by {:.1f} deg at {:.3f} s", motion.jumps.rotation_deg, motion.jumps.rotation_s));
  const double tracked = report.coverage.TrackedShare();
  reasons.Add(LevelOf(1 - tracked, kUntrackedShare), fmt::format("only {:.1f} % of the frames tracked", 100 * tracked));
  Verdict verdict = reasons.Take();
  if (verdict.level == VerdictLevel::kGood) {
    if (judges_translation) {
      verdict.reasons.push_back(fmt::format("ATE {:.1f} % of the extent", 100 * report.AteShare()));
      verdict.reasons.push_back(
          fmt::format("translation correlation {:.3f}", report.motion.window_correlation.value_or(0)));
    }
    verdict.reasons.push_back(fmt::format("rotation error {:.2f} deg", motion.rotation_95_deg));
    verdict.reasons.push_back(fmt::format("{:.1f} % of the frames tracked", 100 * tracked));
  }
  if (!judges_translation) {
    verdict.reasons.push_back(
        fmt::format("translation not judged: the true positions vary by only {:.3g} m rms", report.extent_m));
  }
  return verdict;
}

std::string FormatLine(const Verdict& verdict) {
  return fmt::format("trajectory verdict: {}: {}\n", ToString(verdict.level), fmt::join(verdict.reasons, "; "));
}

}  // namespace romap::eval
