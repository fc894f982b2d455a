#include "server/slam/focal_check.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "common/statistics.h"
#include "server/slam/geometry/epipolar.h"

namespace romap::slam {
namespace {

constexpr int kFactorsPerOctave = 8;
constexpr int kOctaves = 2;  // in each direction
constexpr size_t kFocalWindowPairs = 24;
constexpr size_t kMinFocalPairs = 6;
constexpr size_t kMinFocalReferences = 3;  // first frames of the pairs
// A smaller error of the focal length is not told from a lens distortion that is not stated.
constexpr double kMaxFocalFactor = 1.15;
// Of the median over the pairs. Pairs with the same first frame have noise in common, so these frames are counted.
constexpr double kFocalSigmas = 3;
constexpr double kMedianEfficiency = 1.2533;  // standard error of a median over that of a mean
constexpr double kMadToSigma = 1.4826;
constexpr double kSameSideShare = 0.8;  // of the pairs: fit best if the focal length is changed in the same direction
// Of the distances with the given and with the best focal length.
constexpr double kMinDistanceRatio = 1.05;
// Of the image width: 1.2 px of 640. If the best focal length leaves larger distances, then not it alone is wrong.
constexpr double kExactDistance = 1.2 / 640;

const std::vector<double>& Factors() {
  static const std::vector<double> factors = [] {
    std::vector<double> all;
    for (int k = -kOctaves * kFactorsPerOctave; k <= kOctaves * kFactorsPerOctave; ++k) {
      all.push_back(std::exp2(static_cast<double>(k) / kFactorsPerOctave));
    }
    return all;
  }();
  return factors;
}
constexpr size_t kGivenFactor = kOctaves * kFactorsPerOctave;  // index of the factor 1

size_t IndexOf(double log_factor) {
  const long steps = std::lround(log_factor / std::log(2.0) * kFactorsPerOctave);
  return static_cast<size_t>(static_cast<long>(kGivenFactor) + steps);
}

}  // namespace

std::optional<FocalCheck::Pair> FocalCheck::Measure(const CameraModel& camera, const PoseCheck::AgreeingPair& pair) {
  const std::optional<Motion> motion = pair.GivenMotion();
  if (!motion) return std::nullopt;
  Pair measured{.first_frame_id = pair.first_frame_id, .distances = {}};
  for (const double factor : Factors()) {
    CameraModel scaled = camera;
    scaled.fx_px *= factor;
    scaled.fy_px *= factor;
    measured.distances.push_back(MedianEpipolarDistance_px(scaled, *motion, ToRays(scaled, pair.matches)) /
                                 camera.width_px);
  }
  const auto best = std::min_element(measured.distances.begin(), measured.distances.end());
  measured.log_factor = std::log(Factors()[static_cast<size_t>(best - measured.distances.begin())]);
  return measured;
}

void FocalCheck::AddPair(const CameraModel& camera, const PoseCheck::AgreeingPair& pair) {
  std::optional<Pair> measured = Measure(camera, pair);
  if (!measured) return;
  camera_ = camera;
  pairs_.push_back(*std::move(measured));
  if (pairs_.size() > kFocalWindowPairs) {
    pairs_.pop_front();
    has_older_pairs_ = true;
  }
  Decide();
}

void FocalCheck::Decide() {
  best_ = FindBest();
  if (!best_) {
    contradicted_since_frame_ = 0;
  } else if (contradicted_since_frame_ == 0) {
    contradicted_since_frame_ = has_older_pairs_ ? pairs_.front().first_frame_id : 1;
  }
}

std::optional<FocalCheck::Best> FocalCheck::FindBest() const {
  std::set<uint64_t> references;
  std::vector<double> log_factors;
  for (const Pair& pair : pairs_) {
    references.insert(pair.first_frame_id);
    log_factors.push_back(pair.log_factor);
  }
  if (pairs_.size() < kMinFocalPairs || references.size() < kMinFocalReferences) return std::nullopt;
  const double median = Median(log_factors);
  std::vector<double> deviations, ratios, best_distances, given_distances;
  size_t on_same_side = 0;
  const size_t best = IndexOf(median);
  for (const Pair& pair : pairs_) {
    deviations.push_back(std::abs(pair.log_factor - median));
    on_same_side += pair.log_factor * median > 0 ? 1 : 0;
    best_distances.push_back(pair.distances[best]);
    given_distances.push_back(pair.distances[kGivenFactor]);
    ratios.push_back(pair.distances[kGivenFactor] / std::max(pair.distances[best], 1e-9));
  }
  const double sigma = kMedianEfficiency * kMadToSigma * Median(std::move(deviations)) /
                       std::sqrt(static_cast<double>(references.size()));
  const double best_distance = Median(std::move(best_distances));
  spdlog::debug(
      "slam: the matches of {} pairs fit best with a focal length {:.2f} times as large, sigma {:.2f}, {:.2f} px",
      pairs_.size(), std::exp(median), sigma, best_distance * camera_.width_px);
  if (std::abs(median) < std::log(kMaxFocalFactor) || std::abs(median) < kFocalSigmas * sigma) return std::nullopt;
  if (static_cast<double>(on_same_side) < kSameSideShare * static_cast<double>(pairs_.size())) return std::nullopt;
  // Both per pair and for all pairs together: few matches on small objects give pairs with much noise.
  const double given_distance = Median(std::move(given_distances));
  if (Median(std::move(ratios)) < kMinDistanceRatio || given_distance < kMinDistanceRatio * best_distance) {
    return std::nullopt;
  }
  if (best_distance > kExactDistance) return std::nullopt;
  return Best{.factor = std::exp(median),
              .distance_px = best_distance * camera_.width_px,
              .given_distance_px = given_distance * camera_.width_px};
}

std::optional<Diagnostic> FocalCheck::Check() const {
  if (!best_) return std::nullopt;
  return Diagnostic{
      .code = "calibration_contradicts_images",
      .severity = Severity::kError,
      .first_frame_id = contradicted_since_frame_,
      .text = fmt::format(
          "the focal length of the camera does not fit the images and the given poses: half of the feature matches of "
          "{} pairs of frames are more than {:.2f} px off their epipolar lines; {:.2f} px if the focal length is "
          "{:.2f} "
          "times as large; frames are not used while this lasts",
          pairs_.size(), best_->given_distance_px, best_->distance_px, best_->factor),
      .advice = fmt::format(
          "state the intrinsics of the image size that is sent (fx is {:.0f} px, about {:.0f} px would fit): those of "
          "another image size have to be multiplied by the ratio of the widths",
          camera_.fx_px, camera_.fx_px * best_->factor)};
}

}  // namespace romap::slam
