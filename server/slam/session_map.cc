#include "server/slam/session_map.h"

#include <fmt/format.h>

#include <utility>

#include "common/angles.h"
#include "common/statistics.h"

namespace romap::slam {
namespace {

constexpr uint64_t kFirstGlobalAdjustment_keyframes = 10;
constexpr double kMinParallax_rad = 3 * kRadPerDeg;

}  // namespace

SessionMap::SessionMap(const SlamConfig& config, SparseMapId map_id, uint64_t keyframes_used, uint64_t points_used)
    : id(map_id),
      map(config, keyframes_used, points_used),
      places(config, &map),
      loops(config, &map, &places),
      up(keyframes_used),
      mask_voter(config),
      refiner(config),
      uncertainty(config),
      next_global_adjustment(keyframes_used + kFirstGlobalAdjustment_keyframes) {}

MapStart SessionMap::StartOfNextMap() const {
  MapStart start;
  const std::optional<ScaledPose> last = map.KeyframePose(last_reference);
  const MapKeyframe* keyframe = map.FindKeyframe(last_reference);
  if (keyframe == nullptr) keyframe = map.FindKeyframe(newest);
  if (last) {
    start.T_world_first = last->Compose(T_reference_last);
  } else if (keyframe != nullptr) {
    start.T_world_first = keyframe->T_world_camera();
  }
  if (keyframe != nullptr) start.depth_mu = map.MedianDepth_mu(*keyframe).value_or(1);
  return start;
}

void SessionMap::Absorb(SessionMap& from, bool has_camera) {
  for (const auto& [keyframe_id, keyframe] : from.map.keyframes()) places.Add(keyframe);
  map.Append(std::move(from.map));
  corrections.Append(std::move(from.corrections));
  up.RequestUpdate();
  uncertainty.RequestUpdate();
  has_depth_scale |= from.has_depth_scale;
  world_is_given |= from.world_is_given;
  unchecked.insert(unchecked.end(), from.unchecked.begin(), from.unchecked.end());
  unsearched.insert(unsearched.end(), from.unsearched.begin(), from.unsearched.end());
  if (!has_camera) return;
  mask_voter = std::move(from.mask_voter);
  refiner = std::move(from.refiner);
  newest = from.newest;
  reference = from.reference;
  relocalized.reset();
  last_reference = from.last_reference;
  T_reference_last = from.T_reference_last;
  parallax_rad = from.parallax_rad;
}

std::vector<Diagnostic> SessionMap::Diagnostics() const {
  if (map.keyframes().empty()) return {};
  if (world_is_given && given_up_is_estimated) return up.Diagnostics();
  if (world_is_given) return given_up_contradiction ? std::vector{*given_up_contradiction} : std::vector<Diagnostic>{};
  std::vector<Diagnostic> diagnostics = up.Diagnostics();
  if (!has_depth_scale && parallax_rad < kMinParallax_rad) {
    diagnostics.push_back(
        {.code = "translation_unobservable",
         .text =
             fmt::format("the camera has rotated with hardly any translation: most of the map points were seen from "
                         "directions less than {:.1f} deg apart ({:.0f} deg needed), so distances and the scale of "
                         "the translation are not known; move the camera sideways, or send depth images",
                         parallax_rad / kRadPerDeg, kMinParallax_rad / kRadPerDeg)});
  }
  for (Diagnostic& diagnostic : given_world.Diagnostics()) diagnostics.push_back(std::move(diagnostic));
  return diagnostics;
}

double UpperParallax_rad(const SlamMap& map) {
  std::vector<double> parallaxes_rad;
  for (const auto& [id, track] : map.points()) parallaxes_rad.push_back(track.point.max_parallax_rad);
  return parallaxes_rad.empty() ? 0 : Quantile(std::move(parallaxes_rad), 0.75);
}

}  // namespace romap::slam
