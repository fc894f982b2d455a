#include "client/synth/bvh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace romap::synth {
namespace {

constexpr uint32_t kLeafTriangles = 4;
constexpr int kBins = 12;
// Deeper nodes are split in half regardless of the heuristic, which bounds the depth of the tree by kStack.
constexpr int kMaxHeuristicDepth = 48;
constexpr size_t kStack = 96;

float HalfArea(const Eigen::AlignedBox3f& box) {
  if (box.isEmpty()) return 0;
  const Eigen::Vector3f s = box.sizes();
  return s.x() * s.y() + s.y() * s.z() + s.z() * s.x();
}

// Distance along the ray to the triangle; negative if it misses (Moeller and Trumbore, 1997).
float HitDistance(const Eigen::Vector3f& corner, const Eigen::Vector3f& edge1, const Eigen::Vector3f& edge2,
                  const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) {
  const Eigen::Vector3f p = direction.cross(edge2);
  const float determinant = edge1.dot(p);
  if (determinant == 0) return -1;
  const Eigen::Vector3f from_corner = origin - corner;
  const float u = from_corner.dot(p) / determinant;
  if (!(u >= 0 && u <= 1)) return -1;
  const Eigen::Vector3f q = from_corner.cross(edge1);
  const float v = direction.dot(q) / determinant;
  if (!(v >= 0 && u + v <= 1)) return -1;
  return edge2.dot(q) / determinant;
}

}  // namespace

Bvh::Bvh(std::span<const Eigen::Vector3f> positions_m, std::span<const std::array<uint32_t, 3>> triangles) {
  std::vector<Reference> references(triangles.size());
  for (size_t i = 0; i < triangles.size(); ++i) {
    Reference& reference = references[i];
    for (const uint32_t corner : triangles[i]) reference.box.extend(positions_m[corner]);
    reference.center = reference.box.center();
    reference.triangle = static_cast<uint32_t>(i);
  }
  nodes_.reserve(2 * triangles.size() + 1);
  nodes_.emplace_back();
  if (!references.empty()) Split(0, references, 0, 0);
  triangles_.reserve(triangles.size());
  for (const Reference& reference : references) {
    const auto& [a, b, c] = triangles[reference.triangle];
    triangles_.push_back(
        {positions_m[a], positions_m[b] - positions_m[a], positions_m[c] - positions_m[a], reference.triangle});
  }
}

void Bvh::Split(uint32_t node, std::span<Reference> references, uint32_t offset, int depth) {
  for (const Reference& reference : references) nodes_[node].box.extend(reference.box);
  if (references.size() <= kLeafTriangles) {
    nodes_[node].first = offset;
    nodes_[node].count = static_cast<uint32_t>(references.size());
    return;
  }
  const size_t middle = depth < kMaxHeuristicDepth ? Partition(references) : references.size() / 2;
  const auto children = static_cast<uint32_t>(nodes_.size());
  nodes_[node].first = children;
  nodes_.resize(nodes_.size() + 2);
  Split(children, references.first(middle), offset, depth + 1);
  Split(children + 1, references.subspan(middle), offset + static_cast<uint32_t>(middle), depth + 1);
}

// Reorders the references into two non-empty sets and returns the size of the first.
size_t Bvh::Partition(std::span<Reference> references) {
  Eigen::AlignedBox3f centers;
  for (const Reference& reference : references) centers.extend(reference.center);
  int axis = 0;
  const float width = centers.sizes().maxCoeff(&axis);
  if (!(width > 0)) return references.size() / 2;
  const auto bin_of = [&](const Reference& reference) {
    const float share = (reference.center[axis] - centers.min()[axis]) / width;
    return std::min(static_cast<int>(share * kBins), kBins - 1);
  };
  std::array<Eigen::AlignedBox3f, kBins> boxes;
  std::array<size_t, kBins> counts{};
  for (const Reference& reference : references) {
    boxes[bin_of(reference)].extend(reference.box);
    ++counts[bin_of(reference)];
  }
  float best_cost = std::numeric_limits<float>::infinity();
  int best_bin = 1;
  for (int split = 1; split < kBins; ++split) {
    Eigen::AlignedBox3f low, high;
    size_t low_count = 0, high_count = 0;
    for (int bin = 0; bin < kBins; ++bin) {
      (bin < split ? low : high).extend(boxes[bin]);
      (bin < split ? low_count : high_count) += counts[bin];
    }
    if (low_count == 0 || high_count == 0) continue;
    const float cost = HalfArea(low) * static_cast<float>(low_count) + HalfArea(high) * static_cast<float>(high_count);
    if (cost < best_cost) {
      best_cost = cost;
      best_bin = split;
    }
  }
  const auto middle = std::partition(references.begin(), references.end(),
                                     [&](const Reference& reference) { return bin_of(reference) < best_bin; });
  return static_cast<size_t>(middle - references.begin());
}

// Calls visit(t) for each triangle hit at 0 < t < t_max, in arbitrary order, until it returns true.
template <class Visit>
void Bvh::Walk(const Eigen::Vector3f& origin_m, const Eigen::Vector3f& direction, float t_max, Visit visit) const {
  if (triangles_.empty()) return;
  const Eigen::Vector3f inverse = direction.cwiseInverse();
  std::array<uint32_t, kStack> stack;
  size_t depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const Node& node = nodes_[stack[--depth]];
    const Eigen::Vector3f to_low = (node.box.min() - origin_m).cwiseProduct(inverse);
    const Eigen::Vector3f to_high = (node.box.max() - origin_m).cwiseProduct(inverse);
    const float enter = to_low.cwiseMin(to_high).maxCoeff();
    const float leave = to_low.cwiseMax(to_high).minCoeff();
    if (!(enter <= leave && leave >= 0 && enter <= t_max)) continue;
    if (node.count == 0) {
      stack[depth++] = node.first;
      stack[depth++] = node.first + 1;
      continue;
    }
    for (uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Triangle& triangle = triangles_[i];
      const float t = HitDistance(triangle.corner, triangle.edge1, triangle.edge2, origin_m, direction);
      if (t > 0 && t < t_max && visit(t)) return;
    }
  }
}

// Distance at which the ray enters the box of the node; infinity if it misses the box or enters beyond t_max.
float Bvh::Entry(const Node& node, const Eigen::Vector3f& origin_m, const Eigen::Vector3f& inverse, float t_max) {
  const Eigen::Vector3f to_low = (node.box.min() - origin_m).cwiseProduct(inverse);
  const Eigen::Vector3f to_high = (node.box.max() - origin_m).cwiseProduct(inverse);
  const float enter = to_low.cwiseMin(to_high).maxCoeff();
  const float leave = to_low.cwiseMax(to_high).minCoeff();
  return enter <= leave && leave >= 0 && enter < t_max ? enter : std::numeric_limits<float>::infinity();
}

std::optional<Bvh::Hit> Bvh::Nearest(const Eigen::Vector3f& origin_m, const Eigen::Vector3f& direction) const {
  if (triangles_.empty() || !direction.allFinite()) return std::nullopt;
  constexpr float kFar = std::numeric_limits<float>::infinity();
  const Eigen::Vector3f inverse = direction.cwiseInverse();
  Hit best{0, kFar};
  std::array<std::pair<uint32_t, float>, kStack> stack;  // nodes and their entry distances
  size_t depth = 0;
  if (Entry(nodes_[0], origin_m, inverse, kFar) < kFar) stack[depth++] = {0, 0.0F};
  while (depth > 0) {
    const auto [index, enter] = stack[--depth];
    if (enter >= best.t) continue;
    const Node& node = nodes_[index];
    if (node.count == 0) {
      const float left = Entry(nodes_[node.first], origin_m, inverse, best.t);
      const float right = Entry(nodes_[node.first + 1], origin_m, inverse, best.t);
      const bool left_first = left <= right;
      const std::pair<uint32_t, float> near{node.first + (left_first ? 0 : 1), std::min(left, right)};
      const std::pair<uint32_t, float> far{node.first + (left_first ? 1 : 0), std::max(left, right)};
      if (far.second < kFar) stack[depth++] = far;
      if (near.second < kFar) stack[depth++] = near;
      continue;
    }
    for (uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Triangle& triangle = triangles_[i];
      if (direction.dot(triangle.edge1.cross(triangle.edge2)) >= 0) continue;  // back face
      const float t = HitDistance(triangle.corner, triangle.edge1, triangle.edge2, origin_m, direction);
      // A hit on a shared edge belongs to the triangle with the lowest index, independent of the visiting order.
      if (t > 0 && (t < best.t || (t == best.t && triangle.index < best.triangle))) best = {triangle.index, t};
    }
  }
  if (best.t == kFar) return std::nullopt;
  return best;
}

bool Bvh::Occluded(const Eigen::Vector3f& origin_m, const Eigen::Vector3f& direction, float t_min, float t_max) const {
  bool occluded = false;
  Walk(origin_m, direction, t_max, [&](float t) { return occluded = t > t_min; });
  return occluded;
}

bool Bvh::Contains(const Eigen::Vector3f& point_m) const {
  if (!nodes_[0].box.contains(point_m)) return false;
  // Not parallel to axes or diagonals, so that the ray does not hit edges of regular meshes.
  const Eigen::Vector3f direction = Eigen::Vector3f(0.3217F, 0.2071F, 0.9239F).normalized();
  int hits = 0;
  Walk(point_m, direction, std::numeric_limits<float>::infinity(), [&](float) {
    ++hits;
    return false;
  });
  return hits % 2 == 1;
}

}  // namespace romap::synth
