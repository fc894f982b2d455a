#include "server/mesh/next_view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "common/angles.h"

namespace romap::mesh {
namespace {

constexpr int kAzimuths = 16;
constexpr double kElevations_deg[] = {15, 45, 75};
// Vertices in use: they are evenly spread over the surface, so this number measures its shares well.
constexpr size_t kMaxVertices = 5000;
// A vertex at a steeper angle is hardly seen.
constexpr float kMinCosine = 0.25F;
// Size of a bin of the depth buffer, in distances between the vertices in use, and the depth behind the nearest vertex
// of a bin at which a vertex is hidden.
constexpr float kBinSpacings = 2;
constexpr float kHiddenSpacings = 3;
constexpr float kMaxBins = 512;  // along a side of the depth buffer
// Of the surface: less is not worth a motion of the camera.
constexpr double kMinGain = 0.02;

// Vertices in a frame whose z axis points to the candidate.
class DepthBuffer {
 public:
  DepthBuffer(const std::vector<Eigen::Vector3f>& vertices, const Eigen::Vector3f& direction, float bin_mu)
      : to_view_(Eigen::Quaternionf::FromTwoVectors(direction, Eigen::Vector3f::UnitZ()).toRotationMatrix()),
        bin_mu_(bin_mu) {
    Eigen::Array3f upper = Eigen::Array3f::Constant(std::numeric_limits<float>::lowest());
    lower_ = Eigen::Array3f::Constant(std::numeric_limits<float>::max());
    for (const Eigen::Vector3f& vertex : vertices) {
      const Eigen::Array3f p = (to_view_ * vertex).array();
      lower_ = lower_.min(p);
      upper = upper.max(p);
    }
    bin_mu_ = std::max(bin_mu_, (upper - lower_).head<2>().maxCoeff() / kMaxBins);
    columns_ = static_cast<size_t>((upper.x() - lower_.x()) / bin_mu_) + 1;
    const size_t rows = static_cast<size_t>((upper.y() - lower_.y()) / bin_mu_) + 1;
    nearest_.assign(columns_ * rows, std::numeric_limits<float>::lowest());
    for (const Eigen::Vector3f& vertex : vertices) {
      const Eigen::Vector3f p = to_view_ * vertex;
      float& nearest = nearest_[Bin(p)];
      nearest = std::max(nearest, p.z());
    }
  }

  bool IsHidden(const Eigen::Vector3f& vertex, float tolerance_mu) const {
    const Eigen::Vector3f p = to_view_ * vertex;
    return nearest_[Bin(p)] > p.z() + tolerance_mu;
  }

 private:
  size_t Bin(const Eigen::Vector3f& p) const {
    return static_cast<size_t>((p.y() - lower_.y()) / bin_mu_) * columns_ +
           static_cast<size_t>((p.x() - lower_.x()) / bin_mu_);
  }

  Eigen::Matrix3f to_view_;
  float bin_mu_;
  Eigen::Array3f lower_;
  size_t columns_ = 0;
  std::vector<float> nearest_;  // z, by bin
};

// About the distance between neighboring vertices; 0 without triangles.
float MeanEdge_mu(const Mesh& mesh) {
  double sum_mu = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    sum_mu += (mesh.vertices[a] - mesh.vertices[b]).norm() + (mesh.vertices[b] - mesh.vertices[c]).norm() +
              (mesh.vertices[c] - mesh.vertices[a]).norm();
  }
  return mesh.triangles.empty() ? 0 : static_cast<float>(sum_mu / (3.0 * static_cast<double>(mesh.triangles.size())));
}

std::vector<Eigen::Vector3f> Candidates() {
  std::vector<Eigen::Vector3f> directions;
  for (const double elevation_deg : kElevations_deg) {
    for (int k = 0; k < kAzimuths; ++k) {
      const double elevation_rad = elevation_deg * kRadPerDeg;
      const double azimuth_rad = 360.0 * k / kAzimuths * kRadPerDeg;
      directions.push_back(Eigen::Vector3d(std::cos(elevation_rad) * std::cos(azimuth_rad),
                                           std::cos(elevation_rad) * std::sin(azimuth_rad), std::sin(elevation_rad))
                               .cast<float>());
    }
  }
  return directions;
}

}  // namespace

std::optional<NextView> FindNextView(const Mesh& mesh) {
  const size_t count = mesh.vertices.size();
  if (mesh.confidence.size() != count || mesh.normals.size() != count) return std::nullopt;
  const float edge_mu = MeanEdge_mu(mesh);
  if (!(edge_mu > 0)) return std::nullopt;
  const size_t stride = (count + kMaxVertices - 1) / kMaxVertices;
  std::vector<Eigen::Vector3f> vertices, normals;
  std::vector<float> lacking;  // of the confidence
  for (size_t i = 0; i < count; i += stride) {
    vertices.push_back(mesh.vertices[i]);
    normals.push_back(mesh.normals[i]);
    lacking.push_back(1 - mesh.confidence[i]);
  }
  const float spacing_mu = edge_mu * std::sqrt(static_cast<float>(stride));
  NextView best;
  for (const Eigen::Vector3f& direction : Candidates()) {
    const DepthBuffer buffer(vertices, direction, kBinSpacings * spacing_mu);
    double gain = 0;
    for (size_t i = 0; i < vertices.size(); ++i) {
      const float cosine = normals[i].dot(direction);
      if (cosine < kMinCosine || buffer.IsHidden(vertices[i], kHiddenSpacings * spacing_mu)) continue;
      gain += lacking[i] * cosine;
    }
    gain /= static_cast<double>(vertices.size());
    if (gain > best.gain) best = {.direction = direction.cast<double>(), .gain = gain};
  }
  if (best.gain < kMinGain) return std::nullopt;
  return best;
}

}  // namespace romap::mesh
