#pragma once

// Objects with a known shape and color, and their views.

#include <Eigen/Core>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <vector>

#include "common/mesh.h"

namespace romap::texture {

// A closed mesh around the origin: the faces of a cube with n x n cells are projected along the rays from the origin.
// `radius` gives the distance of the surface in a direction of unit length [map units].
inline Mesh StarMesh(int n, const std::function<double(const Eigen::Vector3d&)>& radius) {
  Mesh mesh;
  std::map<std::array<int, 3>, uint32_t> index;
  const auto vertex = [&](const Eigen::Vector3i& at) {
    const auto [entry, is_new] =
        index.emplace(std::array<int, 3>{at.x(), at.y(), at.z()}, static_cast<uint32_t>(mesh.vertices.size()));
    if (is_new) {
      // Equal angles between the lines make cells of similar size.
      const auto line = [&](int i) { return std::tan((2.0 * i / n - 1) * std::numbers::pi / 4); };
      const Eigen::Vector3d direction = Eigen::Vector3d(line(at.x()), line(at.y()), line(at.z())).normalized();
      mesh.vertices.push_back((radius(direction) * direction).cast<float>());
    }
    return entry->second;
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (const int side : {0, n}) {
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
          const auto at = [&](int di, int dj) {
            Eigen::Vector3i p;
            p[axis] = side;
            p[(axis + 1) % 3] = i + di;
            p[(axis + 2) % 3] = j + dj;
            return vertex(p);
          };
          std::array<uint32_t, 4> quad = {at(0, 0), at(1, 0), at(1, 1), at(0, 1)};
          if (side == 0) std::swap(quad[1], quad[3]);
          mesh.triangles.push_back({quad[0], quad[1], quad[2]});
          mesh.triangles.push_back({quad[0], quad[2], quad[3]});
        }
      }
    }
  }
  return mesh;
}

inline Mesh SphereMesh(int n, double radius_mu = 1) {
  return StarMesh(n, [&](const Eigen::Vector3d&) { return radius_mu; });
}

inline Mesh BoxMesh(int n, const Eigen::Vector3d& half_extents) {
  Mesh mesh = StarMesh(n, [&](const Eigen::Vector3d& d) { return 1 / d.cwiseAbs().maxCoeff(); });
  for (Eigen::Vector3f& p : mesh.vertices) p = p.cwiseProduct(half_extents.cast<float>());
  return mesh;
}

// A sphere with bumps and noise: normals are off by about 20 degrees, as in meshes of trained fields.
inline Mesh RoughMesh(int n) {
  return StarMesh(n, [](const Eigen::Vector3d& d) {
    const double noise = std::sin(51 * d.x() + 3 * d.y()) * std::sin(43 * d.y() - d.z()) + std::sin(47 * d.z() + d.x());
    return 1 + 0.15 * std::sin(5 * d.x()) * std::cos(4 * d.y() + 1) + 0.008 * noise;
  });
}

// A torus around the z axis; thin if tube_mu is small.
inline Mesh TorusMesh(int around, int across, double tube_mu) {
  Mesh mesh;
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      const double a = 2 * std::numbers::pi * i / around, b = 2 * std::numbers::pi * j / across;
      const double r = 1 + tube_mu * std::cos(b);
      mesh.vertices.emplace_back(r * std::cos(a), r * std::sin(a), tube_mu * std::sin(b));
      const auto at = [&](int di, int dj) {
        return static_cast<uint32_t>((i + di) % around * across + (j + dj) % across);
      };
      mesh.triangles.push_back({at(0, 0), at(1, 0), at(1, 1)});
      mesh.triangles.push_back({at(0, 0), at(1, 1), at(0, 1)});
    }
  }
  return mesh;
}

}  // namespace romap::texture
