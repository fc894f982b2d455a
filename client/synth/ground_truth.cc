#include "client/synth/ground_truth.h"

#include <algorithm>
#include <cmath>

#include "client/synth/bvh.h"
#include "client/synth/random.h"
#include "common/lens.h"

namespace romap::synth {
namespace {

constexpr double kPointsPerSquareMeter = 1e6;
constexpr double kMaxPoints = 60000;
constexpr float kUnderside_m = 3e-4F;

double TriangleArea(const Mesh& mesh, const std::array<uint32_t, 3>& triangle) {
  const Point& a = mesh.vertices[triangle[0]];
  return 0.5 * (mesh.vertices[triangle[1]] - a).cross(mesh.vertices[triangle[2]] - a).norm();
}

struct LocalPoint {
  Point position;
  Point normal;
};

// Samples the surfaces of all parts, in the frame of the solid; the density is in points per square meter. Triangles
// are smaller than the distance of points, so their area is accumulated.
std::vector<std::vector<LocalPoint>> SampleParts(const Solid& solid, double density, Random& random) {
  std::vector<std::vector<LocalPoint>> samples;
  for (const SolidPart& part : solid.parts) {
    std::vector<LocalPoint>& points = samples.emplace_back();
    double due = random.Uniform();
    for (const std::array<uint32_t, 3>& triangle : part.mesh.triangles) {
      const Point& a = part.mesh.vertices[triangle[0]];
      const Point ab = part.mesh.vertices[triangle[1]] - a;
      const Point ac = part.mesh.vertices[triangle[2]] - a;
      for (due += density * TriangleArea(part.mesh, triangle); due >= 1; due -= 1) {
        auto s = static_cast<float>(random.Uniform());
        auto t = static_cast<float>(random.Uniform());
        if (s + t > 1) {
          s = 1 - s;
          t = 1 - t;
        }
        points.push_back({a + s * ab + t * ac, ab.cross(ac).normalized()});
      }
    }
  }
  return samples;
}

}  // namespace

SurfacePoints::SurfacePoints(const SceneObject& object, uint64_t seed) : label_(object.label) {
  Random random(seed, 1000U + object.label);
  double area = 0;
  std::vector<Bvh> insides;
  for (const SolidPart& part : object.solid.parts) {
    for (const std::array<uint32_t, 3>& triangle : part.mesh.triangles) area += TriangleArea(part.mesh, triangle);
    insides.emplace_back(part.mesh.vertices, part.mesh.triangles);
  }
  const double density = std::min(kPointsPerSquareMeter, kMaxPoints / area);
  const std::vector<std::vector<LocalPoint>> samples = SampleParts(object.solid, density, random);
  for (size_t part = 0; part < samples.size(); ++part) {
    for (const LocalPoint& point : samples[part]) {
      bool covered = false;
      for (size_t other = 0; other < insides.size() && !covered; ++other) {
        covered = other != part && insides[other].Contains(point.position);
      }
      if (covered) continue;
      positions_world_.push_back((object.T_world_solid * point.position.cast<double>()).cast<float>());
      normals_world_.push_back((object.T_world_solid.rotation() * point.normal.cast<double>()).cast<float>());
      underside_.push_back(point.position.z() < kUnderside_m && point.normal.z() < -0.9F ? 1 : 0);
    }
  }
  seen_ = std::vector<std::atomic<uint8_t>>(positions_world_.size());
}

void SurfacePoints::MarkSeen(const TrueFrame& frame, const CameraModel& camera, const ImagePoses& poses) {
  constexpr double kMinCosine = 0.05;  // surfaces at more grazing angles are not considered visible
  constexpr double kTolerance_m = 3e-4;
  constexpr double kMaxSlack_m = 3e-3;  // less than the thickness of any wall
  const double focal_px = std::min(camera.fx_px, camera.fy_px);
  for (size_t i = 0; i < positions_world_.size(); ++i) {
    if (seen(i)) continue;
    const Eigen::Vector3d p_world = positions_world_[i].cast<double>();
    const Eigen::Vector3d p = poses.CameraPoint(p_world);
    if (p.z() <= 0) continue;
    const Eigen::Vector2d pixel = ProjectDistorted(camera, p);
    if (!(pixel.x() > -0.5 && pixel.y() > -0.5 && pixel.x() < camera.width_px - 0.5 &&
          pixel.y() < camera.height_px - 0.5)) {
      continue;
    }
    const int u = static_cast<int>(std::lround(pixel.x()));
    const int v = static_cast<int>(std::lround(pixel.y()));
    if (frame.labels.at<uint8_t>(v, u) != label_) continue;
    const Eigen::Vector3d to_camera = poses.Row(pixel.y()).translation() - p_world;
    const double cosine = normals_world_[i].cast<double>().dot(to_camera) / to_camera.norm();
    if (cosine < kMinCosine) continue;
    // The depth image is sampled at the pixel center; the depth of a slanted surface changes within half a pixel.
    const double slack_m = 0.71 * p.z() / focal_px * std::sqrt(1 - cosine * cosine) / cosine;
    const double tolerance_m = kTolerance_m + std::min(slack_m, kMaxSlack_m);
    if (std::abs(frame.depth_m.at<float>(v, u) - p.z()) < tolerance_m) seen_[i].store(1, std::memory_order_relaxed);
  }
}

Mesh TrueMesh(const SceneObject& object) {
  Mesh mesh;
  for (const SolidPart& part : object.solid.parts) {
    const auto base = static_cast<uint32_t>(mesh.vertices.size());
    for (const Point& p : part.mesh.vertices) {
      mesh.vertices.push_back((object.T_world_solid * p.cast<double>()).cast<float>());
    }
    for (const auto& [a, b, c] : part.mesh.triangles) mesh.triangles.push_back({base + a, base + b, base + c});
  }
  return mesh;
}

}  // namespace romap::synth
