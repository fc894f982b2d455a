#include "server/texture/unwrap_mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>

#include "common/status.h"
#include "server/texture/chart_plane.h"
#include "server/texture/charts.h"
#include "server/texture/pack_charts.h"

namespace romap::texture {
namespace {

constexpr int kSideStep_px = 32;
constexpr int kSmallestSide_px = 64;
// Steps of the search for the largest scale: its error is 2^-12.
constexpr int kScaleSteps = 12;
// A scale at which every chart is a few texels wide, relative to the largest possible scale.
constexpr float kTinyScale = 1e-3f;

// A chart in its plane, rotated such that its bounding box is smallest and wider than high.
struct FlatChart {
  std::vector<uint32_t> vertices;        // of the mesh, each once
  std::vector<Eigen::Vector2f> flat_mu;  // of `vertices`; the upper left corner of the bounding box is at 0
  Eigen::Vector2f extents_mu = Eigen::Vector2f::Zero();
};

void RotateToSmallestBox(FlatChart& chart) {
  std::vector<cv::Point2f> points;
  points.reserve(chart.flat_mu.size());
  for (const Eigen::Vector2f& p : chart.flat_mu) points.emplace_back(p.x(), p.y());
  const cv::RotatedRect box = cv::minAreaRect(points);
  float angle_rad = -box.angle * std::numbers::pi_v<float> / 180;
  if (box.size.height > box.size.width) angle_rad += std::numbers::pi_v<float> / 2;
  const Eigen::Rotation2Df rotation(angle_rad);
  Eigen::Vector2f low = Eigen::Vector2f::Constant(std::numeric_limits<float>::infinity()), high = -low;
  for (Eigen::Vector2f& p : chart.flat_mu) {
    p = rotation * p;
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  for (Eigen::Vector2f& p : chart.flat_mu) p -= low;
  chart.extents_mu = high - low;
}

// Packs charts at different scales.
class AtlasPacker {
 public:
  AtlasPacker(const std::vector<FlatChart>& charts, int padding_px) : charts_(charts), padding_px_(padding_px) {
    for (const FlatChart& chart : charts) {
      area_mu2_ += chart.extents_mu.prod();
      longest_mu_ = std::max(longest_mu_, chart.extents_mu.maxCoeff());
    }
  }

  float AreaOfBoxes_mu2() const { return area_mu2_; }
  float LongestSide_mu() const { return longest_mu_; }

  bool TryPack(float texels_per_mu, int side_px) {
    std::vector<Eigen::Vector2i> sizes;
    sizes.reserve(charts_.size());
    for (const FlatChart& chart : charts_) {
      const Eigen::Vector2f size_px = chart.extents_mu * texels_per_mu;
      if (size_px.maxCoeff() > static_cast<float>(side_px)) return false;
      sizes.push_back(size_px.array().ceil().cast<int>() + 1 + 2 * padding_px_);
    }
    std::optional<PackedRects> packed = PackRects(sizes, side_px);
    if (!packed.has_value()) return false;
    corner_px_ = std::move(packed->corner_px);
    texels_per_mu_ = texels_per_mu;
    side_px_ = side_px;
    return true;
  }

  // Of the last successful packing. In units of texels; the center of the first texel is at 0.5.
  Eigen::Vector2f AtlasPosition_px(size_t chart, size_t vertex) const {
    return corner_px_[chart].cast<float>() + Eigen::Vector2f::Constant(static_cast<float>(padding_px_) + 0.5f) +
           texels_per_mu_ * charts_[chart].flat_mu[vertex];
  }
  int Side_px() const { return side_px_; }

 private:
  const std::vector<FlatChart>& charts_;
  const int padding_px_;
  float area_mu2_ = 0, longest_mu_ = 0;
  std::vector<Eigen::Vector2i> corner_px_;
  float texels_per_mu_ = 0;
  int side_px_ = 0;
};

bool PackAtRequestedScale(const UnwrapOptions& options, int max_side_px, AtlasPacker& packer) {
  if (!(options.texels_per_mu > 0)) return false;
  const float least_px = std::sqrt(packer.AreaOfBoxes_mu2()) * options.texels_per_mu;
  if (!(least_px <= static_cast<float>(max_side_px))) return false;
  int side_px = std::max(static_cast<int>(least_px) / kSideStep_px * kSideStep_px, kSmallestSide_px);
  for (; side_px <= max_side_px; side_px += kSideStep_px) {
    if (packer.TryPack(options.texels_per_mu, side_px)) return true;
  }
  return false;
}

bool PackAtLargestScale(int max_side_px, AtlasPacker& packer) {
  // A square with the area of all boxes, or with the longest side of any box, is too small.
  const float least_mu = std::max(std::sqrt(packer.AreaOfBoxes_mu2()), packer.LongestSide_mu());
  float high = least_mu > 0 ? static_cast<float>(max_side_px) / least_mu : 1.0f;
  float low = high * kTinyScale;
  if (!packer.TryPack(low, max_side_px)) return false;
  for (int step = 0; step < kScaleSteps; ++step) {
    const float middle = (low + high) / 2;
    (packer.TryPack(middle, max_side_px) ? low : high) = middle;
  }
  return packer.TryPack(low, max_side_px);
}

absl::Status ValidateUnwrapOptions(const UnwrapOptions& options) {
  if (options.max_atlas_px < kSmallestSide_px || options.max_atlas_px > 8192) {
    return InvalidArgument("max_atlas_px is {}, must be {}..8192", options.max_atlas_px, kSmallestSide_px);
  }
  if (options.padding_px < 0 || options.padding_px > 16) {
    return InvalidArgument("padding_px is {}, must be 0..16", options.padding_px);
  }
  if (!(options.texels_per_mu >= 0) || !std::isfinite(options.texels_per_mu)) {
    return InvalidArgument("texels_per_mu is {}, must be 0 or a positive number", options.texels_per_mu);
  }
  if (!(options.max_angle_rad > 0 && options.max_angle_rad <= kMaxFaceAngle_rad)) {
    return InvalidArgument("max_angle_rad is {}, must be above 0 and at most {}", options.max_angle_rad,
                           kMaxFaceAngle_rad);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<TexturedMesh> UnwrapMesh(const Mesh& mesh, const UnwrapOptions& options) {
  ROMAP_RETURN_IF_ERROR(ValidateUnwrapOptions(options));
  TexturedMesh result;
  result.atlas_px = kSmallestSide_px;
  if (mesh.triangles.empty()) return result;
  const std::vector<Chart> charts = DivideIntoCharts(mesh, {.max_angle_rad = options.max_angle_rad});

  std::vector<FlatChart> flat_charts(charts.size());
  result.mesh.triangles.resize(mesh.triangles.size());
  std::vector<uint32_t> copy_of(mesh.vertices.size());                 // the vertex in the current chart ...
  std::vector<size_t> copied_in(mesh.vertices.size(), charts.size());  // ... if this is the current chart
  uint32_t vertices = 0;
  for (size_t i = 0; i < charts.size(); ++i) {
    FlatChart& flat = flat_charts[i];
    const PlaneProjection project(charts[i].normal);
    for (const uint32_t face : charts[i].faces) {
      for (int corner = 0; corner < 3; ++corner) {
        const uint32_t vertex = mesh.triangles[face][corner];
        if (copied_in[vertex] != i) {
          copied_in[vertex] = i;
          copy_of[vertex] = vertices++;
          flat.vertices.push_back(vertex);
          flat.flat_mu.push_back(project(mesh.vertices[vertex]));
        }
        result.mesh.triangles[face][corner] = copy_of[vertex];
      }
    }
    RotateToSmallestBox(flat);
  }

  AtlasPacker packer(flat_charts, options.padding_px);
  const int max_side_px = options.max_atlas_px / kSideStep_px * kSideStep_px;
  if (!PackAtRequestedScale(options, max_side_px, packer) && !PackAtLargestScale(max_side_px, packer)) {
    return InvalidArgument(
        "the surface of {} triangles divides into {} charts, which do not fit into a texture of {} px; a smoother mesh "
        "or a larger max_atlas_px is needed",
        mesh.triangles.size(), charts.size(), max_side_px);
  }
  result.atlas_px = packer.Side_px();
  for (size_t i = 0; i < flat_charts.size(); ++i) {
    for (size_t j = 0; j < flat_charts[i].vertices.size(); ++j) {
      const uint32_t vertex = flat_charts[i].vertices[j];
      result.mesh.vertices.push_back(mesh.vertices[vertex]);
      if (!mesh.normals.empty()) result.mesh.normals.push_back(mesh.normals[vertex]);
      if (!mesh.colors.empty()) result.mesh.colors.push_back(mesh.colors[vertex]);
      if (!mesh.confidence.empty()) result.mesh.confidence.push_back(mesh.confidence[vertex]);
      result.mesh.uv.push_back(packer.AtlasPosition_px(i, j) / static_cast<float>(result.atlas_px));
    }
  }
  return result;
}

}  // namespace romap::texture
