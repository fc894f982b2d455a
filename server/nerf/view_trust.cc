#include "server/nerf/view_trust.h"

#include <algorithm>

#include "common/statistics.h"

namespace romap::nerf {
namespace {

constexpr size_t kMinTrustViews = 6;         // with fewer views, an outlier may be the only correct view
constexpr uint64_t kMinSteps = 40;           // of training on a view before it is compared with the others
constexpr double kMaxUntrustedShare = 0.34;  // of all views

// A residual is an outlier if it exceeds `floor` + `medians` times the median over the views. Shapes that are hard to
// learn have a large median. The color limit is wide because glossy objects differ in color between correct views.
struct Limit {
  double floor, medians;
};
constexpr Limit kOutlineLimit = {0.15, 3.0};
constexpr Limit kColorLimit = {0.1, 4.0};
constexpr double kHysteresis = 0.75;  // an untrusted view must fall below this share of the limit

// The residual of each view in units of its limit.
std::vector<double> RelativeResiduals(const ProbeReport& report) {
  std::vector<double> outlines, colors, relative;
  for (const ViewResidual& view : report.views) {
    outlines.push_back(view.Outline());
    colors.push_back(view.color);
  }
  const double outline_limit = kOutlineLimit.floor + kOutlineLimit.medians * Median(outlines);
  const double color_limit = kColorLimit.floor + kColorLimit.medians * Median(colors);
  for (size_t i = 0; i < outlines.size(); ++i) {
    relative.push_back(std::max(outlines[i] / outline_limit, colors[i] / color_limit));
  }
  return relative;
}

}  // namespace

void ViewTrust::OnView(size_t index, uint64_t step) {
  if (index >= views_.size()) views_.resize(index + 1);
  views_[index] = {step, true};
}

bool ViewTrust::Update(const ProbeReport& report, uint64_t step) {
  if (report.views.size() < kMinTrustViews) return false;
  const std::vector<double> residuals = RelativeResiduals(report);
  std::vector<bool> trusted(views_.size());
  size_t untrusted = 0;
  for (size_t i = 0; i < views_.size(); ++i) {
    trusted[i] = IsNew(i, step) || residuals[i] <= (views_[i].trusted ? 1.0 : kHysteresis);
    untrusted += trusted[i] ? 0 : 1;
  }
  if (static_cast<double>(untrusted) > kMaxUntrustedShare * static_cast<double>(views_.size())) {
    trusted.assign(views_.size(), true);
  }
  bool changed = false;
  for (size_t i = 0; i < views_.size(); ++i) {
    changed |= views_[i].trusted != trusted[i];
    views_[i].trusted = trusted[i];
  }
  return changed;
}

bool ViewTrust::IsNew(size_t index, uint64_t step) const { return step < views_[index].since_step + kMinSteps; }

void ViewTrust::Restart() {
  for (State& view : views_) view = {};
}

std::vector<float> ViewTrust::Weights() const {
  std::vector<float> weights;
  for (const State& view : views_) weights.push_back(view.trusted ? 1.0f : 0.0f);
  return weights;
}

}  // namespace romap::nerf
