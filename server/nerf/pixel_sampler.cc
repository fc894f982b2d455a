#include "server/nerf/pixel_sampler.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "server/nerf/math/random.h"

namespace romap::nerf {
namespace {

// A full training reads about 100 000 object pixels, not counting partners. More pixels than this are thinned evenly.
constexpr double kMaxObjectPixels = 1 << 17;
constexpr double kPairDistance = 0.1;  // mean distance between paired pixels, in square roots of the mask's area
constexpr int kBackgroundBand_px = 6;  // background rays pass through a band of this width around the mask
constexpr int kBorder_px = 2;          // object pixels this close to pixels of another kind belong to the border

cv::Mat KindMask(const ObjectView& view, RayKind kind) { return view.ray_kind == static_cast<int>(kind); }

cv::Mat Square(int reach_px) { return cv::getStructuringElement(cv::MORPH_RECT, {2 * reach_px + 1, 2 * reach_px + 1}); }

TrainingPixel PixelAt(const ObjectView& view, uint16_t view_index, int x, int y, float z_mu) {
  const cv::Vec3b& bgr = view.color_bgr.at<cv::Vec3b>(y, x);
  return {view_index,
          static_cast<uint16_t>(x + view.roi_px.x),
          static_cast<uint16_t>(y + view.roi_px.y),
          {bgr[2], bgr[1], bgr[0]},
          std::isfinite(z_mu) ? z_mu : 0.0f};
}

}  // namespace

PixelSampler::PixelSampler(const NerfConfig& config, uint64_t seed)
    : config_(config), seed_(seed), rays_per_slot_(config.contrast_weight > 0 ? 2 : 1) {
  object_.salt = 1;
  background_.salt = 2;
  sparse_.salt = 3;
}

void PixelSampler::Build(std::span<const ObjectView> views, const InputQuality& quality) {
  for (PixelKind* kind : {&object_, &background_, &sparse_}) {
    kind->pixels.clear();
    kind->first_of_group.assign(1, 0);
  }
  double object_pixels = 0;
  for (const ObjectView& view : views) object_pixels += cv::countNonZero(KindMask(view, RayKind::kObject));
  const double keep_share = std::min(1.0, kMaxObjectPixels / std::max(1.0, object_pixels));
  for (size_t i = 0; i < views.size(); ++i) {
    CollectPixels(views[i], static_cast<uint16_t>(i), keep_share, quality);
    CollectMapPoints(views[i], static_cast<uint16_t>(i));
  }
  for (PixelKind* kind : {&object_, &background_, &sparse_}) kind->pixels.shrink_to_fit();
  const int rays = config_.rays_per_step;
  const int background = background_.pixels.empty() ? 0 : static_cast<int>(rays * config_.background_share);
  // The few map points would be repeated in every step, so their number limits their share of the rays.
  const int sparse =
      std::min(static_cast<int>(rays * config_.sparse_depth_share), static_cast<int>(sparse_.pixels.size() / 8));
  background_.SetRays(background / rays_per_slot_ * rays_per_slot_, seed_);
  sparse_.SetRays(sparse / rays_per_slot_ * rays_per_slot_, seed_);
  const int left = rays - background_.rays() - sparse_.rays();
  object_.SetRays((left + rays_per_slot_ - 1) / rays_per_slot_, seed_);
  Weigh(std::vector<float>(views.size(), 1.0f));
}

void PixelSampler::CollectPixels(const ObjectView& view, uint16_t view_index, double keep_share,
                                 const InputQuality& quality) {
  const bool use_depth = quality.depth_is_consistent;
  const cv::Mat is_object = KindMask(view, RayKind::kObject);
  const cv::Rect bounds = cv::boundingRect(is_object);
  cv::Mat near_object, inside;
  cv::dilate(is_object, near_object, Square(kBackgroundBand_px + quality.mask_border_px));
  cv::erode(is_object, inside, Square(kBorder_px), {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(255));
  std::array<std::vector<TrainingPixel>, kTiles> tiles;
  const double distance_px = std::clamp(kPairDistance * std::sqrt(cv::countNonZero(is_object)), 1.5, 80.0);
  for (int y = 0; y < view.roi_px.height; ++y) {
    for (int x = 0; x < view.roi_px.width; ++x) {
      const bool object = is_object.at<uint8_t>(y, x) != 0;
      const bool band = near_object.at<uint8_t>(y, x) != 0 &&
                        view.ray_kind.at<uint8_t>(y, x) == static_cast<uint8_t>(RayKind::kBackground);
      if (!object && !band) continue;
      const uint64_t key = view.keyframe.value * 0x100000000ull + static_cast<uint64_t>(y) * 0x10000ull + x;
      if (RandomUniform(seed_, 4, key) >= keep_share) continue;
      if (band) {
        background_.pixels.push_back(PixelAt(view, view_index, x, y, 0));
        continue;
      }
      const int column = (x - bounds.x) * kTilesPerSide / bounds.width;
      const int row = (y - bounds.y) * kTilesPerSide / bounds.height;
      const int tile = inside.at<uint8_t>(y, x) != 0 ? row * kTilesPerSide + column : kBorderTile;
      const float z_mu = !use_depth || view.depth_mu.empty() ? 0 : view.depth_mu.at<float>(y, x);
      TrainingPixel pixel = PixelAt(view, view_index, x, y, z_mu);
      if (rays_per_slot_ == 2) pixel.partner = FindPartner(view, is_object, {x, y}, distance_px, key, use_depth);
      tiles[static_cast<size_t>(tile)].push_back(pixel);
    }
  }
  for (const std::vector<TrainingPixel>& tile : tiles) {
    object_.pixels.insert(object_.pixels.end(), tile.begin(), tile.end());
    object_.CloseGroup();
  }
  background_.CloseGroup();
}

// An object pixel about `distance_px` away, in a random direction drawn from `key`. No partner if none is found.
PartnerPixel PixelSampler::FindPartner(const ObjectView& view, const cv::Mat& is_object, cv::Point at,
                                       double distance_px, uint64_t key, bool use_depth) const {
  constexpr int kTries = 4;  // at the border, most directions leave the object
  for (uint64_t attempt = 0; attempt < kTries; ++attempt) {
    const double angle_rad = 2 * M_PI * RandomUniform(seed_, 40 + 2 * attempt, key);
    const double length_px = distance_px * (0.5 + RandomUniform(seed_, 41 + 2 * attempt, key));
    const cv::Point step(cvRound(length_px * std::cos(angle_rad)), cvRound(length_px * std::sin(angle_rad)));
    const cv::Point to = at + step;
    if (step == cv::Point() || !cv::Rect({0, 0}, is_object.size()).contains(to)) continue;
    if (is_object.at<uint8_t>(to) == 0) continue;
    const float z_mu = !use_depth || view.depth_mu.empty() ? 0 : view.depth_mu.at<float>(to);
    const TrainingPixel found = PixelAt(view, 0, to.x, to.y, z_mu);
    return {static_cast<int8_t>(step.x), static_cast<int8_t>(step.y), found.rgb, found.z_mu};
  }
  return {};
}

void PixelSampler::CollectMapPoints(const ObjectView& view, uint16_t view_index) {
  const cv::Rect crop({0, 0}, view.roi_px.size());
  for (const Eigen::Vector3f& point : view.sparse_depth) {
    if (!point.allFinite() || point.z() <= 0) continue;
    const cv::Point at(cvRound(point.x()) - view.roi_px.x, cvRound(point.y()) - view.roi_px.y);
    if (!crop.contains(at)) continue;
    if (view.ray_kind.at<uint8_t>(at) != static_cast<uint8_t>(RayKind::kObject)) continue;
    sparse_.pixels.push_back(PixelAt(view, view_index, at.x, at.y, point.z()));
  }
  sparse_.CloseGroup();
}

void PixelSampler::Weigh(std::span<const float> views) {
  std::vector<float> tiles(views.size() * kTiles);
  for (size_t i = 0; i < tiles.size(); ++i) tiles[i] = views[i / kTiles];
  object_.SetWeights(tiles);
  background_.SetWeights(views);
  sparse_.SetWeights(views);
}

void PixelSampler::PixelKind::SetRays(int rays, uint64_t seed) {
  slots.resize(static_cast<size_t>(rays));
  for (size_t i = 0; i < slots.size(); ++i) slots[i] = {RandomBits(seed, 16 + salt, i), 0};
}

void PixelSampler::PixelKind::SetWeights(std::span<const float> group_weights) {
  parts.clear();
  double length = 0;
  for (size_t group = 0; group < group_weights.size(); ++group) {
    const uint32_t first = first_of_group[group], end = first_of_group[group + 1];
    const double weight = group_weights[group];
    if (first == end || weight <= 0) continue;
    const double until = length + (end - first) * weight;
    parts.push_back({length, until, 1 / weight, first, end - 1});
    length = until;
  }
  if (parts.empty() && !pixels.empty()) return SetWeights(std::vector<float>(group_weights.size(), 1.0f));
  for (Part& part : parts) {
    part.from /= length;
    part.until /= length;
    part.pixels_per_length *= length;
  }
  uint32_t at = 0;
  for (size_t slot = 0; slot < slots.size(); ++slot) {
    while (at + 1 < parts.size() && parts[at].until <= static_cast<double>(slot) / rays()) ++at;
    slots[slot].part = at;
  }
}

const TrainingPixel& PixelSampler::PixelKind::At(uint64_t step, int index) const {
  constexpr uint64_t kGoldenRatio = 0x9e3779b97f4a7c15ull;  // fractional part, in units of 2^-64
  const Slot& slot = slots[static_cast<size_t>(index)];
  const double position = (index + static_cast<double>((slot.phase + step * kGoldenRatio) >> 11) * 0x1p-53) / rays();
  size_t at = slot.part;
  while (at + 1 < parts.size() && parts[at].until <= position) ++at;
  const Part& part = parts[at];
  const double pixel = std::max(0.0, position - part.from) * part.pixels_per_length;
  return pixels[std::min(part.last, part.first + static_cast<uint32_t>(pixel))];
}

std::vector<const TrainingPixel*> PixelSampler::PixelKind::EvenlySpaced(size_t group, size_t count) const {
  std::vector<const TrainingPixel*> chosen;
  const size_t first = first_of_group[group], size = first_of_group[group + 1] - first, taken = std::min(count, size);
  for (size_t i = 0; i < taken; ++i) chosen.push_back(&pixels[first + (2 * i + 1) * size / (2 * taken)]);
  return chosen;
}

PixelSampler::Choice PixelSampler::At(uint64_t step, int index) const {
  if (index < background_.rays()) return {background_.At(step, index), false};
  index -= background_.rays();
  if (index < sparse_.rays()) return {sparse_.At(step, index), true};
  index -= sparse_.rays();
  const TrainingPixel& pixel = object_.At(step, index / rays_per_slot_);
  const bool paired = rays_per_slot_ == 2 && (pixel.partner.du_px != 0 || pixel.partner.dv_px != 0);
  if (index % rays_per_slot_ == 0) return {pixel, true, paired ? 1 : 0};
  return {paired ? pixel.Partner() : pixel, true, paired ? -1 : 0};
}

}  // namespace romap::nerf
