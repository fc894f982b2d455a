#include "client/synth/lighting.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "client/synth/bvh.h"
#include "common/parallel_for.h"

namespace romap::synth {
namespace {

constexpr int kLightSamplesAcross = 6;
constexpr int kAmbientRings = 4;
constexpr int kAmbientSpokes = 10;
constexpr float kAmbientReach_m = 0.5F;  // farther surfaces do not occlude
constexpr float kOffset_m = 5e-4F;       // offset of ray origins that avoids self-shadowing
const Rgb kAmbient(0.30F, 0.31F, 0.34F);
constexpr float kBounce = 0.25F;  // share of the occluded ambient light that near surfaces reflect

Rgb DirectLight(const AreaLight& light, const Bvh& bvh, const Point& p, const Point& normal) {
  const Point light_normal = light.half_u_m.cross(light.half_v_m).normalized();
  float sum = 0;
  for (int i = 0; i < kLightSamplesAcross; ++i) {
    for (int j = 0; j < kLightSamplesAcross; ++j) {
      const float s = (2.0F * static_cast<float>(i) + 1) / kLightSamplesAcross - 1;
      const float t = (2.0F * static_cast<float>(j) + 1) / kLightSamplesAcross - 1;
      const Point to_light = light.center_m + s * light.half_u_m + t * light.half_v_m - p;
      const float distance_m = to_light.norm();
      const float cosine = normal.dot(to_light) / distance_m;
      if (cosine <= 0 || bvh.Occluded(p, to_light, 0, 0.99F)) continue;
      sum += cosine * std::abs(light_normal.dot(to_light)) / (distance_m * distance_m * distance_m);
    }
  }
  return light.power * (sum / (kLightSamplesAcross * kLightSamplesAcross));
}

// Cosine-weighted directions around +z.
std::array<Point, kAmbientRings * kAmbientSpokes> HemisphereRays() {
  std::array<Point, kAmbientRings * kAmbientSpokes> rays;
  for (int ring = 0; ring < kAmbientRings; ++ring) {
    const float radius = std::sqrt((static_cast<float>(ring) + 0.5F) / kAmbientRings);
    for (int spoke = 0; spoke < kAmbientSpokes; ++spoke) {
      const float turn = (static_cast<float>(spoke) + 0.618F * static_cast<float>(ring)) / kAmbientSpokes;
      const float angle = 2 * std::numbers::pi_v<float> * turn;
      rays[ring * kAmbientSpokes + spoke] =
          Point(radius * std::cos(angle), radius * std::sin(angle), std::sqrt(1 - radius * radius));
    }
  }
  return rays;
}

Rgb AmbientLight(const Bvh& bvh, const Point& p, const Point& normal) {
  static const auto kRays = HemisphereRays();
  const Point tangent = normal.unitOrthogonal();
  const Point bitangent = normal.cross(tangent);
  int open = 0;
  for (const Point& ray : kRays) {
    const Point direction = ray.x() * tangent + ray.y() * bitangent + ray.z() * normal;
    if (!bvh.Occluded(p, direction, 0, kAmbientReach_m)) ++open;
  }
  const float share = static_cast<float>(open) / static_cast<float>(kRays.size());
  return kAmbient * (share + kBounce * (1 - share));
}

}  // namespace

void BakeLight(Scene& scene) {
  const Bvh bvh(scene.positions_world, scene.triangles);
  scene.irradiance.resize(scene.positions_world.size());
  ParallelForRanges(scene.irradiance.size(), 256, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Point& normal = scene.normals_world[i];
      const Point p = scene.positions_world[i] + kOffset_m * normal;
      Rgb sum = AmbientLight(bvh, p, normal);
      for (const AreaLight& light : scene.lights) sum += DirectLight(light, bvh, p, normal);
      scene.irradiance[i] = sum;
    }
  });
}

}  // namespace romap::synth
