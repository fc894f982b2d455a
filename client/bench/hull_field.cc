#include "client/bench/hull_field.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/nerf/math/types.h"
#include "server/nerf/training_box.h"
#include "server/nerf/visual_hull.h"

namespace romap::bench {
namespace {

constexpr float kOutside = -1e4f;
constexpr float kRaw = 10.0f;  // of a possibly occupied cell; empty cells have -kRaw
constexpr Rgb8 kGray = {160, 160, 160};

class HullField : public FieldSampler {
 public:
  HullField(OccupancyBits hull, const Eigen::Vector3f& half_extents)
      : hull_(std::move(hull)), half_extents_(half_extents) {}

  void Sample(std::span<const Eigen::Vector3f> p_object, std::span<float> raw, std::span<Rgb8> rgb) const override {
    std::ranges::fill(rgb, kGray);
    std::ranges::transform(p_object, raw.begin(), [this](const Eigen::Vector3f& p) { return ValueAt(p); });
  }

 private:
  float Cell(int x, int y, int z) const {
    const int last = hull_.resolution - 1;
    const auto index = (std::clamp(z, 0, last) * hull_.resolution + std::clamp(y, 0, last)) * hull_.resolution +
                       std::clamp(x, 0, last);
    return hull_.bits[static_cast<size_t>(index)] != 0 ? kRaw : -kRaw;
  }

  float ValueAt(const Eigen::Vector3f& p_object) const {
    constexpr float kSlack = 1e-5f;  // tolerance for points on the faces of the box
    const Eigen::Array3f p_box = (p_object + half_extents_).array() / (2 * half_extents_.array());
    if (!((p_box >= -kSlack).all() && (p_box <= 1 + kSlack).all())) return kOutside;
    const Eigen::Array3f at = p_box * static_cast<float>(hull_.resolution) - 0.5f;  // in cells; centers are at integers
    const Eigen::Array3i low = at.floor().cast<int>();
    const Eigen::Array3f fraction = at - low.cast<float>();
    float value = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Array3i step(corner & 1, corner >> 1 & 1, corner >> 2);
      const Eigen::Array3f weight = (step == 1).select(fraction, 1 - fraction);
      value += weight.prod() * Cell(low.x() + step.x(), low.y() + step.y(), low.z() + step.z());
    }
    return value;
  }

  const OccupancyBits hull_;
  const Eigen::Vector3f half_extents_;
};

}  // namespace

FieldSnapshot MakeHullSnapshot(const nerf::NerfConfig& config, const Cuboid& cuboid,
                               const std::vector<ObjectView>& views) {
  const nerf::TrainingBox box = nerf::TrainingBox::Around(cuboid, config.box_enlargement);
  nerf::VisualHull hull(config);
  hull.Reset(box);
  FieldSnapshot snapshot;
  for (const ObjectView& view : views) {
    hull.Add(view);
    snapshot.object = view.object;
    snapshot.cameras.push_back(
        {view.T_world_camera.Inverse() * box.T_world_object, view.camera, view.roi_px, view.ray_kind});
  }
  snapshot.views = static_cast<int>(views.size());
  snapshot.converged = true;
  snapshot.T_world_object = box.T_world_object;
  snapshot.box_half_extents = box.half_extents.cast<float>();
  snapshot.surface_level = snapshot.connect_level = 0.0f;
  snapshot.optics.surface_density_per_mu = static_cast<float>(std::exp(config.surface_level) / box.unit_mu);
  snapshot.field =
      std::make_shared<HullField>(OccupancyBits{nerf::kOccupancyResolution, hull.Carve()}, snapshot.box_half_extents);
  return snapshot;
}

}  // namespace romap::bench
