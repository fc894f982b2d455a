#include "server/slam/features/feature_extractor.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <tuple>
#include <utility>

namespace romap {
namespace {

constexpr int kPatch_px = 31;  // side of the square that a descriptor looks at
constexpr int kBorder_px = 16;
constexpr int kMinImageSide_px = 2 * kBorder_px + 8;
constexpr int kSceneCell_px = 32;
constexpr int kObjectCell_px = 12;
// How many more corners are found than kept, to have some choice where there are few.
constexpr int kSurplus = 3;

using Keypoints = std::vector<cv::KeyPoint>;

cv::Ptr<cv::ORB> MakeOrb(int features, int fast_threshold) {
  return cv::ORB::create(features, static_cast<float>(kOctaveFactor), kOctaves, kBorder_px, 0, 2, cv::ORB::HARRIS_SCORE,
                         kPatch_px, fast_threshold);
}

// Takes the strongest corner of each cell, then the second of each, and so on until `count` are taken.
Keypoints Spread(const Keypoints& keypoints, int cell_px, size_t count) {
  std::map<std::pair<int, int>, Keypoints> cells;
  for (const cv::KeyPoint& keypoint : keypoints) {
    cells[{static_cast<int>(keypoint.pt.y) / cell_px, static_cast<int>(keypoint.pt.x) / cell_px}].push_back(keypoint);
  }
  size_t rounds = 0;
  for (auto& [cell, members] : cells) {
    std::stable_sort(members.begin(), members.end(),
                     [](const cv::KeyPoint& a, const cv::KeyPoint& b) { return a.response > b.response; });
    rounds = std::max(rounds, members.size());
  }
  Keypoints taken;
  for (size_t round = 0; round < rounds; ++round) {
    for (const auto& [cell, members] : cells) {
      if (taken.size() == count) return taken;
      if (round < members.size()) taken.push_back(members[round]);
    }
  }
  return taken;
}

Keypoints SceneKeypoints(const cv::Mat& grey, const SlamConfig& config) {
  Keypoints keypoints;
  MakeOrb(kSurplus * config.scene_features, config.scene_fast_threshold)->detect(grey, keypoints);
  return Spread(keypoints, kSceneCell_px, static_cast<size_t>(config.scene_features));
}

Keypoints ObjectKeypoints(const cv::Mat& grey, const cv::Mat& labels, const SlamConfig& config) {
  Keypoints keypoints;
  if (labels.empty() || config.object_features == 0) return keypoints;
  const cv::Mat mask = labels > 0;
  cv::Rect box = cv::boundingRect(mask);
  if (box.empty()) return keypoints;
  box -= cv::Point(kPatch_px, kPatch_px);
  box += cv::Size(2 * kPatch_px, 2 * kPatch_px);
  box &= cv::Rect(cv::Point(), grey.size());
  if (std::min(box.width, box.height) < kMinImageSide_px) return keypoints;

  MakeOrb(kSurplus * config.object_features, config.object_fast_threshold)->detect(grey(box), keypoints, mask(box));
  for (cv::KeyPoint& keypoint : keypoints) keypoint.pt += cv::Point2f(box.tl());
  return Spread(keypoints, kObjectCell_px, static_cast<size_t>(config.object_features));
}

// Corners that both searches found are one corner.
void DropRepeated(Keypoints& keypoints) {
  const auto key = [](const cv::KeyPoint& k) {
    return std::tuple(k.octave, static_cast<int>(std::lround(k.pt.y)), static_cast<int>(std::lround(k.pt.x)));
  };
  std::stable_sort(keypoints.begin(), keypoints.end(), [&](const auto& a, const auto& b) { return key(a) < key(b); });
  keypoints.erase(
      std::unique(keypoints.begin(), keypoints.end(), [&](const auto& a, const auto& b) { return key(a) == key(b); }),
      keypoints.end());
}

// The label under a pixel, or 0 when another one lies within `erosion_px` of it: a corner on an object's outline may
// as well be the background's.
uint16_t LabelAt(const cv::Mat& labels, const Eigen::Vector2f& pixel_px, int erosion_px) {
  if (labels.empty()) return 0;
  const int u = static_cast<int>(std::lround(pixel_px.x()));
  const int v = static_cast<int>(std::lround(pixel_px.y()));
  const cv::Rect image(0, 0, labels.cols, labels.rows);
  if (!image.contains({u, v})) return 0;
  const uint16_t label = labels.at<uint16_t>(v, u);
  const cv::Rect near = cv::Rect(u - erosion_px, v - erosion_px, 2 * erosion_px + 1, 2 * erosion_px + 1) & image;
  for (int y = near.y; y < near.br().y; ++y) {
    for (int x = near.x; x < near.br().x; ++x) {
      if (labels.at<uint16_t>(y, x) != label) return 0;
    }
  }
  return label;
}

}  // namespace

std::vector<Feature> FeatureExtractor::Extract(const Frame& frame) const {
  std::vector<Feature> features;
  if (std::min(frame.image_bgr.cols, frame.image_bgr.rows) < kMinImageSide_px) return features;
  cv::Mat grey, descriptors;
  cv::cvtColor(frame.image_bgr, grey, cv::COLOR_BGR2GRAY);

  Keypoints keypoints = SceneKeypoints(grey, config_);
  const Keypoints more = ObjectKeypoints(grey, frame.labels, config_);
  keypoints.insert(keypoints.end(), more.begin(), more.end());
  DropRepeated(keypoints);
  if (keypoints.empty()) return features;
  MakeOrb(static_cast<int>(keypoints.size()), config_.scene_fast_threshold)->compute(grey, keypoints, descriptors);

  features.reserve(keypoints.size());
  for (size_t i = 0; i < keypoints.size(); ++i) {
    const cv::KeyPoint& keypoint = keypoints[i];
    const double scale = std::pow(kOctaveFactor, keypoint.octave);
    const auto shift_px = static_cast<float>(0.5 * (scale - 1));  // to pixel centres at integer coordinates
    Feature feature{.pixel_px = {keypoint.pt.x + shift_px, keypoint.pt.y + shift_px},
                    .octave = keypoint.octave,
                    .octave_scale = scale};
    feature.label = LabelAt(frame.labels, feature.pixel_px, config_.mask_erosion_px);
    std::memcpy(feature.descriptor.data(), descriptors.ptr(static_cast<int>(i)), sizeof(Descriptor));
    features.push_back(feature);
  }
  return features;
}

}  // namespace romap
