#include "server/slam/pose_check.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <utility>

#include "common/statistics.h"
#include "server/slam/frame_matching.h"
#include "server/slam/geometry/epipolar.h"
#include "server/slam/geometry/motion_search.h"

namespace romap::slam {
namespace {

// The number of features bounds the time of matching to about half a millisecond.
constexpr FrameMatching kPoseCheckMatching = {
    .max_distance_bits = kMaxMatchDistance_bits, .max_ratio = kMaxMatchRatio, .max_first = 300};
constexpr size_t kMinPairMatches = 40;
constexpr size_t kFewPairMatches =
    80;  // the view of the reference is left; a pair with less movement is better than none
// Median movement of the matches, as a share of the image width.
constexpr double kMovement = 0.08;
constexpr double kLeastMovement = 0.04;
// Tolerated distance of a match, as a share of the movement. Noisy poses get more tolerance than the alternatives: an
// error of half a degree is common.
constexpr double kToleranceShare = 0.15;
constexpr double kMinTolerance_px = 2;
constexpr double kGivenToleranceShare = 0.25;
constexpr double kMinGivenTolerance_rad = 0.01;
// A pair agrees if the given motion explains this share of its matches. It contradicts if the given motion explains
// less than `kMaxGivenShare`, less than `kMaxGivenRatio` of what another motion explains, which must be at least
// `kMinBestShare`, and does not explain the rest.
constexpr double kAgreeingShare = 0.65;
constexpr double kMaxGivenShare = 0.5;
constexpr double kMaxGivenRatio = 0.6;
constexpr double kMinBestShare = 0.65;
constexpr int kMinRestMatches = 5;
constexpr double kMinRestShare = 0.5;
constexpr int kPoseCheckIterations = 80;
// Even while a moving object fills most of the image, at most about one pair of sound poses in seven contradicts them:
// six of eight do with a probability of 2e-4.
constexpr size_t kWindowPairs = 16;
constexpr int kMinContradicting = 6;
constexpr double kContradictingShare = 0.7;
constexpr double kSoundShare = 0.25;  // of the pairs: if another motion fits fewer better, there is no contradiction
// Some motions are nearly the same in two conventions. So fewer pairs suffice, among others that agree, and pairs that
// the given poses explain partly, if one alternative explains all of them: noise of the poses would not agree with it.
constexpr int kMinContradictingWithBest = 3;
// An alternative is named if it explains enough matches, nearly as many as any hypothesis, in this share of all pairs,
// and in those that it fits better on average this much more than the second best.
constexpr double kMinNamedShare = 0.4;  // a moving object may have the others
constexpr double kNamedRatio = 0.8;
constexpr double kNamedPairs = 0.85;
constexpr double kNamedMargin = 0.08;

double UpperMovement_px(const std::vector<TwoViewMatch>& matches) {
  std::vector<double> movements_px;
  for (const TwoViewMatch& match : matches) movements_px.push_back((match.second_px - match.first_px).norm());
  return Quantile(std::move(movements_px), 0.75);
}

// Whether the given poses explain most of the matches that the best motion does not. Then the best motion is that of an
// object that fills most of the image, not that of the camera.
bool ExplainRest(const std::vector<bool>& by_given, const std::vector<bool>& by_best) {
  int rest = 0, explained = 0;
  for (size_t i = 0; i < by_best.size(); ++i) {
    if (by_best[i]) continue;
    ++rest;
    explained += by_given[i] ? 1 : 0;
  }
  return explained >= kMinRestMatches && explained >= kMinRestShare * rest;
}

Eigen::Vector3d RotationVector(const Eigen::Quaterniond& rotation) {
  const Eigen::AngleAxisd angle_axis(rotation);
  return angle_axis.angle() * angle_axis.axis();
}

}  // namespace

std::optional<Motion> PoseCheck::AgreeingPair::GivenMotion() const {
  const double distance_mu = T_second_first.translation().norm();
  if (!(distance_mu > 0) || matches.empty()) return std::nullopt;
  return Motion{T_second_first.RotationMatrix(), T_second_first.translation() / distance_mu};
}

std::optional<PoseCheck::AgreeingPair> PoseCheck::AddFrame(const std::shared_ptr<const FrameFeatures>& frame,
                                                           const SE3<World, Camera>& T_world_camera) {
  const CheckedFrame newest{frame, T_world_camera};
  if (!reference_) reference_ = newest;
  if (reference_->features == frame) return std::nullopt;
  Candidate candidate{
      .second = newest,
      .matches = MatchFrames(*reference_->features, *frame, kPoseCheckMatching, config_.pixel_sigma_px)};
  const bool is_lost = candidate.matches.size() < kMinPairMatches;
  std::optional<AgreeingPair> agreeing;
  if (!is_lost) {
    candidate.movement_px = UpperMovement_px(candidate.matches);
    if (candidate.movement_px > kLeastMovement * frame->camera.width_px) {
      candidate_ = candidate;
      if (ShareOf(ExplainedByGiven(*reference_, candidate)) >= kAgreeingShare) {
        agreeing = AgreeingPair{.first_frame_id = reference_->features->frame_id,
                                .T_second_first = T_world_camera.Inverse() * reference_->T_world_camera,
                                .matches = candidate.matches};
      }
    }
    if (candidate.movement_px < kMovement * frame->camera.width_px) return agreeing;
  }
  // The view of the reference may be left before the image moved enough: then less must do.
  const CheckedFrame first = std::exchange(*reference_, newest);
  const std::optional<Candidate> last = std::exchange(candidate_, std::nullopt);
  if (last) AddPair(first, *last);
  return agreeing;
}

void PoseCheck::AddPair(const CheckedFrame& first, const Candidate& last) {
  const Pair pair = Judge(first, last);
  spdlog::debug("slam: given poses of frames {} and {}: explain {:.2f} of {} matches, best {:.2f}, movement {:.0f} px",
                first.features->frame_id, last.second.features->frame_id, pair.given_share, pair.matches,
                pair.best_share, last.movement_px);
  if (!pair.agrees && !pair.fits_better) return;
  pairs_.push_back(pair);
  if (pairs_.size() > kWindowPairs) {
    pairs_.pop_front();
    has_older_pairs_ = true;
  }
  Decide();
}

std::vector<bool> PoseCheck::ExplainedByGiven(const CheckedFrame& first, const Candidate& last) const {
  const CameraModel& camera = last.second.features->camera;
  const double tolerance_px = std::max(kGivenToleranceShare * last.movement_px, kMinGivenTolerance_rad * camera.fx_px);
  return Explained(camera, ReadMotion({}, first.T_world_camera, last.second.T_world_camera), last.matches,
                   tolerance_px);
}

PoseCheck::Pair PoseCheck::Judge(const CheckedFrame& first, const Candidate& last) const {
  Pair pair{.first_frame_id = first.features->frame_id, .matches = static_cast<int>(last.matches.size())};
  const CameraModel& camera = last.second.features->camera;
  const double tolerance_px = std::max(kMinTolerance_px, kToleranceShare * last.movement_px);
  const std::vector<bool> by_given = ExplainedByGiven(first, last);
  pair.given_share = ShareOf(by_given);
  pair.agrees = pair.given_share >= kAgreeingShare;
  std::vector<bool> by_best = by_given;
  pair.best_share = pair.given_share;
  const auto compare = [&](std::vector<bool> explained) {
    const double share = ShareOf(explained);
    if (share > pair.best_share) {
      pair.best_share = share;
      by_best = std::move(explained);
    }
    return share;
  };
  for (const PoseHypothesis& hypothesis : AllPoseHypotheses()) {
    pair.shares.push_back(compare(Explained(ReadCamera(hypothesis, camera),
                                            ReadMotion(hypothesis, first.T_world_camera, last.second.T_world_camera),
                                            last.matches, tolerance_px)));
  }
  if (!pair.agrees) {
    const std::optional<SE3<Camera, Camera>> T_second_first = FindMotion(last);
    if (T_second_first && compare(Explained(camera, *T_second_first, last.matches, tolerance_px)) >= kMinBestShare) {
      const Eigen::Quaterniond given =
          last.second.T_world_camera.rotation().conjugate() * first.T_world_camera.rotation();
      pair.rotation = RotationPair{RotationVector(T_second_first->rotation()), RotationVector(given)};
    }
  }
  pair.fits_better = pair.best_share >= kMinBestShare && pair.shares.front() < kMaxGivenRatio * pair.best_share;
  pair.contradicts = pair.fits_better && pair.given_share < kMaxGivenShare &&
                     pair.given_share < kMaxGivenRatio * pair.best_share && !ExplainRest(by_given, by_best);
  return pair;
}

// The motion of the camera as the matches alone show it.
std::optional<SE3<Camera, Camera>> PoseCheck::FindMotion(const Candidate& last) const {
  const CameraModel& camera = last.second.features->camera;
  const std::vector<RayMatch> rays = ToRays(camera, last.matches);
  const auto motion =
      slam::FindMotion(camera, rays, kPoseCheckIterations, config_.Seed(last.second.features->frame_id));
  if (!motion) return std::nullopt;
  return SE3<Camera, Camera>(motion->rotation, motion->direction);
}

void PoseCheck::Decide() {
  int contradicting = 0, better = 0;
  for (const Pair& pair : pairs_) {
    better += pair.fits_better ? 1 : 0;
    contradicting += pair.contradicts ? 1 : 0;
  }
  const auto pairs = static_cast<double>(pairs_.size());
  best_ = better > 0 ? BestHypothesis() : std::nullopt;
  if (IsContradicted()) {
    if (better < kSoundShare * pairs) contradicted_since_frame_ = 0;
  } else if (best_ && better >= kMinContradictingWithBest && better >= kSoundShare * pairs) {
    contradicted_since_frame_ = FrameBefore(pairs_.begin());
  } else if (contradicting >= kMinContradicting && contradicting >= kContradictingShare * pairs) {
    const auto is_doubtful = [](const Pair& pair) { return !pair.agrees; };
    contradicted_since_frame_ = FrameBefore(std::find_if(pairs_.begin(), pairs_.end(), is_doubtful));
  }
}

// The first frame whose pose is as doubtful as those of the pair. If most pairs so far are, all frames are.
uint64_t PoseCheck::FrameBefore(std::deque<Pair>::const_iterator pair) const {
  return has_older_pairs_ ? pair->first_frame_id : 1;
}

std::optional<size_t> PoseCheck::BestHypothesis() const {
  const size_t count = AllPoseHypotheses().size();
  std::vector<double> sums(count, 0), fitting(count, 0);
  double better = 0;
  for (const Pair& pair : pairs_) {
    const double most = *std::max_element(pair.shares.begin(), pair.shares.end());
    for (size_t i = 0; i < count; ++i) {
      if (pair.shares[i] >= std::max(kMinNamedShare, kNamedRatio * most)) ++fitting[i];
      if (pair.fits_better) sums[i] += pair.shares[i];
    }
    better += pair.fits_better ? 1 : 0;
  }
  const double margin = kNamedMargin * better;
  const auto is_flip = [](size_t i) { return AllPoseHypotheses()[i].IsFlip(); };
  size_t best = static_cast<size_t>(std::max_element(sums.begin(), sums.end()) - sums.begin());
  // While the camera only rotates, flipped images look like other camera axes, which are far more common.
  const double most = sums[best];
  for (size_t i = count; is_flip(best) && i-- > 0;) {
    if (!is_flip(i) && sums[i] > most - margin) best = i;
  }
  if (fitting[best] < kNamedPairs * static_cast<double>(pairs_.size())) return std::nullopt;
  for (size_t i = 0; i < count; ++i) {
    const bool is_rival = i != best && (is_flip(best) || !is_flip(i));
    if (is_rival && sums[i] > sums[best] - margin) return std::nullopt;
  }
  return best;
}

std::optional<Eigen::Quaterniond> PoseCheck::BodyRotation() const {
  std::vector<RotationPair> rotations;
  for (const Pair& pair : pairs_) {
    if (pair.rotation) rotations.push_back(*pair.rotation);
  }
  return FindBodyRotation(rotations);
}

std::optional<Diagnostic> PoseCheck::Check() const {
  if (!IsContradicted()) return std::nullopt;
  double matches = 0, given = 0, alternative = 0;
  int pairs = 0;
  for (const Pair& pair : pairs_) {
    if (!pair.fits_better) continue;
    ++pairs;
    matches += pair.matches;
    given += pair.matches * pair.shares.front();
    if (best_) alternative += pair.matches * pair.shares[*best_];
  }
  const PoseHypothesis hypothesis = best_ ? AllPoseHypotheses()[*best_] : PoseHypothesis{};
  Diagnostic diagnostic{
      .code = "poses_contradict_images", .severity = Severity::kError, .first_frame_id = contradicted_since_frame_};
  const double given_percent = 100 * given / matches;
  const double alternative_percent = 100 * alternative / matches;
  if (hypothesis.IsCalibration()) {
    diagnostic.code = "calibration_contradicts_images";
    diagnostic.text = fmt::format(
        "the intrinsics of the camera do not fit the images and the given poses: {:.0f} % of the feature matches of {} "
        "pairs of frames agree with them; {:.0f} % agree with {} {:.2f} times as large; frames are not used while this "
        "lasts",
        given_percent, pairs, alternative_percent,
        hypothesis.resolution_factor != 1 ? "focal length and principal point" : "a focal length",
        hypothesis.resolution_factor * hypothesis.focal_factor);
    diagnostic.advice =
        "state the intrinsics of the image size that is sent: of another image size, they have to be multiplied by the "
        "ratio of the widths";
    return diagnostic;
  }
  diagnostic.text = fmt::format(
      "the given poses do not fit the images: {:.0f} % of the feature matches of {} pairs of frames agree with them",
      given_percent, pairs);
  if (best_) {
    diagnostic.text += fmt::format("; {:.0f} % agree when the {} are taken {}", alternative_percent,
                                   hypothesis.IsFlip() ? "images" : "poses", Describe(hypothesis));
    diagnostic.advice =
        hypothesis.IsFlip() ? kFlipAdvice : "run with --pose-convention " + ConventionOption(hypothesis);
  } else if (const auto R_body_camera = BodyRotation()) {
    diagnostic.text +=
        "; their rotations fit if the camera is turned by a constant rotation on the body whose poses "
        "they are";
    diagnostic.advice = fmt::format(
        "run with --pose-offset \"tx ty tz {:.3f} {:.3f} {:.3f} {:.3f}\", where tx ty tz is the position of the camera "
        "on the body, or send poses of the camera",
        R_body_camera->x(), R_body_camera->y(), R_body_camera->z(), R_body_camera->w());
  } else {
    diagnostic.advice =
        "check the calibration and the clock of the poses, and whether they are those of the camera, with x right, y "
        "down, z forward, or of a body that carries it (--pose-offset)";
  }
  diagnostic.text += "; frames are not used while this lasts";
  return diagnostic;
}

}  // namespace romap::slam
