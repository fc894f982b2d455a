#include "client/synth/solid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace romap::synth {
namespace {

constexpr float kTwoPi = 2 * std::numbers::pi_v<float>;

std::vector<Ring> InsertRings(const std::vector<Ring>& rings, float max_edge_m) {
  std::vector<Ring> dense = {rings.front()};
  for (size_t i = 1; i < rings.size(); ++i) {
    float longest_m = 0;
    for (size_t j = 0; j < rings[i].size(); ++j)
      longest_m = std::max(longest_m, (rings[i][j] - rings[i - 1][j]).norm());
    const int pieces = std::max(1, static_cast<int>(std::ceil(longest_m / max_edge_m)));
    for (int k = 1; k <= pieces; ++k) {
      const float share = static_cast<float>(k) / static_cast<float>(pieces);
      Ring ring(rings[i].size());
      for (size_t j = 0; j < ring.size(); ++j) ring[j] = rings[i - 1][j] + share * (rings[i][j] - rings[i - 1][j]);
      dense.push_back(std::move(ring));
    }
  }
  return dense;
}

template <class Vector>
std::vector<Vector> CatmullRom(const std::vector<Vector>& control, int steps) {
  std::vector<Vector> curve;
  const auto at = [&](size_t i, int offset) {
    const auto last = static_cast<std::ptrdiff_t>(control.size()) - 1;
    return control[static_cast<size_t>(std::clamp(static_cast<std::ptrdiff_t>(i) + offset, std::ptrdiff_t{0}, last))];
  };
  for (size_t i = 0; i + 1 < control.size(); ++i) {
    const Vector p0 = at(i, -1), p1 = at(i, 0), p2 = at(i, 1), p3 = at(i, 2);
    for (int k = 0; k < steps; ++k) {
      const float t = static_cast<float>(k) / static_cast<float>(steps);
      curve.push_back(0.5F * (2 * p1 + t * (p2 - p0) + t * t * (2 * p0 - 5 * p1 + 4 * p2 - p3) +
                              t * t * t * (3 * p1 - p0 - 3 * p2 + p3)));
    }
  }
  curve.push_back(control.back());
  return curve;
}

// Number of points on a circle, a few millimeters apart.
int PointsAround(float radius_m) { return std::clamp(static_cast<int>(kTwoPi * radius_m / 0.004F), 12, 80); }

// A rectangle with rounded corners at height z, counter-clockwise seen from above.
Ring RoundedRectangle(const Point& center, float half_x_m, float half_y_m, float radius_m, float z_m, float max_edge_m,
                      const Point& full_half_extents) {
  constexpr int kCornerPieces = 4;
  Ring ring;
  const std::array<Eigen::Vector2f, 4> corners = {{{1, 1}, {-1, 1}, {-1, -1}, {1, -1}}};
  for (int c = 0; c < 4; ++c) {
    const Eigen::Vector2f middle(corners[c].x() * (half_x_m - radius_m), corners[c].y() * (half_y_m - radius_m));
    for (int k = 0; k <= kCornerPieces; ++k) {
      const float angle = kTwoPi / 4 * (static_cast<float>(c) + static_cast<float>(k) / kCornerPieces);
      ring.push_back(center +
                     Point(middle.x() + radius_m * std::cos(angle), middle.y() + radius_m * std::sin(angle), z_m));
    }
    // The side to the next corner; all rings of a box have the same number of pieces.
    const float side_m = 2 * (c % 2 == 0 ? full_half_extents.x() : full_half_extents.y());
    const int pieces = std::max(1, static_cast<int>(std::ceil(side_m / max_edge_m)));
    const Eigen::Vector2f next(corners[(c + 1) % 4].x() * (half_x_m - radius_m),
                               corners[(c + 1) % 4].y() * (half_y_m - radius_m));
    const float end_angle = kTwoPi / 4 * static_cast<float>(c + 1);
    const Eigen::Vector2f outward = radius_m * Eigen::Vector2f(std::cos(end_angle), std::sin(end_angle));
    for (int k = 1; k < pieces; ++k) {
      const Eigen::Vector2f p =
          middle + (next - middle) * (static_cast<float>(k) / static_cast<float>(pieces)) + outward;
      ring.push_back(center + Point(p.x(), p.y(), z_m));
    }
  }
  return ring;
}

}  // namespace

Mesh Loft(const std::vector<Ring>& rings, const Point& first_pole, const Point& last_pole, float max_edge_m) {
  const std::vector<Ring> dense = InsertRings(rings, max_edge_m);
  const auto around = static_cast<uint32_t>(dense.front().size());
  Mesh mesh;
  for (const Ring& ring : dense) mesh.vertices.insert(mesh.vertices.end(), ring.begin(), ring.end());
  const auto first = static_cast<uint32_t>(mesh.vertices.size());
  mesh.vertices.push_back(first_pole);
  mesh.vertices.push_back(last_pole);
  const uint32_t last_ring = first - around;
  for (uint32_t j = 0; j < around; ++j) {
    const uint32_t next = (j + 1) % around;
    mesh.triangles.push_back({first, next, j});
    mesh.triangles.push_back({first + 1, last_ring + j, last_ring + next});
    for (uint32_t base = 0; base < last_ring; base += around) {
      mesh.triangles.push_back({base + j, base + next, base + around + next});
      mesh.triangles.push_back({base + j, base + around + next, base + around + j});
    }
  }
  return mesh;
}

Mesh Revolve(const Profile& profile) {
  float widest_m = 0;
  for (const Eigen::Vector2f& p : profile) widest_m = std::max(widest_m, p.x());
  const int around = PointsAround(widest_m);
  // Small rings at the poles give flat ends separate vertices.
  std::vector<Ring> rings;
  const auto add_ring = [&](float radius_m, float z_m) {
    Ring ring(static_cast<size_t>(around));
    for (int j = 0; j < around; ++j) {
      const float angle = kTwoPi * static_cast<float>(j) / static_cast<float>(around);
      ring[static_cast<size_t>(j)] = Point(radius_m * std::cos(angle), radius_m * std::sin(angle), z_m);
    }
    rings.push_back(std::move(ring));
  };
  constexpr float kPoleRing_m = 0.002F;
  if (profile.front().x() > kPoleRing_m) add_ring(kPoleRing_m, profile.front().y());
  for (const Eigen::Vector2f& p : profile) {
    if (p.x() > 0) add_ring(p.x(), p.y());
  }
  if (profile.back().x() > kPoleRing_m) add_ring(kPoleRing_m, profile.back().y());
  return Loft(rings, Point(0, 0, profile.front().y()), Point(0, 0, profile.back().y()));
}

Profile Smooth(const Profile& control, int steps) { return CatmullRom(control, steps); }

std::vector<Point> Smooth(const std::vector<Point>& control, int steps) { return CatmullRom(control, steps); }

Mesh Sweep(const std::vector<Point>& path, std::span<const float> half_width_m, std::span<const float> half_height_m,
           const Point& up) {
  const float widest_m = std::max(*std::max_element(half_width_m.begin(), half_width_m.end()),
                                  *std::max_element(half_height_m.begin(), half_height_m.end()));
  const int around = PointsAround(widest_m);
  std::vector<Ring> rings;
  Point height_axis = up;
  for (size_t i = 0; i < path.size(); ++i) {
    const Point tangent = (path[std::min(i + 1, path.size() - 1)] - path[i == 0 ? 0 : i - 1]).normalized();
    // Transporting the axis along the path avoids twist.
    height_axis -= height_axis.dot(tangent) * tangent;
    if (height_axis.norm() < 1e-3F) height_axis = tangent.unitOrthogonal();
    height_axis.normalize();
    const Point width_axis = height_axis.cross(tangent);
    Ring ring(static_cast<size_t>(around));
    for (int j = 0; j < around; ++j) {
      const float angle = kTwoPi * static_cast<float>(j) / static_cast<float>(around);
      ring[static_cast<size_t>(j)] =
          path[i] + half_width_m[i] * std::cos(angle) * width_axis + half_height_m[i] * std::sin(angle) * height_axis;
    }
    rings.push_back(std::move(ring));
  }
  return Loft(rings, path.front(), path.back());
}

Mesh Tube(const std::vector<Point>& path, float radius_m) {
  const std::vector<float> radii(path.size(), radius_m);
  return Sweep(path, radii, radii);
}

Mesh Ellipsoid(const Point& center, const Point& half_axes) {
  const float scale_m = half_axes.maxCoeff();
  const int pieces = std::clamp(static_cast<int>(std::numbers::pi_v<float> * scale_m / 0.005F), 8, 40);
  Profile profile;
  for (int i = 0; i <= pieces; ++i) {
    const float angle = std::numbers::pi_v<float> * (static_cast<float>(i) / static_cast<float>(pieces) - 0.5F);
    profile.emplace_back(i == 0 || i == pieces ? 0.0F : scale_m * std::cos(angle), scale_m * std::sin(angle));
  }
  Mesh mesh = Revolve(profile);
  for (Point& p : mesh.vertices) p = center + p.cwiseProduct(half_axes) / scale_m;
  return mesh;
}

Mesh RoundedBox(const Point& center, const Point& half_extents, float edge_radius_m, float max_edge_m) {
  const float radius_m = std::min(edge_radius_m, 0.9F * half_extents.minCoeff());
  const float bevel_m = 0.4F * radius_m;
  std::vector<Ring> rings;
  const auto add_ring = [&](float inset_m, float z_m) {
    rings.push_back(RoundedRectangle(center, half_extents.x() - inset_m, half_extents.y() - inset_m,
                                     std::max(radius_m - inset_m, 0.1F * radius_m), z_m, max_edge_m, half_extents));
  };
  const auto shrunk = [&](float z_m) {
    Ring ring = rings.back();
    for (Point& p : ring) p = Point(center.x(), center.y(), p.z()) + 0.04F * (p - Point(center.x(), center.y(), p.z()));
    for (Point& p : ring) p.z() = center.z() + z_m;
    return ring;
  };
  const float hz = half_extents.z();
  add_ring(bevel_m, -hz);
  rings.insert(rings.begin(), shrunk(-hz));
  add_ring(0, -hz + bevel_m);
  add_ring(0, hz - bevel_m);
  add_ring(bevel_m, hz);
  rings.push_back(shrunk(hz));
  return Loft(rings, center - Point(0, 0, hz), center + Point(0, 0, hz), max_edge_m);
}

Mesh Moved(Mesh mesh, const Eigen::Quaternionf& rotation, const Point& translation) {
  for (Point& p : mesh.vertices) p = rotation * p + translation;
  return mesh;
}

Eigen::Quaternionf Turn(float angle_rad, const Point& axis) {
  return Eigen::Quaternionf(Eigen::AngleAxisf(angle_rad, axis.normalized()));
}

void Settle(Solid& solid) {
  const Eigen::AlignedBox3f bounds = Bounds(solid);
  const Point shift(-bounds.center().x(), -bounds.center().y(), -bounds.min().z());
  for (SolidPart& part : solid.parts) {
    for (Point& p : part.mesh.vertices) p += shift;
  }
}

Eigen::AlignedBox3f Bounds(const Solid& solid) {
  Eigen::AlignedBox3f bounds;
  for (const SolidPart& part : solid.parts) {
    for (const Point& p : part.mesh.vertices) bounds.extend(p);
  }
  return bounds;
}

float FootprintRadius(const Solid& solid) {
  float radius_m = 0;
  for (const SolidPart& part : solid.parts) {
    for (const Point& p : part.mesh.vertices) radius_m = std::max(radius_m, p.head<2>().norm());
  }
  return radius_m;
}

}  // namespace romap::synth
