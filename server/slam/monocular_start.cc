#include "server/slam/monocular_start.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace romap {
namespace {

constexpr int kMinFeatures = 100;
constexpr int kMaxOctave = 3;          // coarser corners are too uncertain to begin with
constexpr double kSearchShare = 0.08;  // of the image's width, around where a feature was seen last
constexpr int kMaxDistance = 60;       // Hamming, bits
constexpr double kRatio = 0.85;
constexpr double kMinMotionShare = 0.012;  // of the image's width: median motion of the features worth a try
constexpr int kMaxWait_frames = 90;        // a first view that led to nothing for so long is given up
constexpr double kMinKeptShare = 0.15;     // of the first view's features must still be followed

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

void MonocularStart::Begin(std::shared_ptr<const FrameFeatures> sight) {
  first_ = std::move(sight);
  frames_since_first_ = 0;
  latest_px_.clear();
  for (const Feature& feature : first_->features) latest_px_.push_back(feature.pixel_px.cast<double>());
}

std::vector<MonocularStart::Match> MonocularStart::Follow(const FrameFeatures& sight) {
  const double radius_px = kSearchShare * sight.camera.width_px;
  std::vector<int> first_of(sight.size(), -1);
  std::vector<int> distance_of(sight.size(), 256);
  std::vector<int> near;
  for (size_t i = 0; i < first_->size(); ++i) {
    const Feature& feature = first_->features[i];
    if (feature.octave > kMaxOctave) continue;
    sight.grid.Near(latest_px_[i], radius_px, near);
    int best = -1;
    int best_distance = 256;
    int second_distance = 256;
    for (const int index : near) {
      const Feature& other = sight.features[static_cast<size_t>(index)];
      if (std::abs(other.octave - feature.octave) > 1) continue;
      const int distance = HammingDistance(feature.descriptor, other.descriptor);
      if (distance < best_distance) {
        second_distance = best_distance;
        best_distance = distance;
        best = index;
      } else {
        second_distance = std::min(second_distance, distance);
      }
    }
    if (best < 0 || best_distance > kMaxDistance || best_distance > kRatio * second_distance) continue;
    const auto k = static_cast<size_t>(best);
    if (best_distance >= distance_of[k]) continue;
    distance_of[k] = best_distance;
    first_of[k] = static_cast<int>(i);
  }
  std::vector<Match> matches;
  for (size_t k = 0; k < first_of.size(); ++k) {
    if (first_of[k] < 0) continue;
    matches.push_back({first_of[k], static_cast<int>(k)});
    latest_px_[static_cast<size_t>(first_of[k])] = sight.features[k].pixel_px.cast<double>();
  }
  return matches;
}

std::optional<MapStart> MonocularStart::Offer(std::shared_ptr<const FrameFeatures> sight, std::string* reason) {
  if (sight->size() < kMinFeatures) {
    *reason = fmt::format("too little texture: {} features, {} needed", sight->size(), kMinFeatures);
    first_ = nullptr;
    return std::nullopt;
  }
  if (!first_) {
    Begin(std::move(sight));
    *reason = "waiting for a second view";
    return std::nullopt;
  }
  ++frames_since_first_;
  const std::vector<Match> matches = Follow(*sight);
  TwoViewOptions options;
  options.min_parallax_deg = config_.start_parallax_deg;
  const bool faded = static_cast<double>(matches.size()) < kMinKeptShare * static_cast<double>(first_->size()) ||
                     matches.size() < static_cast<size_t>(options.min_matches);
  if (faded || frames_since_first_ > kMaxWait_frames) {
    *reason = faded ? fmt::format("too few matches with the first view: {}", matches.size())
                    : "too little parallax: the first view was given up";
    Begin(std::move(sight));
    return std::nullopt;
  }
  std::vector<double> motions_px;
  std::vector<TwoViewMatch> pairs;
  for (const Match& match : matches) {
    const Feature& a = first_->features[static_cast<size_t>(match.first)];
    const Feature& b = sight->features[static_cast<size_t>(match.second)];
    motions_px.push_back((a.pixel_px - b.pixel_px).norm());
    pairs.push_back({a.pixel_px.cast<double>(), b.pixel_px.cast<double>(),
                     config_.pixel_sigma_px * std::max(a.octave_scale, b.octave_scale)});
  }
  const double motion_px = Median(motions_px);
  if (motion_px < kMinMotionShare * sight->camera.width_px) {
    *reason = fmt::format("too little parallax: the image moved by {:.1f} px", motion_px);
    return std::nullopt;
  }
  options.seed = config_.Seed(sight->frame_id);
  const TwoViewResult result = SolveTwoView(sight->camera, pairs, options);
  if (result.outcome != TwoViewOutcome::kOk) {
    *reason = fmt::format("{}: {} matches, {} points, parallax {:.2f} deg", Describe(result.outcome), matches.size(),
                          result.points, result.parallax_rad * 180 / std::numbers::pi);
    return std::nullopt;
  }
  MapStart start{.first = first_, .second = sight, .T_first_second = result.T_first_second};
  for (size_t i = 0; i < matches.size(); ++i) {
    if (!result.points_first[i]) continue;
    start.points.push_back({matches[i].first, matches[i].second, *result.points_first[i]});
  }
  *reason = "two views found, the map begins";
  first_ = nullptr;
  return start;
}

}  // namespace romap
