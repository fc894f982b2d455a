#include "server/nerf/ray_set.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "server/nerf/math/random.h"

namespace romap {
namespace {

// A full training reads about 150 000 object rays; more pixels than this are thinned out evenly.
constexpr double kMostObjectPixels = 1 << 18;

cv::Mat KindMask(const ObjectView& view, RayKind kind) { return view.ray_kind == static_cast<int>(kind); }

}  // namespace

void RaySet::Build(std::span<const ObjectView> views, const TrainingBox& box) {
  cameras_.clear();
  object_.clear();
  background_.clear();
  sparse_.clear();
  unit_mu_ = static_cast<float>(box.unit_mu);
  const SE3<Object, World> T_object_world = box.T_world_object.Inverse();
  double object_pixels = 0;
  for (const ObjectView& view : views) object_pixels += cv::countNonZero(KindMask(view, RayKind::kObject));
  const double keep_share = std::min(1.0, kMostObjectPixels / std::max(1.0, object_pixels));
  for (const ObjectView& view : views) {
    const SE3<Object, Camera> T_object_camera = T_object_world * view.T_world_camera;
    cameras_.push_back({box.ToUnit(T_object_camera.translation()).cast<float>(),
                        T_object_camera.RotationMatrix().cast<float>(), static_cast<float>(view.camera.fx_px),
                        static_cast<float>(view.camera.fy_px), static_cast<float>(view.camera.cx_px),
                        static_cast<float>(view.camera.cy_px)});
    CollectPixels(view, static_cast<uint16_t>(cameras_.size() - 1), keep_share);
  }
  Shuffle(object_, 1);
  Shuffle(background_, 2);
  Shuffle(sparse_, 3);
  background_rays_ = background_.empty() ? 0 : static_cast<int>(config_.rays_per_step * config_.background_share);
  // A map point is seen again and again, so their share is bounded by how many there are.
  const int most_sparse = static_cast<int>(config_.rays_per_step * config_.sparse_depth_share);
  sparse_rays_ = std::min(most_sparse, static_cast<int>(sparse_.size() / 8));
}

void RaySet::CollectPixels(const ObjectView& view, uint16_t view_index, double keep_share) {
  const cv::Mat is_object = KindMask(view, RayKind::kObject);
  const int size_px = 2 * config_.background_band_px + 1;
  cv::Mat near_object;
  cv::dilate(is_object, near_object, cv::getStructuringElement(cv::MORPH_RECT, {size_px, size_px}));
  const auto pixel = [&](int x, int y, float z_mu) {
    const cv::Vec3b& bgr = view.color_bgr.at<cv::Vec3b>(y, x);
    return Pixel{view_index,
                 static_cast<uint16_t>(x + view.roi_px.x),
                 static_cast<uint16_t>(y + view.roi_px.y),
                 {bgr[2], bgr[1], bgr[0]},
                 z_mu};
  };
  for (int y = 0; y < view.roi_px.height; ++y) {
    for (int x = 0; x < view.roi_px.width; ++x) {
      const bool object = is_object.at<uint8_t>(y, x) != 0;
      const bool band = near_object.at<uint8_t>(y, x) != 0 &&
                        view.ray_kind.at<uint8_t>(y, x) == static_cast<uint8_t>(RayKind::kBackground);
      if (!object && !band) continue;
      const uint64_t key = view.keyframe.value * 0x100000000ull + static_cast<uint64_t>(y) * 0x10000ull + x;
      if (nerf::RandomUniform(seed_, 4, key) >= keep_share) continue;
      const float z_mu = object && !view.depth_mu.empty() ? view.depth_mu.at<float>(y, x) : 0.0f;
      (object ? object_ : background_).push_back(pixel(x, y, std::isfinite(z_mu) ? z_mu : 0.0f));
    }
  }
  for (const Eigen::Vector3f& point : view.sparse_depth) {
    const cv::Point at(cvRound(point.x()) - view.roi_px.x, cvRound(point.y()) - view.roi_px.y);
    if (!point.allFinite() || point.z() <= 0 || !cv::Rect({0, 0}, view.roi_px.size()).contains(at)) continue;
    if (is_object.at<uint8_t>(at) != 0) sparse_.push_back(pixel(at.x, at.y, point.z()));
  }
}

void RaySet::Shuffle(std::vector<Pixel>& pixels, uint64_t salt) const {
  for (size_t i = pixels.size(); i > 1; --i) {
    std::swap(pixels[i - 1], pixels[nerf::RandomBits(seed_, 16 + salt, i) % i]);
  }
}

nerf::Ray RaySet::Get(uint64_t step, int index) const {
  const auto next = [&](const std::vector<Pixel>& pixels, int per_step, int offset) -> const Pixel& {
    return pixels[(step * static_cast<uint64_t>(per_step) + static_cast<uint64_t>(offset)) % pixels.size()];
  };
  const bool is_background = index < background_rays_;
  const int sparse_end = background_rays_ + sparse_rays_;
  const Pixel& pixel = is_background        ? next(background_, background_rays_, index)
                       : index < sparse_end ? next(sparse_, sparse_rays_, index - background_rays_)
                                            : next(object_, config_.rays_per_step - sparse_end, index - sparse_end);
  const ViewCamera& camera = cameras_[pixel.view];
  const Eigen::Vector3f direction_camera((pixel.u_px - camera.cx_px) / camera.fx_px,
                                         (pixel.v_px - camera.cy_px) / camera.fy_px, 1.0f);
  const float norm = direction_camera.norm();
  const Eigen::Vector3f direction = camera.R_object_camera * (direction_camera / norm);
  nerf::Ray ray;
  for (int a = 0; a < 3; ++a) {
    ray.origin[a] = camera.origin_unit[a];
    ray.direction[a] = direction[a];
    ray.target.rgb[a] = pixel.rgb[a] * (1.0f / 255.0f);
  }
  ray.jitter = nerf::RandomUniform(seed_, step, 8 * static_cast<uint64_t>(index));
  if (config_.random_background) {
    for (int c = 0; c < 3; ++c) {
      ray.target.background[c] = nerf::RandomUniform(seed_, step, 8 * static_cast<uint64_t>(index) + 1 + c);
    }
  }
  ray.target.depth = pixel.z_mu > 0 ? pixel.z_mu * norm / unit_mu_ : -1.0f;
  ray.target.is_object = !is_background;
  return ray;
}

}  // namespace romap
