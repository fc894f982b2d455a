#include "server/texture/unwrap_mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <set>

#include "server/texture/chart_plane.h"
#include "server/texture/mesh_edges.h"
#include "server/texture/simplify_mesh.h"
#include "tests/unit/server/texture/texture_scenes.h"

namespace romap::texture::unwrap_mesh_test {

ChartPlane::Triangle InAtlas(const TexturedMesh& textured, size_t face) {
  ChartPlane::Triangle triangle;
  for (int i = 0; i < 3; ++i) {
    triangle[i] = textured.mesh.uv[textured.mesh.triangles[face][i]].cast<double>() * textured.atlas_px;
  }
  return triangle;
}

double SignedArea(const ChartPlane::Triangle& t) {
  const Eigen::Vector2d u = t[1] - t[0], v = t[2] - t[0];
  return (u.x() * v.y() - u.y() * v.x()) / 2;
}

// Number of pairs of triangles whose common area is more than a hundredth of a texel wide: triangles are shrunk by it.
size_t CountOverlaps(const TexturedMesh& textured) {
  std::vector<ChartPlane::Triangle> triangles;
  std::map<std::pair<int, int>, std::vector<size_t>> cells;
  size_t overlaps = 0;
  for (size_t face = 0; face < textured.mesh.triangles.size(); ++face) {
    ChartPlane::Triangle t = InAtlas(textured, face);
    const Eigen::Vector2d center = (t[0] + t[1] + t[2]) / 3;
    for (Eigen::Vector2d& p : t) p = center + (p - center) * 0.99;
    if (std::abs(SignedArea(t)) < 1e-3) continue;
    const Eigen::Vector2d low = t[0].cwiseMin(t[1]).cwiseMin(t[2]) / 8, high = t[0].cwiseMax(t[1]).cwiseMax(t[2]) / 8;
    std::set<size_t> others;
    for (int y = static_cast<int>(low.y()); y <= static_cast<int>(high.y()); ++y) {
      for (int x = static_cast<int>(low.x()); x <= static_cast<int>(high.x()); ++x) {
        std::vector<size_t>& cell = cells[{x, y}];
        others.insert(cell.begin(), cell.end());
        cell.push_back(triangles.size());
      }
    }
    for (const size_t other : others) overlaps += TrianglesOverlap(t, triangles[other]);
    triangles.push_back(t);
  }
  return overlaps;
}

// Charts as connected parts of the atlas.
size_t CountCharts(const TexturedMesh& textured) {
  const std::vector<FaceNeighbors> neighbors = FindFaceNeighbors(textured.mesh.triangles);
  std::vector<uint8_t> visited(neighbors.size(), 0);
  size_t charts = 0;
  for (uint32_t seed = 0; seed < neighbors.size(); ++seed) {
    if (visited[seed] != 0) continue;
    ++charts;
    std::vector<uint32_t> open = {seed};
    visited[seed] = 1;
    while (!open.empty()) {
      const uint32_t face = open.back();
      open.pop_back();
      for (const uint32_t next : neighbors[face]) {
        if (next == kNoFace || visited[next] != 0) continue;
        visited[next] = 1;
        open.push_back(next);
      }
    }
  }
  return charts;
}

void ExpectValid(const Mesh& mesh, const TexturedMesh& textured, size_t max_charts, const char* what) {
  SCOPED_TRACE(what);
  ASSERT_EQ(textured.mesh.triangles.size(), mesh.triangles.size());
  ASSERT_EQ(textured.mesh.uv.size(), textured.mesh.vertices.size());
  double atlas_px2 = 0;
  size_t reversed = 0;
  for (size_t face = 0; face < mesh.triangles.size(); ++face) {
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(textured.mesh.vertices[textured.mesh.triangles[face][i]], mesh.vertices[mesh.triangles[face][i]]);
    }
    // Counter-clockwise in the image is negative with v down.
    const ChartPlane::Triangle triangle = InAtlas(textured, face);
    const double length = (triangle[1] - triangle[0]).norm() + (triangle[2] - triangle[0]).norm();
    reversed += SignedArea(triangle) > 1e-3 * length;  // more than the rounding of the coordinates
    atlas_px2 += std::abs(SignedArea(InAtlas(textured, face)));
  }
  EXPECT_EQ(reversed, 0u);
  for (const Eigen::Vector2f& uv : textured.mesh.uv) {
    EXPECT_GE(uv.minCoeff(), 0.0f);
    EXPECT_LE(uv.maxCoeff(), 1.0f);
  }
  EXPECT_EQ(CountOverlaps(textured), 0u);
  EXPECT_LE(CountCharts(textured), max_charts);
  const double share = atlas_px2 / textured.atlas_px / textured.atlas_px;
  EXPECT_GT(share, 0.35);
}

TEST(UnwrapMeshTest, ChartsDoNotOverlap) {
  const auto check = [](const Mesh& mesh, size_t max_charts, const char* what) {
    const absl::StatusOr<TexturedMesh> textured = UnwrapMesh(mesh, {.max_atlas_px = 512});
    ASSERT_TRUE(textured.ok()) << textured.status();
    EXPECT_EQ(textured->atlas_px, 512);
    ExpectValid(mesh, *textured, max_charts, what);
  };
  check(SphereMesh(24), 12, "sphere");
  check(BoxMesh(24, {1, 0.6, 0.3}), 12, "box");
  check(SimplifyMesh(BoxMesh(24, {1, 0.6, 0.3}), {.max_triangles = 8000, .max_error_mu = 1e-4f}).mesh, 12, "plain box");
  check(TorusMesh(80, 30, 0.4), 24, "torus");
  check(RoughMesh(25), 100, "rough");
  check(SimplifyMesh(RoughMesh(70), {.max_triangles = 8000, .max_error_mu = 0}).mesh, 100, "simplified rough");
}

TEST(UnwrapMeshTest, TheAtlasHasTheRequestedResolution) {
  const Mesh box = BoxMesh(10, {1, 1, 1});
  const absl::StatusOr<TexturedMesh> textured = UnwrapMesh(box, {.max_atlas_px = 1024, .texels_per_mu = 50});
  ASSERT_TRUE(textured.ok());
  // Six sides of 100 x 100 texels.
  EXPECT_GE(textured->atlas_px, 256);
  EXPECT_LE(textured->atlas_px, 352);
  double atlas_px2 = 0;
  for (size_t face = 0; face < box.triangles.size(); ++face) atlas_px2 -= SignedArea(InAtlas(*textured, face));
  EXPECT_NEAR(atlas_px2, 6e4, 1.2e3);
  const absl::StatusOr<TexturedMesh> limited = UnwrapMesh(box, {.max_atlas_px = 128, .texels_per_mu = 50});
  ASSERT_TRUE(limited.ok());
  EXPECT_EQ(limited->atlas_px, 128);
  EXPECT_EQ(CountOverlaps(*limited), 0u);
}

// Bilinear interpolation at the border of a chart reads texels around it.
TEST(UnwrapMeshTest, ChartsAreApart) {
  const TexturedMesh textured = *UnwrapMesh(RoughMesh(20), {.max_atlas_px = 512, .padding_px = 2});
  const std::vector<FaceNeighbors> neighbors = FindFaceNeighbors(textured.mesh.triangles);
  std::vector<Eigen::Vector2f> border;
  std::vector<int> chart(neighbors.size(), -1);
  int charts = 0;
  for (uint32_t seed = 0; seed < neighbors.size(); ++seed) {
    if (chart[seed] >= 0) continue;
    std::vector<uint32_t> open = {seed};
    chart[seed] = charts;
    while (!open.empty()) {
      const uint32_t face = open.back();
      open.pop_back();
      for (const uint32_t next : neighbors[face]) {
        if (next == kNoFace || chart[next] >= 0) continue;
        chart[next] = charts;
        open.push_back(next);
      }
    }
    ++charts;
  }
  std::vector<int> chart_of_vertex(textured.mesh.uv.size(), -1);
  for (size_t face = 0; face < neighbors.size(); ++face) {
    for (const uint32_t v : textured.mesh.triangles[face]) chart_of_vertex[v] = chart[face];
  }
  float nearest_px = 1e9f;
  for (size_t a = 0; a < textured.mesh.uv.size(); ++a) {
    for (size_t b = 0; b < a; ++b) {
      if (chart_of_vertex[a] == chart_of_vertex[b]) continue;
      nearest_px = std::min(nearest_px, (textured.mesh.uv[a] - textured.mesh.uv[b]).lpNorm<Eigen::Infinity>() *
                                            static_cast<float>(textured.atlas_px));
    }
  }
  EXPECT_GE(nearest_px, 3.9f);
}

TEST(UnwrapMeshTest, DegenerateMeshes) {
  const absl::StatusOr<TexturedMesh> empty = UnwrapMesh({}, {});
  ASSERT_TRUE(empty.ok());
  EXPECT_TRUE(empty->mesh.vertices.empty());
  EXPECT_EQ(empty->atlas_px, 64);
  Mesh triangle;
  triangle.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  triangle.triangles = {{0, 1, 2}};
  const absl::StatusOr<TexturedMesh> one = UnwrapMesh(triangle, {.max_atlas_px = 128});
  ASSERT_TRUE(one.ok());
  EXPECT_EQ(one->mesh.uv.size(), 3u);
  EXPECT_LT(SignedArea(InAtlas(*one, 0)), -3000);
  Mesh flat = triangle;  // without area
  flat.vertices[2] = {2, 0, 0};
  EXPECT_TRUE(UnwrapMesh(flat, {}).ok());
  flat.vertices = {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}};
  EXPECT_TRUE(UnwrapMesh(flat, {}).ok());
}

TEST(UnwrapMeshTest, InvalidOptionsAreExplained) {
  const auto message = [](const UnwrapOptions& options) {
    const absl::Status status = UnwrapMesh(SphereMesh(4), options).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    return std::string(status.message());
  };
  EXPECT_EQ(message({.max_atlas_px = 10}), "max_atlas_px is 10, must be 64..8192");
  EXPECT_EQ(message({.padding_px = -1}), "padding_px is -1, must be 0..16");
  EXPECT_EQ(message({.texels_per_mu = NAN}), "texels_per_mu is nan, must be 0 or a positive number");
  EXPECT_EQ(message({.max_angle_rad = 3}), "max_angle_rad is 3, must be above 0 and at most 1.4");
  Mesh scattered;  // many triangles without common edges
  for (int i = 0; i < 1000; ++i) {
    const auto v = static_cast<uint32_t>(scattered.vertices.size());
    const auto x = static_cast<float>(i);
    scattered.vertices.insert(scattered.vertices.end(), {{x, 0, 0}, {x + 1, 0, 0}, {x, 1, 0}});
    scattered.triangles.push_back({v, v + 1, v + 2});
  }
  EXPECT_EQ(UnwrapMesh(scattered, {.max_atlas_px = 64}).status().message(),
            "the surface of 1000 triangles divides into 1000 charts, which do not fit into a texture of 64 px; a "
            "smoother mesh or a larger max_atlas_px is needed");
}

}  // namespace romap::texture::unwrap_mesh_test
