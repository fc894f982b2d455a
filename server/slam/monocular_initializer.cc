#include "server/slam/monocular_initializer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/angles.h"
#include "common/statistics.h"
#include "server/slam/descriptor_matching.h"
#include "server/slam/frame_matching.h"

namespace romap::slam {
namespace {

constexpr int kMinStartFeatures = 100;
constexpr int kMaxOctave = 3;          // coarser corners are too inaccurate
constexpr double kSearchShare = 0.08;  // of the image's width, around the last pixel of a feature
constexpr int kMaxStartDistance = 60;  // Hamming, bits
constexpr double kStartRatio = 0.85;
// Minimum median motion of the features for SolveTwoView, as a share of the image's width.
constexpr double kMinMotionShare = 0.012;
constexpr int kMaxWait_frames = 90;       // for a second view; then the view is dropped
constexpr double kMinParallax_deg = 1.5;  // median over the points of the two first views
constexpr double kMinKeptShare = 0.15;    // minimum share of the view's features that are still matched
constexpr double kSpacingShare = 0.03;    // of the image's width: median motion after which the next view is added
constexpr size_t kMaxFollowed = 4;

}  // namespace

void MonocularInitializer::AddView(std::shared_ptr<const FrameFeatures> frame) {
  FollowedView view{.frame = std::move(frame)};
  for (const Feature& feature : view.frame->features) view.latest_px.push_back(feature.pixel_px.cast<double>());
  followed_.push_back(std::move(view));
}

void MonocularInitializer::Follow(const FrameFeatures& frame, FollowedView& view) const {
  const double radius_px = kSearchShare * frame.camera.width_px;
  std::vector<int> first_of(frame.size(), -1);
  std::vector<int> distance_of(frame.size(), 256);
  std::vector<int> near;
  for (size_t i = 0; i < view.frame->size(); ++i) {
    const Feature& feature = view.frame->features[i];
    if (feature.octave > kMaxOctave) continue;
    frame.grid.Near(view.latest_px[i], radius_px, near);
    const NearestFeature nearest = FindNearest(feature, frame.features, near, /*max_octave_difference=*/1);
    if (!nearest.IsDistinct(kMaxStartDistance, kStartRatio)) continue;
    const auto k = static_cast<size_t>(nearest.index);
    if (nearest.distance >= distance_of[k]) continue;
    distance_of[k] = nearest.distance;
    first_of[k] = static_cast<int>(i);
  }
  view.matches.clear();
  std::vector<double> motions_px;
  for (size_t k = 0; k < first_of.size(); ++k) {
    if (first_of[k] < 0) continue;
    const auto first = static_cast<size_t>(first_of[k]);
    view.matches.push_back({first_of[k], static_cast<int>(k)});
    view.latest_px[first] = frame.features[k].pixel_px.cast<double>();
    motions_px.push_back((frame.features[k].pixel_px - view.frame->features[first].pixel_px).norm());
  }
  view.motion_px = motions_px.empty() ? 0 : Median(std::move(motions_px));
  ++view.frames;
}

std::optional<InitialViews> MonocularInitializer::AddFrame(std::shared_ptr<const FrameFeatures> frame,
                                                           std::string* reason) {
  if (frame->size() < kMinStartFeatures) {
    *reason = fmt::format("too little texture: {} features, {} needed", frame->size(), kMinStartFeatures);
    followed_.clear();
    return std::nullopt;
  }
  *reason = "waiting for a second view";
  for (FollowedView& view : followed_) Follow(*frame, view);
  const int min_matches = TwoViewOptions{}.min_matches;
  const size_t dropped = std::erase_if(followed_, [&](const FollowedView& view) {
    const auto matches = static_cast<double>(view.matches.size());
    return matches < kMinKeptShare * static_cast<double>(view.frame->size()) || matches < min_matches ||
           view.frames > kMaxWait_frames;
  });
  if (dropped > 0) *reason = "too few features of the first view are still visible";
  for (auto view = followed_.rbegin(); view != followed_.rend(); ++view) {
    if (auto views = TryToInitialize(*view, frame, reason)) {
      followed_.clear();
      return views;
    }
  }
  const bool is_far_from_newest_view =
      followed_.empty() || followed_.back().motion_px > kSpacingShare * frame->camera.width_px;
  if (is_far_from_newest_view && followed_.size() < kMaxFollowed) AddView(std::move(frame));
  return std::nullopt;
}

std::optional<InitialViews> MonocularInitializer::TryToInitialize(const FollowedView& view,
                                                                  const std::shared_ptr<const FrameFeatures>& frame,
                                                                  std::string* reason) const {
  const double min_motion_px = kMinMotionShare * frame->camera.width_px;
  if (view.motion_px < min_motion_px) {
    *reason = fmt::format("too little parallax: median feature motion {:.1f} px, {:.1f} px needed", view.motion_px,
                          min_motion_px);
    return std::nullopt;
  }
  std::vector<TwoViewMatch> two_view_matches;
  for (const Match& match : view.matches) {
    const Feature& a = view.frame->features[static_cast<size_t>(match.first)];
    const Feature& b = frame->features[static_cast<size_t>(match.second)];
    two_view_matches.push_back(MakeTwoViewMatch(a, b, config_.pixel_sigma_px));
  }
  TwoViewOptions options;
  options.min_parallax_deg = kMinParallax_deg;
  options.seed = config_.Seed(frame->frame_id);
  const TwoViewResult result = SolveTwoView(frame->camera, two_view_matches, options);
  if (result.outcome != TwoViewOutcome::kOk) {
    *reason = fmt::format("{}: {} matches, {} points, parallax {:.2f} deg", Describe(result.outcome),
                          two_view_matches.size(), result.points, result.parallax_rad * kDegPerRad);
    return std::nullopt;
  }
  InitialViews initial_views{.first = view.frame, .second = frame, .T_first_second = result.T_first_second};
  for (size_t i = 0; i < view.matches.size(); ++i) {
    if (!result.points_first[i]) continue;
    initial_views.points.push_back({view.matches[i].first, view.matches[i].second, *result.points_first[i]});
  }
  *reason = "two views found; initializing the map";
  return initial_views;
}

}  // namespace romap::slam
