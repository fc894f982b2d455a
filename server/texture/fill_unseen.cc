#include "server/texture/fill_unseen.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "server/texture/mesh_edges.h"

namespace romap::texture {
namespace {

// Passes of the interpolation over unseen vertices. The first passes reach all of them; the others make it smooth.
constexpr int kSmoothingPasses = 60;

// The difference between texture and vertex colors at the vertices. Vertices at the same position are one point.
class ColorOffsets {
 public:
  explicit ColorOffsets(const TexturedMesh& textured)
      : mesh_(textured.mesh), point_of_(NumberByPosition(textured.mesh)) {
    const size_t points = point_of_.empty() ? 0 : *std::max_element(point_of_.begin(), point_of_.end()) + 1;
    offset_.assign(points, Eigen::Array3f::Zero());
    weight_.assign(points, 0.0f);
  }

  Eigen::Array3f VertexColor(const SurfaceTexel& texel) const {
    if (mesh_.colors.empty()) return Eigen::Array3f::Constant(128.0f);
    Eigen::Array3f color_bgr = Eigen::Array3f::Zero();
    for (int i = 0; i < 3; ++i) {
      const Rgb8& rgb = mesh_.colors[mesh_.triangles[texel.face][i]];
      color_bgr += texel.barycentric[i] * Eigen::Array3f(rgb[2], rgb[1], rgb[0]);
    }
    return color_bgr;
  }

  // Beside the charts, texels are ignored.
  void AddSeen(const SurfaceTexel& texel, const Eigen::Array3f& color_bgr) {
    if (texel.barycentric.minCoeff() < 0) return;
    const Eigen::Array3f difference = color_bgr - VertexColor(texel);
    for (int i = 0; i < 3; ++i) {
      const uint32_t point = point_of_[mesh_.triangles[texel.face][i]];
      offset_[point] += texel.barycentric[i] * difference;
      weight_[point] += texel.barycentric[i];
    }
  }

  // Continues the differences to the points without any.
  void Spread() {
    std::vector<uint8_t> is_known(offset_.size(), 0), is_set(offset_.size(), 0);
    for (size_t point = 0; point < offset_.size(); ++point) {
      if (!(weight_[point] > 0)) continue;
      offset_[point] /= weight_[point];
      is_known[point] = is_set[point] = 1;
    }
    std::vector<std::vector<uint32_t>> neighbors(offset_.size());
    for (const auto& triangle : mesh_.triangles) {
      for (int i = 0; i < 3; ++i) {
        neighbors[point_of_[triangle[i]]].push_back(point_of_[triangle[(i + 1) % 3]]);
      }
    }
    // From near to far, so that one pass reaches all points.
    std::vector<uint32_t> order;
    for (uint32_t point = 0; point < offset_.size(); ++point) {
      if (is_known[point] != 0) order.push_back(point);
    }
    for (size_t i = 0; i < order.size(); ++i) {
      for (const uint32_t next : neighbors[order[i]]) {
        if (is_set[next] != 0) continue;
        is_set[next] = 1;
        offset_[next] = offset_[order[i]];
        order.push_back(next);
      }
    }
    for (int pass = 0; pass < kSmoothingPasses; ++pass) {
      for (const uint32_t point : order) {
        if (is_known[point] != 0) continue;
        Eigen::Array3f sum = Eigen::Array3f::Zero();
        float count = 0;
        for (const uint32_t next : neighbors[point]) {
          if (is_set[next] == 0) continue;
          sum += offset_[next];
          ++count;
        }
        if (count > 0) offset_[point] = sum / count;
      }
    }
  }

  Eigen::Array3f Filled(const SurfaceTexel& texel) const {
    Eigen::Array3f color_bgr = VertexColor(texel);
    for (int i = 0; i < 3; ++i) color_bgr += texel.barycentric[i] * offset_[point_of_[mesh_.triangles[texel.face][i]]];
    return color_bgr.max(0.0f).min(255.0f);
  }

 private:
  const Mesh& mesh_;
  std::vector<uint32_t> point_of_;  // of each vertex
  std::vector<Eigen::Array3f> offset_;
  std::vector<float> weight_;
};

cv::Vec3b Rounded(const Eigen::Array3f& color) {
  const Eigen::Array3i rounded = (color + 0.5f).cast<int>();
  return {static_cast<uint8_t>(rounded[0]), static_cast<uint8_t>(rounded[1]), static_cast<uint8_t>(rounded[2])};
}

// Sums of 2 x 2 pixels, the last row and column alone if there is an odd number.
cv::Mat HalfSize(const cv::Mat& sums) {
  cv::Mat half = cv::Mat::zeros((sums.rows + 1) / 2, (sums.cols + 1) / 2, CV_32FC4);
  for (int y = 0; y < sums.rows; ++y) {
    const auto* from = sums.ptr<cv::Vec4f>(y);
    auto* to = half.ptr<cv::Vec4f>(y / 2);
    for (int x = 0; x < sums.cols; ++x) to[x / 2] += from[x];
  }
  return half;
}

// Fills pixels that `is_known` does not mark (0).
void FillBetween(const cv::Mat& is_known, cv::Mat& color_bgr) {
  std::vector<cv::Mat> levels(1);  // blue, green, red and their number
  levels[0].create(color_bgr.size(), CV_32FC4);
  for (int y = 0; y < color_bgr.rows; ++y) {
    for (int x = 0; x < color_bgr.cols; ++x) {
      const cv::Vec3b& color = color_bgr.at<cv::Vec3b>(y, x);
      const bool known = is_known.at<uint8_t>(y, x) != 0;
      levels[0].at<cv::Vec4f>(y, x) = known ? cv::Vec4f(color[0], color[1], color[2], 1) : cv::Vec4f::all(0);
    }
  }
  while (levels.back().total() > 1) levels.push_back(HalfSize(levels.back()));
  for (size_t level = levels.size() - 1; level-- > 0;) {
    for (int y = 0; y < levels[level].rows; ++y) {
      auto* fine = levels[level].ptr<cv::Vec4f>(y);
      const auto* coarse = levels[level + 1].ptr<cv::Vec4f>(y / 2);
      for (int x = 0; x < levels[level].cols; ++x) {
        if (fine[x][3] == 0 && coarse[x / 2][3] > 0) fine[x] = coarse[x / 2] / coarse[x / 2][3];
      }
    }
  }
  for (int y = 0; y < color_bgr.rows; ++y) {
    for (int x = 0; x < color_bgr.cols; ++x) {
      const cv::Vec4f& sum = levels[0].at<cv::Vec4f>(y, x);
      color_bgr.at<cv::Vec3b>(y, x) = Rounded({sum[0], sum[1], sum[2]});
    }
  }
}

}  // namespace

void FillUnseen(const TexturedMesh& textured, std::span<const SurfaceTexel> texels, const cv::Mat& seen,
                cv::Mat& color_bgr) {
  ColorOffsets offsets(textured);
  cv::Mat is_surface = cv::Mat::zeros(seen.size(), CV_8UC1);
  size_t unseen = 0;
  for (const SurfaceTexel& texel : texels) {
    is_surface.data[texel.index] = 255;
    if (seen.data[texel.index] == 0) {
      ++unseen;
    } else {
      const auto& color = reinterpret_cast<const cv::Vec3b*>(color_bgr.data)[texel.index];
      offsets.AddSeen(texel, Eigen::Array3f(color[0], color[1], color[2]));
    }
  }
  if (unseen > 0) {
    offsets.Spread();
    for (const SurfaceTexel& texel : texels) {
      if (seen.data[texel.index] != 0) continue;
      reinterpret_cast<cv::Vec3b*>(color_bgr.data)[texel.index] = Rounded(offsets.Filled(texel));
    }
  }
  FillBetween(is_surface, color_bgr);
}

}  // namespace romap::texture
