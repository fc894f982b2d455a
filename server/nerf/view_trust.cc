#include "server/nerf/view_trust.h"

#include <algorithm>

#include "common/statistics.h"

namespace romap::nerf {
namespace {

constexpr size_t kFewestViews = 6;        // below, what is odd may just as well be right
constexpr uint64_t kPatience_steps = 40;  // of training on a view before it is judged
constexpr double kMostDistrusted = 0.34;  // of all views

// A residual is odd beyond `floor` + `medians` times the median over the views. Shapes that are hard to learn have a
// large median; colours differ between good views where things shine.
struct Limit {
  double floor, medians;
};
constexpr Limit kOutlineLimit = {0.15, 3.0};
constexpr Limit kColorLimit = {0.1, 4.0};
constexpr double kForgiven = 0.75;  // of the limit: a view that was odd must come below this

// How odd each view is: 1 is at the limit.
std::vector<double> Oddness(const ProbeReport& report) {
  std::vector<double> outlines, colors, oddness;
  for (const ViewResidual& view : report.views) {
    outlines.push_back(view.Outline());
    colors.push_back(view.color);
  }
  const double outline_limit = kOutlineLimit.floor + kOutlineLimit.medians * Median(outlines);
  const double color_limit = kColorLimit.floor + kColorLimit.medians * Median(colors);
  for (size_t i = 0; i < outlines.size(); ++i) {
    oddness.push_back(std::max(outlines[i] / outline_limit, colors[i] / color_limit));
  }
  return oddness;
}

}  // namespace

void ViewTrust::OnView(size_t index, uint64_t step) {
  if (index >= views_.size()) views_.resize(index + 1);
  views_[index] = {step, true};
}

bool ViewTrust::Judge(const ProbeReport& report, uint64_t step) {
  if (report.views.size() < kFewestViews) return false;
  const std::vector<double> oddness = Oddness(report);
  std::vector<bool> verdict(views_.size());
  size_t odd = 0;
  for (size_t i = 0; i < views_.size(); ++i) {
    verdict[i] = IsYoung(i, step) || oddness[i] <= (views_[i].trusted ? 1.0 : kForgiven);
    odd += verdict[i] ? 0 : 1;
  }
  if (static_cast<double>(odd) > kMostDistrusted * static_cast<double>(views_.size())) {
    verdict.assign(views_.size(), true);
  }
  bool changed = false;
  for (size_t i = 0; i < views_.size(); ++i) {
    changed |= views_[i].trusted != verdict[i];
    views_[i].trusted = verdict[i];
  }
  return changed;
}

bool ViewTrust::IsYoung(size_t index, uint64_t step) const { return step < views_[index].since_step + kPatience_steps; }

void ViewTrust::Restart() {
  for (State& view : views_) view = {};
}

size_t ViewTrust::distrusted() const {
  return static_cast<size_t>(std::ranges::count_if(views_, [](const State& view) { return !view.trusted; }));
}

std::vector<float> ViewTrust::Weights() const {
  std::vector<float> weights;
  for (const State& view : views_) weights.push_back(view.trusted ? 1.0f : 0.0f);
  return weights;
}

}  // namespace romap::nerf
