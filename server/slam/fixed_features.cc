#include "server/slam/fixed_features.h"

#include <algorithm>
#include <optional>
#include <set>
#include <utility>

#include "common/statistics.h"
#include "server/slam/descriptor_matching.h"

namespace romap::slam {
namespace {

constexpr size_t kReferences = 3;        // motions of the scene that a fixed feature has survived
constexpr float kStay_px = 1.5F;         // accuracy of detected corners
constexpr int kMaxStayDistance = 50;     // Hamming, bits
constexpr double kMotionShare = 0.03;    // of the image's width: the scene has moved
constexpr double kSearchShare = 0.12;    // the same: larger motions are not measured
constexpr double kMotionRatio = 0.8;     // best over second best descriptor distance
constexpr size_t kSampleStep = 8;        // every such feature is searched to measure the motion
constexpr size_t kMinMotionSamples = 8;  // with fewer, the scene moved out of the search area
constexpr int kCellsAcross = 8;          // for comparing areas instead of numbers of features

int CellOf(const CameraModel& camera, const Feature& feature) {
  const auto column = static_cast<int>(kCellsAcross * feature.pixel_px.x() / static_cast<float>(camera.width_px));
  const auto row = static_cast<int>(kCellsAcross * feature.pixel_px.y() / static_cast<float>(camera.height_px));
  return row * kCellsAcross + column;
}

bool Stays(const Feature& feature, const std::vector<Feature>& others, const FeatureGrid& grid,
           std::vector<int>& near) {
  grid.Near(feature.pixel_px.cast<double>(), kStay_px, near);
  return std::any_of(near.begin(), near.end(), [&](int index) {
    const Feature& other = others[static_cast<size_t>(index)];
    return (other.pixel_px - feature.pixel_px).norm() <= kStay_px && std::abs(other.octave - feature.octave) <= 1 &&
           HammingDistance(other.descriptor, feature.descriptor) <= kMaxStayDistance;
  });
}

// Distance to the feature with the most similar descriptor around; nullopt if that is not distinct.
std::optional<double> Motion_px(const Feature& feature, const std::vector<Feature>& others, const FeatureGrid& grid,
                                double radius_px, std::vector<int>& near) {
  grid.Near(feature.pixel_px.cast<double>(), radius_px, near);
  const NearestFeature nearest = FindNearest(feature, others, near, kOctaves);
  if (!nearest.IsDistinct(kMaxStayDistance, kMotionRatio)) return std::nullopt;
  return (others[static_cast<size_t>(nearest.index)].pixel_px - feature.pixel_px).norm();
}

}  // namespace

// Most of the image must have changed: what stays may be as textured as a gripper, but it covers the smaller part.
bool FixedFeatures::HasMovedSince(const Reference& reference, const CameraModel& camera,
                                  const std::vector<Feature>& features) const {
  std::set<int> occupied;
  std::set<int> staying;
  std::vector<double> motions_px;
  std::vector<int> near;
  for (size_t i = 0; i < features.size(); i += 2) {
    const int cell = CellOf(camera, features[i]);
    occupied.insert(cell);
    if (Stays(features[i], reference.features, reference.grid, near)) {
      staying.insert(cell);
    } else if (i % kSampleStep == 0) {
      const auto motion_px =
          Motion_px(features[i], reference.features, reference.grid, kSearchShare * camera.width_px, near);
      if (motion_px) motions_px.push_back(*motion_px);
    }
  }
  if (2 * staying.size() > occupied.size()) return false;
  return motions_px.size() < kMinMotionSamples || Median(std::move(motions_px)) > kMotionShare * camera.width_px;
}

std::vector<uint8_t> FixedFeatures::Find(const CameraModel& camera, const std::vector<Feature>& features) {
  std::vector<uint8_t> fixed(features.size(), 0);
  if (features.empty()) return fixed;
  if (references_.size() == kReferences) {
    std::vector<int> near;
    for (size_t i = 0; i < features.size(); ++i) {
      const bool stayed = std::all_of(references_.begin(), references_.end(), [&](const Reference& reference) {
        return Stays(features[i], reference.features, reference.grid, near);
      });
      fixed[i] = stayed ? 1 : 0;
    }
  }
  if (!references_.empty() && !HasMovedSince(references_.back(), camera, features)) return fixed;
  references_.push_back({features, FeatureGrid(camera.width_px, camera.height_px, features)});
  if (references_.size() > kReferences) references_.pop_front();
  return fixed;
}

}  // namespace romap::slam
