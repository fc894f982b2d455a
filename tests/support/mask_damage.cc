#include "tests/support/mask_damage.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "client/synth/random.h"

namespace romap {
namespace {

using synth::Random;

// Each kind of fault has its own random stream, so that it does not depend on the others.
enum class Fault : uint64_t {
  kEmpty = 1,
  kDrop,
  kFlicker,
  kBorder,
  kMerge,
  kSplit,
  kLeak,
  kClassFlip,
  kFalsePositive,
  kCrowd,
  kLabels
};

Random RandomFor(uint64_t seed, Fault fault, uint64_t index, uint64_t label = 0) {
  return Random(synth::Scramble(synth::Scramble(seed) ^ index), static_cast<uint64_t>(fault) << 32 | label);
}

// The pixels of one label.
struct Region {
  cv::Rect box_px;
  int area_px = 0;
};

// Ordered by label.
std::map<uint32_t, Region> Regions(const cv::Mat& labels) {
  struct Bounds {
    int left, top, right, bottom, area_px;
  };
  std::map<uint32_t, Bounds> bounds;
  for (int v = 0; v < labels.rows; ++v) {
    const auto* row = labels.ptr<uint16_t>(v);
    for (int u = 0; u < labels.cols; ++u) {
      if (row[u] == 0) continue;
      Bounds& b = bounds.try_emplace(row[u], Bounds{u, v, u, v, 0}).first->second;
      b = {std::min(b.left, u), b.top, std::max(b.right, u), v, b.area_px + 1};
    }
  }
  std::map<uint32_t, Region> regions;
  for (const auto& [label, b] : bounds) {
    regions[label] = {cv::Rect(cv::Point(b.left, b.top), cv::Point(b.right + 1, b.bottom + 1)), b.area_px};
  }
  return regions;
}

void Paint(FrameMasks& masks, uint32_t from, uint32_t to) {
  masks.labels.setTo(static_cast<int>(to), masks.labels == static_cast<int>(from));
}

Instance* Find(FrameMasks& masks, uint32_t label) {
  const auto found = std::find_if(masks.instances.begin(), masks.instances.end(),
                                  [&](const Instance& instance) { return instance.label == label; });
  return found == masks.instances.end() ? nullptr : &*found;
}

// Adds a copy of `instance` with an unused label and without a track id; returns the label.
uint32_t AddInstance(FrameMasks& masks, Instance instance) {
  uint32_t label = 0;
  for (const Instance& other : masks.instances) label = std::max(label, other.label);
  instance.label = label + 1;
  instance.track_id.reset();
  masks.instances.push_back(instance);
  return instance.label;
}

// An image of this size, 255 in a random ellipse and 0 elsewhere.
cv::Mat Blob(const cv::Size& size, const cv::Point2d& center_px, double radius_px, Random& random) {
  cv::Mat blob = cv::Mat::zeros(size, CV_8UC1);
  const cv::Size2d axes(radius_px * random.Uniform(0.7, 1.3), radius_px * random.Uniform(0.7, 1.3));
  cv::ellipse(blob, cv::RotatedRect(center_px, axes * 2.0, static_cast<float>(random.Uniform(0, 180))), cv::Scalar(255),
              cv::FILLED);
  return blob;
}

void Drop(const MaskDamage& damage, FrameMasks& masks) {
  for (const auto& [label, region] : Regions(masks.labels)) {
    bool missed = RandomFor(damage.seed, Fault::kDrop, masks.frame_id, label).Chance(damage.drop_share);
    if (damage.flicker_frames > 0) {
      // Time is divided into windows of flicker_frames, with an offset per object. The object is missed in whole
      // windows.
      const auto frames = static_cast<uint64_t>(damage.flicker_frames);
      const uint64_t window = (masks.frame_id + synth::Scramble(label) % frames) / frames;
      missed |= RandomFor(damage.seed, Fault::kFlicker, window, label).Chance(damage.flicker_share);
    }
    if (missed) Paint(masks, label, 0);
  }
}

// Distance between the boxes, 0 when they overlap.
double Gap_px(const cv::Rect& a, const cv::Rect& b) {
  const int across = std::max({0, a.x - b.br().x, b.x - a.br().x});
  const int down = std::max({0, a.y - b.br().y, b.y - a.br().y});
  return std::hypot(across, down);
}

// Merges one of the pairs of nearest boxes into one instance.
void MergeNeighbors(const MaskDamage& damage, FrameMasks& masks) {
  Random random = RandomFor(damage.seed, Fault::kMerge, masks.frame_id);
  if (!random.Chance(damage.merge_share)) return;
  const std::map<uint32_t, Region> regions = Regions(masks.labels);
  double min_px = 1e9;
  std::vector<std::pair<uint32_t, uint32_t>> nearest;
  for (auto a = regions.begin(); a != regions.end(); ++a) {
    for (auto b = std::next(a); b != regions.end(); ++b) {
      const double gap_px = Gap_px(a->second.box_px, b->second.box_px);
      if (gap_px < min_px) nearest.clear();
      min_px = std::min(min_px, gap_px);
      if (gap_px == min_px) nearest.emplace_back(a->first, b->first);
    }
  }
  if (nearest.empty()) return;
  auto [into, from] = nearest[static_cast<size_t>(random.Below(static_cast<int>(nearest.size())))];
  if (regions.at(from).area_px > regions.at(into).area_px) std::swap(from, into);
  Paint(masks, from, into);
}

cv::Point2d Centroid(const cv::Mat& pixels) {
  const cv::Moments moments = cv::moments(pixels, /*binaryImage=*/true);
  return {moments.m10 / moments.m00, moments.m01 / moments.m00};
}

// Splits masks along a random line through their centroid.
void Split(const MaskDamage& damage, FrameMasks& masks) {
  for (const auto& [label, region] : Regions(masks.labels)) {
    Random random = RandomFor(damage.seed, Fault::kSplit, masks.frame_id, label);
    const Instance* instance = Find(masks, label);
    if (instance == nullptr || !random.Chance(damage.split_share)) continue;
    cv::Mat labels = masks.labels(region.box_px);
    const cv::Point2d middle = Centroid(labels == static_cast<int>(label));
    const double angle = random.Uniform(0, std::numbers::pi);
    const uint32_t second = AddInstance(masks, *instance);
    for (int v = 0; v < labels.rows; ++v) {
      auto* row = labels.ptr<uint16_t>(v);
      for (int u = 0; u < labels.cols; ++u) {
        const bool beyond = (u - middle.x) * std::cos(angle) + (v - middle.y) * std::sin(angle) > 0;
        if (row[u] == label && beyond) row[u] = static_cast<uint16_t>(second);
      }
    }
  }
}

void Leak(const MaskDamage& damage, FrameMasks& masks) {
  constexpr double kBlobRadius = 0.3;  // of the square root of the mask's area
  for (const auto& [label, region] : Regions(masks.labels)) {
    Random random = RandomFor(damage.seed, Fault::kLeak, masks.frame_id, label);
    if (!random.Chance(damage.leak_share)) continue;
    const cv::Mat pixels = masks.labels == static_cast<int>(label);
    if (cv::countNonZero(pixels) == 0) continue;  // completely covered by the blob of another mask
    // The last pixel of the mask on a random ray from its centroid.
    const cv::Point2d middle = Centroid(pixels);
    const double angle = random.Uniform(0, 2 * std::numbers::pi);
    const cv::Point2d outward(std::cos(angle), std::sin(angle));
    cv::Point2d border = middle;
    for (int step = 0; step < region.box_px.width + region.box_px.height; ++step) {
      const cv::Point2d position = middle + step * outward;
      const cv::Point pixel(cvRound(position.x), cvRound(position.y));
      if (pixel.inside(region.box_px) && pixels.at<uint8_t>(pixel) != 0) border = position;
    }
    const double radius_px = kBlobRadius * std::sqrt(static_cast<double>(region.area_px));
    masks.labels.setTo(static_cast<int>(label), Blob(pixels.size(), border, radius_px, random));
  }
}

// Smooth noise in -amplitude..amplitude with a wavelength of kBorderWavelength_px.
cv::Mat SmoothNoise(const cv::Size& size, double amplitude, Random& random) {
  constexpr int kBorderWavelength_px = 16;  // as in the coarse masks of neural networks
  cv::Mat coarse(size.height / kBorderWavelength_px + 3, size.width / kBorderWavelength_px + 3, CV_32FC1);
  for (auto value = coarse.begin<float>(); value != coarse.end<float>(); ++value) {
    *value = static_cast<float>(random.Uniform(-amplitude, amplitude));
  }
  cv::Mat fine;
  cv::resize(coarse, fine, {}, kBorderWavelength_px, kBorderWavelength_px, cv::INTER_LINEAR);
  const cv::Point offset(kBorderWavelength_px, kBorderWavelength_px);
  return fine(cv::Rect(offset, size));
}

// Distance of each pixel to the border of the set pixels, positive inside. The border is halfway between pixels.
cv::Mat SignedDistance_px(const cv::Mat& pixels) {
  cv::Mat inside, outside;
  cv::distanceTransform(pixels, inside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  cv::distanceTransform(pixels == 0, outside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  cv::subtract(inside, 0.5, inside, pixels);
  cv::subtract(outside, 0.5, outside, pixels == 0);
  return inside - outside;
}

// Displaces the border of each mask. A pixel inside two displaced masks is assigned to the mask in which it is farther
// from the border.
void DisplaceBorders(const MaskDamage& damage, FrameMasks& masks) {
  const int margin_px = static_cast<int>(std::ceil(damage.border_px)) + 2;
  const cv::Rect image(cv::Point(), masks.labels.size());
  cv::Mat displaced = cv::Mat::zeros(masks.labels.size(), CV_16UC1);
  cv::Mat depth_px = cv::Mat::zeros(masks.labels.size(), CV_32FC1);
  for (const auto& [label, region] : Regions(masks.labels)) {
    Random random = RandomFor(damage.seed, Fault::kBorder, masks.frame_id, label);
    const cv::Rect around = cv::Rect(region.box_px.tl() - cv::Point(margin_px, margin_px),
                                     region.box_px.br() + cv::Point(margin_px, margin_px)) &
                            image;
    const cv::Mat inside_px = SignedDistance_px(masks.labels(around) == static_cast<int>(label)) +
                              SmoothNoise(around.size(), damage.border_px, random);
    const cv::Mat deeper = inside_px > depth_px(around);
    displaced(around).setTo(static_cast<int>(label), deeper);
    inside_px.copyTo(depth_px(around), deeper);
  }
  masks.labels = displaced;
}

std::string AnyOf(const std::vector<std::string>& names, Random& random) {
  return names.empty() ? "object" : names[static_cast<size_t>(random.Below(static_cast<int>(names.size())))];
}

// Adds a blob at a random position, without the pixels of other masks; does nothing if no pixel remains.
void AddBlob(FrameMasks& masks, const std::string& class_name, double radius_px, double score, Random& random) {
  const cv::Point2d center_px(random.Uniform(0, masks.labels.cols), random.Uniform(0, masks.labels.rows));
  const cv::Mat unmasked = Blob(masks.labels.size(), center_px, radius_px, random) & (masks.labels == 0);
  if (cv::countNonZero(unmasked) == 0) return;
  const uint32_t label = AddInstance(masks, {.class_name = class_name, .score = score, .track_id = std::nullopt});
  masks.labels.setTo(static_cast<int>(label), unmasked);
}

void AddFalsePositive(const MaskDamage& damage, const std::vector<std::string>& class_names, FrameMasks& masks) {
  if (damage.false_positive_frames <= 0) return;
  const uint64_t window = masks.frame_id / static_cast<uint64_t>(damage.false_positive_frames);
  Random random = RandomFor(damage.seed, Fault::kFalsePositive, window);
  if (!random.Chance(damage.false_positive_share)) return;
  const double radius_px = masks.labels.cols * random.Uniform(0.03, 0.08);
  const std::string class_name = AnyOf(class_names, random);
  AddBlob(masks, class_name, radius_px, random.Uniform(0.3, 0.8), random);
}

void AddCrowd(const MaskDamage& damage, const std::vector<std::string>& class_names, FrameMasks& masks) {
  Random random = RandomFor(damage.seed, Fault::kCrowd, masks.frame_id);
  const auto wanted = static_cast<size_t>(std::max(damage.crowd, 0));
  const double radius_px = 0.015 * masks.labels.cols;
  for (int attempt = 0; attempt < 20 * damage.crowd && masks.instances.size() < wanted; ++attempt) {
    AddBlob(masks, AnyOf(class_names, random), radius_px, random.Uniform(0.3, 0.8), random);
  }
}

void RemoveInvisibleInstances(FrameMasks& masks) {
  const std::map<uint32_t, Region> regions = Regions(masks.labels);
  std::erase_if(masks.instances, [&](const Instance& instance) { return !regions.contains(instance.label); });
}

void FlipClasses(const MaskDamage& damage, const std::vector<std::string>& class_names, FrameMasks& masks) {
  for (Instance& instance : masks.instances) {
    Random random = RandomFor(damage.seed, Fault::kClassFlip, masks.frame_id, instance.label);
    if (!random.Chance(damage.class_flip_share)) continue;
    std::vector<std::string> others = class_names;
    std::erase(others, instance.class_name);
    if (!others.empty()) instance.class_name = AnyOf(others, random);
  }
}

void PermuteLabels(const MaskDamage& damage, FrameMasks& masks) {
  Random random = RandomFor(damage.seed, Fault::kLabels, masks.frame_id);
  double highest = 0;
  cv::minMaxLoc(masks.labels, nullptr, &highest);
  // Permutes all labels of an 8-bit image, or of a larger range if needed.
  std::vector<uint16_t> new_labels(static_cast<size_t>(std::max(highest, 255.0)) + 1);
  std::iota(new_labels.begin(), new_labels.end(), uint16_t{0});
  for (size_t i = new_labels.size() - 1; i > 1; --i) {
    std::swap(new_labels[i], new_labels[1 + static_cast<size_t>(random.Below(static_cast<int>(i)))]);
  }
  for (int v = 0; v < masks.labels.rows; ++v) {
    auto* row = masks.labels.ptr<uint16_t>(v);
    for (int u = 0; u < masks.labels.cols; ++u) row[u] = new_labels[row[u]];
  }
  for (Instance& instance : masks.instances) instance.label = new_labels[instance.label];
  // Sorted, because otherwise the order of the list would identify the objects.
  std::sort(masks.instances.begin(), masks.instances.end(),
            [](const Instance& a, const Instance& b) { return a.label < b.label; });
}

}  // namespace

MaskDamager::MaskDamager(const MaskDamage& damage, std::vector<std::string> class_names)
    : damage_(damage), class_names_(std::move(class_names)) {
  std::sort(class_names_.begin(), class_names_.end());
  class_names_.erase(std::unique(class_names_.begin(), class_names_.end()), class_names_.end());
}

std::shared_ptr<const Frame> MaskDamager::Damage(const Frame& frame) {
  auto damaged = std::make_shared<Frame>(frame);
  if (!frame.has_masks) return damaged;
  const bool runs = DetectorRuns(frame);
  FrameMasks masks;
  if (runs) masks = DamagedMasks(frame);
  damaged->has_masks = runs && damage_.late_s <= 0;
  damaged->labels = damaged->has_masks ? masks.labels : cv::Mat();
  damaged->instances = damaged->has_masks ? masks.instances : std::vector<Instance>();
  if (runs && !damaged->has_masks) {
    late_.push_back({frame.timestamp_ns + std::llround(1e9 * damage_.late_s), std::move(masks)});
  }
  return damaged;
}

std::optional<FrameMasks> MaskDamager::TakeLateMasks(int64_t now_ns) {
  if (late_.empty() || late_.front().arrival_ns > now_ns) return std::nullopt;
  FrameMasks masks = std::move(late_.front().masks);
  late_.pop_front();
  return masks;
}

bool MaskDamager::DetectorRuns(const Frame& frame) {
  if (damage_.rate_hz <= 0) return true;
  // One millisecond of tolerance, because recorded timestamps are rounded.
  const auto tick =
      static_cast<int64_t>(std::floor((1e-9 * static_cast<double>(frame.timestamp_ns) + 1e-3) * damage_.rate_hz));
  if (last_tick_ && tick <= *last_tick_) return false;
  last_tick_ = tick;
  return true;
}

FrameMasks MaskDamager::DamagedMasks(const Frame& frame) const {
  FrameMasks masks{.frame_id = frame.frame_id, .labels = frame.labels.clone(), .instances = frame.instances};
  if (RandomFor(damage_.seed, Fault::kEmpty, frame.frame_id).Chance(damage_.empty_share)) {
    masks.labels.setTo(0);
    masks.instances.clear();
    return masks;
  }
  if (damage_.drop_share > 0 || damage_.flicker_share > 0) Drop(damage_, masks);
  if (damage_.merge_share > 0) MergeNeighbors(damage_, masks);
  if (damage_.split_share > 0) Split(damage_, masks);
  if (damage_.leak_share > 0) Leak(damage_, masks);
  if (damage_.border_px > 0) DisplaceBorders(damage_, masks);
  RemoveInvisibleInstances(masks);
  if (damage_.class_flip_share > 0) FlipClasses(damage_, class_names_, masks);
  if (damage_.false_positive_share > 0) AddFalsePositive(damage_, class_names_, masks);
  if (damage_.crowd > 0) AddCrowd(damage_, class_names_, masks);
  if (damage_.permute_labels) PermuteLabels(damage_, masks);
  return masks;
}

}  // namespace romap
