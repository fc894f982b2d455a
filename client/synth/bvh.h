#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace romap::synth {

// Bounding volume hierarchy over triangles, split by the surface area heuristic in bins (Wald, "On fast construction of
// SAH-based bounding volume hierarchies", 2007). Immutable and thread-safe.
class Bvh {
 public:
  Bvh(std::span<const Eigen::Vector3f> positions_m, std::span<const std::array<uint32_t, 3>> triangles);

  struct Hit {
    uint32_t triangle = 0;  // index into the triangles of the constructor
    float t = 0;            // distance in multiples of the direction
  };

  // The nearest triangle whose front face (counter-clockwise corners) the ray hits. nullopt if there is none or the
  // direction is not finite.
  std::optional<Hit> Nearest(const Eigen::Vector3f& origin_m, const Eigen::Vector3f& direction) const;
  // Whether any triangle intersects origin + t * direction for t in (t_min, t_max).
  bool Occluded(const Eigen::Vector3f& origin_m, const Eigen::Vector3f& direction, float t_min, float t_max) const;
  // Whether the point is inside the closed surface that the triangles form (ray parity test).
  bool Contains(const Eigen::Vector3f& point_m) const;

 private:
  struct Triangle {
    Eigen::Vector3f corner, edge1, edge2;
    uint32_t index;
  };
  // Inner nodes: children at `first` and `first + 1`, count 0. Leaves: triangles [first, first + count).
  struct Node {
    Eigen::AlignedBox3f box;
    uint32_t first = 0;
    uint32_t count = 0;
  };
  struct Reference {  // a triangle during construction
    Eigen::AlignedBox3f box;
    Eigen::Vector3f center;
    uint32_t triangle;
  };

  void Split(uint32_t node, std::span<Reference> references, uint32_t offset, int depth);
  static size_t Partition(std::span<Reference> references);
  template <class Visit>
  void Walk(const Eigen::Vector3f& origin_m, const Eigen::Vector3f& direction, float t_max, Visit visit) const;
  static float Entry(const Node& node, const Eigen::Vector3f& origin_m, const Eigen::Vector3f& inverse, float t_max);

  std::vector<Node> nodes_;
  std::vector<Triangle> triangles_;
};

}  // namespace romap::synth
