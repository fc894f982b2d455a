// Compares FeatureExtractor with OpenCV's ORB on a recorded sequence that has poses and depth images.
//
//   feature_bench DIR [--every N] [--set slam.FIELD=VALUE]...
//
// Prints the user time per image, and for pairs of frames that are 1, 5, 10 and 20 frames apart: the number of matches
// (mutually nearest descriptors within kMaxMatchDistance_bits that pass kMaxMatchRatio); the share of correct matches
// among those with known depth (precision); the share of correctly matched features among those visible in both frames
// (recall); and the number of 40 x 40 pixel cells with a correct match, which shows how evenly matches are distributed.
// Every N-th frame is the first of a pair.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <map>
#include <opencv2/core/utility.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/files/sequence.h"
#include "common/config.h"
#include "common/label_png.h"
#include "server/slam/features/feature_extractor.h"
#include "tests/bench/user_seconds.h"

namespace romap::measure {
namespace {

constexpr std::array<size_t, 4> kGaps{1, 5, 10, 20};
constexpr double kCorrect_px = 4;  // true depth and pose are accurate to a pixel or two
constexpr int kCell_px = 40;

cv::Mat Decode(const std::string& bytes, int flags) {
  const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
  return cv::imdecode(raw, flags);
}

std::optional<Frame> LoadFrame(const files::Sequence& sequence, size_t index) {
  const auto input = sequence.Load(index);
  if (!input.ok() || input->depth.empty() || !input->T_world_camera) return std::nullopt;
  Frame frame;
  frame.frame_id = input->frame_id;
  frame.camera = sequence.camera();
  frame.image_bgr = Decode(input->image, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  Decode(input->depth, cv::IMREAD_UNCHANGED).convertTo(frame.depth_mu, CV_32F, input->depth_scale_mu);
  frame.has_masks = !input->label_png.empty();
  if (frame.has_masks) frame.labels = DecodeLabelPng(input->label_png).value();
  frame.T_world_camera = input->T_world_camera;
  return frame;
}

// OpenCV's ORB, as the reference.
std::vector<slam::Feature> OpenCvOrb(const Frame& frame, const slam::SlamConfig& config) {
  static const cv::Ptr<cv::ORB> orb =
      cv::ORB::create(config.scene_features, static_cast<float>(slam::kOctaveFactor), slam::kOctaves, 31, 0, 2,
                      cv::ORB::HARRIS_SCORE, 31, config.scene_fast_threshold);
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat gray, descriptors;
  cv::cvtColor(frame.image_bgr, gray, cv::COLOR_BGR2GRAY);
  orb->detectAndCompute(gray, cv::noArray(), keypoints, descriptors);
  std::vector<slam::Feature> features(keypoints.size());
  for (size_t i = 0; i < keypoints.size(); ++i) {
    const auto scale = static_cast<float>(std::pow(slam::kOctaveFactor, keypoints[i].octave));
    const float shift_px = 0.5F * (scale - 1);  // to pixel centers at integer coordinates
    features[i].pixel_px = {keypoints[i].pt.x + shift_px, keypoints[i].pt.y + shift_px};
    features[i].octave = keypoints[i].octave;
    features[i].octave_scale = scale;
    std::memcpy(features[i].descriptor.data(), descriptors.ptr(static_cast<int>(i)), sizeof(slam::Descriptor));
  }
  return features;
}

struct Nearest {
  int index = -1;
  int distance = 257;
  int second_distance = 257;
};

Nearest FindNearest(const slam::Feature& feature, const std::vector<slam::Feature>& others) {
  Nearest nearest;
  for (size_t i = 0; i < others.size(); ++i) {
    const int distance = slam::HammingDistance(feature.descriptor, others[i].descriptor);
    if (distance < nearest.distance) {
      nearest = {static_cast<int>(i), distance, nearest.distance};
    } else {
      nearest.second_distance = std::min(nearest.second_distance, distance);
    }
  }
  return nearest;
}

// The true pixel in `to` of a feature of `from`; nullopt if its depth is unknown, or if it is occluded or outside the
// image.
std::optional<Eigen::Vector2d> TruePixel(const slam::Feature& feature, const Frame& from, const Frame& to) {
  const cv::Rect image(0, 0, from.depth_mu.cols, from.depth_mu.rows);
  const auto depth_at = [&](const Frame& frame, double u, double v) -> double {
    const cv::Point pixel(static_cast<int>(std::lround(u)), static_cast<int>(std::lround(v)));
    return image.contains(pixel) ? frame.depth_mu.at<float>(pixel) : 0;
  };
  const double z_mu = depth_at(from, feature.pixel_px.x(), feature.pixel_px.y());
  if (!(z_mu > 0)) return std::nullopt;
  const Eigen::Vector3d p_from = z_mu * from.camera.Unproject(feature.pixel_px.x(), feature.pixel_px.y());
  const Eigen::Vector3d p_to = (to.T_world_camera->Inverse() * *from.T_world_camera) * p_from;
  if (p_to.z() <= 0) return std::nullopt;
  const Eigen::Vector2d pixel_px = to.camera.Project(p_to);
  const double measured_mu = depth_at(to, pixel_px.x(), pixel_px.y());
  if (!(measured_mu > 0) || std::abs(measured_mu / p_to.z() - 1) > 0.05) return std::nullopt;
  return pixel_px;
}

double Ratio(double part, double whole) { return whole > 0 ? part / whole : 0; }

struct Score {
  double pairs = 0;
  double matches = 0;
  double with_truth = 0;  // matches with a true pixel
  double correct = 0;
  double visible = 0;  // features with a true pixel
  double repeated = 0;
  double cells = 0;
  double error_px = 0;
};

// Adds the matches of one pair of frames to the score.
void AddPair(const std::vector<slam::Feature>& first, const Frame& first_frame,
             const std::vector<slam::Feature>& second, const Frame& second_frame, Score& score) {
  std::set<std::pair<int, int>> cells;
  for (size_t i = 0; i < first.size(); ++i) {
    const std::optional<Eigen::Vector2d> true_px = TruePixel(first[i], first_frame, second_frame);
    score.visible += true_px ? 1 : 0;
    const Nearest match = FindNearest(first[i], second);
    if (match.index < 0 || match.distance > slam::kMaxMatchDistance_bits ||
        match.distance >= slam::kMaxMatchRatio * match.second_distance) {
      continue;
    }
    const slam::Feature& other = second[static_cast<size_t>(match.index)];
    if (FindNearest(other, first).index != static_cast<int>(i)) continue;
    score.matches += 1;
    if (!true_px) continue;
    score.with_truth += 1;
    const double error_px = (other.pixel_px.cast<double>() - *true_px).norm();
    if (error_px > kCorrect_px) continue;
    score.error_px += error_px;
    score.correct += 1;
    cells.emplace(static_cast<int>(first[i].pixel_px.x()) / kCell_px,
                  static_cast<int>(first[i].pixel_px.y()) / kCell_px);
  }
  score.cells += static_cast<double>(cells.size());
  score.pairs += 1;
}

using Extract = std::function<std::vector<slam::Feature>(const Frame&)>;

struct Cost {
  double images = 0;
  double features = 0;
  double user_s = 0;

  std::vector<slam::Feature> Measure(const Extract& extract, const Frame& frame) {
    const double start_s = UserSeconds();
    std::vector<slam::Feature> result = extract(frame);
    user_s += UserSeconds() - start_s;
    images += 1;
    features += static_cast<double>(result.size());
    return result;
  }
  void Print(const char* name) const {
    std::printf("%-14s %6.0f features, %5.2f ms user time per image\n", name, features / images, 1e3 * user_s / images);
  }
};

void MeasurePairs(const char* name, const files::Sequence& sequence, size_t every, const Extract& extract) {
  std::map<size_t, Score> scores;
  Cost cost;
  for (size_t i = 0; i < sequence.size(); i += every) {
    const std::optional<Frame> first = LoadFrame(sequence, i);
    if (!first) continue;
    const std::vector<slam::Feature> features = cost.Measure(extract, *first);
    for (const size_t gap : kGaps) {
      const std::optional<Frame> second = i + gap < sequence.size() ? LoadFrame(sequence, i + gap) : std::nullopt;
      if (second) AddPair(features, *first, cost.Measure(extract, *second), *second, scores[gap]);
    }
  }
  cost.Print(name);
  for (const auto& [gap, score] : scores) {
    std::printf(
        "  %2zu frames apart: %6.1f matches, %6.1f correct, precision %.3f, recall %.3f, %5.1f cells, error %.2f px\n",
        gap, score.matches / score.pairs, score.correct / score.pairs, Ratio(score.correct, score.with_truth),
        Ratio(score.correct, score.visible), score.cells / score.pairs, Ratio(score.error_px, score.correct));
  }
}

// Measures the cost of the additional object features of a keyframe.
void MeasureObjectFeatures(const files::Sequence& sequence, size_t every, slam::FeatureExtractor& extractor) {
  Cost cost;
  for (size_t i = 0; i < sequence.size(); i += every) {
    const std::optional<Frame> frame = LoadFrame(sequence, i);
    if (!frame || !frame->has_masks) continue;
    const std::vector<slam::Feature> scene = extractor.ExtractScene(*frame);
    cost.Measure([&](const Frame& f) { return extractor.ExtractObjects(f, scene); }, *frame);
  }
  if (cost.images > 0) cost.Print("romap objects");
}

int Main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: feature_bench DIR [--every N] [--set slam.FIELD=VALUE]...\n");
    return 2;
  }
  slam::SlamConfig config;
  ConfigFields fields;
  fields.Section("slam");
  config.Fields(fields);
  std::vector<std::string> assignments;
  size_t every = 25;
  for (int i = 2; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--every") == 0) every = std::stoul(argv[i + 1]);
    if (std::strcmp(argv[i], "--set") == 0) assignments.emplace_back(argv[i + 1]);
  }
  const absl::Status status = fields.Load("", assignments);
  const auto sequence = files::Sequence::Open(argv[1], {.use_depth = true});
  if (!status.ok() || !sequence.ok()) {
    std::fprintf(stderr, "feature_bench: %s\n", Message(status.ok() ? sequence.status() : status).c_str());
    return 1;
  }
  cv::setNumThreads(1);
  slam::FeatureExtractor extractor(config);
  MeasurePairs("OpenCV", *sequence, every, [&](const Frame& frame) { return OpenCvOrb(frame, config); });
  MeasurePairs("romap", *sequence, every, [&](const Frame& frame) { return extractor.ExtractScene(frame); });
  MeasureObjectFeatures(*sequence, every, extractor);
  return 0;
}

}  // namespace
}  // namespace romap::measure

int main(int argc, char** argv) { return romap::measure::Main(argc, argv); }
