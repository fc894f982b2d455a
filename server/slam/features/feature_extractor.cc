#include "server/slam/features/feature_extractor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "common/label_image.h"
#include "common/lens.h"
#include "server/slam/features/steered_brief.h"

namespace romap::slam {
namespace {

constexpr int kMinImageSide_px = 2 * kPatchBorder_px + 8;
// Corners of one octave closer to each other than this (pixels of the octave) are duplicates.
constexpr double kSameCorner_px = 2;

const std::array<double, kOctaves> kOctaveScales = [] {
  std::array<double, kOctaves> scales{};
  for (size_t i = 0; i < scales.size(); ++i) scales[i] = std::pow(kOctaveFactor, i);
  return scales;
}();

cv::Rect DescribableArea(const cv::Mat& image) {
  return {kPatchBorder_px, kPatchBorder_px, image.cols - 2 * kPatchBorder_px, image.rows - 2 * kPatchBorder_px};
}

// Also false for NaN.
bool IsInside(const CameraModel& camera, const Eigen::Vector2f& pixel_px) {
  return pixel_px.x() >= 0 && pixel_px.y() >= 0 && pixel_px.x() <= static_cast<float>(camera.width_px - 1) &&
         pixel_px.y() <= static_cast<float>(camera.height_px - 1);
}

bool IsSet(const cv::Mat& mask, const Eigen::Vector2f& pixel_px) {
  return mask.at<uint8_t>(static_cast<int>(std::lround(pixel_px.y())), static_cast<int>(std::lround(pixel_px.x()))) !=
         0;
}

// Marks the pixels around a feature as not free.
void MarkOccupied(cv::Mat& free, const Feature& feature) {
  const auto radius_px = static_cast<float>(kSameCorner_px * feature.octave_scale);
  const Eigen::Vector2f begin_px = feature.pixel_px.array() - radius_px;
  const int side_px = static_cast<int>(std::ceil(2 * radius_px));
  const cv::Rect around(static_cast<int>(std::lround(begin_px.x())), static_cast<int>(std::lround(begin_px.y())),
                        side_px, side_px);
  free(around & cv::Rect(cv::Point(), free.size())).setTo(0);
}

// Number of features of `octave` if `remaining` features are distributed over it and all finer octaves, in proportion
// to the side lengths of their images. Coarse corners are fewer, but visible from farther away.
size_t OctaveShare(size_t remaining, int octave) {
  double sum = 0;
  for (int i = 0; i <= octave; ++i) sum += 1 / kOctaveScales[static_cast<size_t>(i)];
  return static_cast<size_t>(
      std::lround(static_cast<double>(remaining) / (kOctaveScales[static_cast<size_t>(octave)] * sum)));
}

}  // namespace

void FeatureExtractor::Prepare(const Frame& frame) {
  const cv::Mat& source = frame.source_gray.empty() ? frame.image_bgr : frame.source_gray;
  if (image_.data == source.data && image_.size() == source.size() && image_frame_id_ == frame.frame_id) return;
  image_ = source;
  image_frame_id_ = frame.frame_id;
  if (source.channels() == 3) cv::cvtColor(source, gray_, cv::COLOR_BGR2GRAY);
  pyramid_.Build(source.channels() == 3 ? gray_ : source, kMinImageSide_px);
}

std::vector<Eigen::Vector2f> FeatureExtractor::PinholePixels(const Frame& frame, int octave,
                                                             const Corners& corners) const {
  std::vector<Eigen::Vector2f> pixels_px;
  pixels_px.reserve(corners.size());
  for (const cv::KeyPoint& corner : corners) pixels_px.push_back(pyramid_.ToFullSize(octave, corner.pt));
  return frame.source_gray.empty() ? pixels_px : UndistortPixels(frame.source_camera, pixels_px);
}

Corners FeatureExtractor::KeepVisible(const Frame& frame, int octave, const Corners& corners,
                                      const cv::Mat& free) const {
  const std::vector<Eigen::Vector2f> pixels_px = PinholePixels(frame, octave, corners);
  Corners visible;
  for (size_t i = 0; i < corners.size(); ++i) {
    if (IsInside(frame.camera, pixels_px[i]) && (free.empty() || IsSet(free, pixels_px[i])))
      visible.push_back(corners[i]);
  }
  return visible;
}

// Starts with the coarsest octave, so that the finer ones, which have more corners, compensate for missing features.
std::vector<FeatureExtractor::Candidate> FeatureExtractor::FindInOctaves(const Frame& frame, int count,
                                                                         const FindCorners& find) const {
  std::vector<Candidate> candidates;
  for (int octave = pyramid_.octaves() - 1; octave >= 0; --octave) {
    const Corners corners = find(octave, OctaveShare(static_cast<size_t>(count) - candidates.size(), octave));
    const std::vector<Eigen::Vector2f> pixels_px = PinholePixels(frame, octave, corners);
    for (size_t i = 0; i < corners.size(); ++i) candidates.push_back({corners[i].pt, octave, pixels_px[i]});
  }
  return candidates;
}

std::vector<Feature> FeatureExtractor::ExtractScene(const Frame& frame) {
  Prepare(frame);
  const auto find = [&](int octave, size_t count) {
    const cv::Mat& image = pyramid_.sharp(octave);
    Corners corners = DetectCornersEverywhere(image, DescribableArea(image), config_.scene_fast_threshold,
                                              config_.scene_fast_min_threshold);
    if (!frame.source_gray.empty()) corners = KeepVisible(frame, octave, corners, {});
    return SpreadEvenly(std::move(corners), image.size(), count);
  };
  return Describe(frame, FindInOctaves(frame, config_.scene_features, find));
}

std::vector<Feature> FeatureExtractor::ExtractObjects(const Frame& frame, const std::vector<Feature>& existing) {
  if (frame.labels.empty() || config_.object_features == 0) return {};
  const cv::Mat inside = frame.labels > 0;
  cv::Rect box_px = cv::boundingRect(inside);
  if (box_px.empty()) return {};
  Prepare(frame);
  // With distortion, the masks of the pinhole image do not apply to the source image.
  if (!frame.source_gray.empty()) box_px = cv::Rect(cv::Point(), frame.source_gray.size());
  cv::Mat free;
  const auto find = [&](int octave, size_t count) {
    inside.copyTo(free);
    for (const Feature& feature : existing) {
      if (feature.octave == octave) MarkOccupied(free, feature);
    }
    const cv::Mat& image = pyramid_.sharp(octave);
    const cv::Rect part = DescribableArea(image) & pyramid_.Part(octave, box_px);
    const Corners corners = DetectCorners(image, part, config_.object_fast_threshold);
    return SpreadEvenly(KeepVisible(frame, octave, corners, free), image.size(), count);
  };
  return Describe(frame, FindInOctaves(frame, config_.object_features, find));
}

std::vector<Feature> FeatureExtractor::Extract(const Frame& frame) {
  std::vector<Feature> features = ExtractScene(frame);
  const std::vector<Feature> object_features = ExtractObjects(frame, features);
  features.insert(features.end(), object_features.begin(), object_features.end());
  return features;
}

std::vector<Feature> FeatureExtractor::Describe(const Frame& frame, const std::vector<Candidate>& candidates) {
  std::vector<Feature> features;
  features.reserve(candidates.size());
  for (const Candidate& candidate : candidates) {
    const double scale = kOctaveScales[static_cast<size_t>(candidate.octave)];
    const auto x_px = static_cast<int>(candidate.corner_px.x);
    const auto y_px = static_cast<int>(candidate.corner_px.y);
    const PatchDirection direction = IntensityCentroid(pyramid_.sharp(candidate.octave), x_px, y_px);
    features.push_back({.pixel_px = candidate.pixel_px,
                        .octave = candidate.octave,
                        .octave_scale = scale,
                        .angle_rad = std::atan2(direction.sine, direction.cosine),
                        .label = LabelAt(frame.labels, candidate.pixel_px,
                                         static_cast<int>(std::lround(config_.mask_erosion_px * scale))),
                        .descriptor = SteeredBrief(pyramid_.smooth(candidate.octave), x_px, y_px, direction)});
  }
  return features;
}

}  // namespace romap::slam
