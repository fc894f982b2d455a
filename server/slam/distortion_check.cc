#include "server/slam/distortion_check.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <set>
#include <vector>

#include "common/lens.h"
#include "common/statistics.h"
#include "server/slam/geometry/epipolar.h"

namespace romap::slam {
namespace {

constexpr size_t kDistortionWindowPairs = 24;
constexpr size_t kMinDistortionPairs = 6;
constexpr size_t kMinDistortionReferences = 3;  // first frames of the pairs, whose noise they have in common
// A distortion that hardly moves the features, or noisy poses, let both distances be nearly the same.
constexpr double kMinDistortionRatio = 1.1;
constexpr double kSuspectDistortionRatio = 1.03;       // of the medians, if something is wrong anyway
constexpr double kContradictingDistortionShare = 0.8;  // of the pairs
// Of the image width: 1.6 px of 640. If larger distances are left without the distortion, not it alone is wrong.
constexpr double kExactDistortionDistance = 1.6 / 640;

}  // namespace

void DistortionCheck::AddPair(const CameraModel& source_camera, const PoseCheck::AgreeingPair& pair) {
  const std::optional<Motion> motion = pair.GivenMotion();
  if (!source_camera.HasDistortion() || !motion) return;
  camera_ = source_camera;
  const CameraModel pinhole = source_camera.Pinhole();
  std::vector<TwoViewMatch> in_image = pair.matches;
  for (TwoViewMatch& match : in_image) {
    match.first_px = DistortPixel(source_camera, match.first_px);
    match.second_px = DistortPixel(source_camera, match.second_px);
  }
  pairs_.push_back(
      {.first_frame_id = pair.first_frame_id,
       .with = MedianEpipolarDistance_px(pinhole, *motion, ToRays(pinhole, pair.matches)) / pinhole.width_px,
       .without = MedianEpipolarDistance_px(pinhole, *motion, ToRays(pinhole, in_image)) / pinhole.width_px});
  spdlog::debug("slam: the matches are {:.2f} px from their epipolar lines with the lens distortion, {:.2f} px without",
                pairs_.back().with * pinhole.width_px, pairs_.back().without * pinhole.width_px);
  if (pairs_.size() > kDistortionWindowPairs) {
    pairs_.pop_front();
    has_older_pairs_ = true;
  }
  if (!PairsContradict()) {
    contradicted_since_frame_ = 0;
  } else if (contradicted_since_frame_ == 0) {
    contradicted_since_frame_ = has_older_pairs_ ? pairs_.front().first_frame_id : 1;
  }
}

bool DistortionCheck::PairsContradict() const {
  std::set<uint64_t> references;
  size_t contradicting = 0;
  for (const Pair& pair : pairs_) {
    references.insert(pair.first_frame_id);
    contradicting += pair.with > kMinDistortionRatio * pair.without ? 1 : 0;
  }
  return pairs_.size() >= kMinDistortionPairs && references.size() >= kMinDistortionReferences &&
         static_cast<double>(contradicting) >= kContradictingDistortionShare * static_cast<double>(pairs_.size()) &&
         MedianOf_px(&Pair::without) < kExactDistortionDistance * camera_.width_px;
}

double DistortionCheck::MedianOf_px(double Pair::*distance) const {
  std::vector<double> distances;
  for (const Pair& pair : pairs_) distances.push_back(pair.*distance);
  return Median(std::move(distances)) * camera_.width_px;
}

bool DistortionCheck::IsSuspect() const {
  return pairs_.size() >= kMinDistortionPairs &&
         MedianOf_px(&Pair::with) > kSuspectDistortionRatio * MedianOf_px(&Pair::without);
}

std::optional<Diagnostic> DistortionCheck::Check() const {
  if (pairs_.empty()) return std::nullopt;
  return Diagnostic{
      .code = "calibration_contradicts_images",
      .severity = Severity::kError,
      .first_frame_id = contradicted_since_frame_,
      .text = fmt::format(
          "the lens distortion of the camera does not fit the images and the given poses: half of the feature matches "
          "of {} pairs of frames are more than {:.2f} px off their epipolar lines, and {:.2f} px without distortion; "
          "frames are not used while this lasts",
          pairs_.size(), MedianOf_px(&Pair::with), MedianOf_px(&Pair::without)),
      .advice = "state no distortion if the images were undistorted before"};
}

}  // namespace romap::slam
