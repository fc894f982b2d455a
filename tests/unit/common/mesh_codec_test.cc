#include "common/mesh_codec.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>

#include "common/angles.h"
#include "common/status.h"

namespace romap::mesh_codec_test {

using ::testing::HasSubstr;

// A closed torus around z with `rings` x `rings` vertices, outward triangles, and a color that identifies the vertex.
Mesh Torus(int rings, float ring_radius, float tube_radius, const Eigen::Vector3f& center) {
  Mesh mesh;
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < rings; ++j) {
      const float u = 2 * static_cast<float>(M_PI) * i / rings;
      const float v = 2 * static_cast<float>(M_PI) * j / rings;
      const Eigen::Vector3f outward(std::cos(u) * std::cos(v), std::sin(u) * std::cos(v), std::sin(v));
      const Eigen::Vector3f ring(std::cos(u) * ring_radius, std::sin(u) * ring_radius, 0);
      mesh.vertices.push_back(center + ring + tube_radius * outward);
      mesh.normals.push_back(outward);
      mesh.colors.push_back({static_cast<uint8_t>(i), static_cast<uint8_t>(j), static_cast<uint8_t>(i * 7 + j)});
    }
  }
  const auto index = [&](int i, int j) { return static_cast<uint32_t>(i % rings * rings + j % rings); };
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < rings; ++j) {
      mesh.triangles.push_back({index(i, j), index(i + 1, j), index(i + 1, j + 1)});
      mesh.triangles.push_back({index(i, j), index(i + 1, j + 1), index(i, j + 1)});
    }
  }
  return mesh;
}

double Volume(const Mesh& mesh) {
  double volume = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    volume += mesh.vertices[a].dot(mesh.vertices[b].cross(mesh.vertices[c])) / 6;
  }
  return volume;
}

Mesh RoundTrip(const Mesh& mesh, const DracoOptions& options = {}) {
  absl::StatusOr<std::string> bytes = EncodeDraco(mesh, options);
  EXPECT_TRUE(bytes.ok()) << bytes.status();
  if (!bytes.ok()) return {};
  absl::StatusOr<Mesh> decoded = DecodeDraco(*bytes);
  EXPECT_TRUE(decoded.ok()) << decoded.status();
  return decoded.ok() ? *std::move(decoded) : Mesh{};
}

std::string EncodeError(const Mesh& mesh, const DracoOptions& options = {}) {
  const absl::Status status = EncodeDraco(mesh, options).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
  return Message(status);
}

std::string DecodeError(const std::string& bytes) {
  const absl::Status status = DecodeDraco(bytes).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
  return Message(status);
}

TEST(MeshCodec, ConfidenceIsKeptToAByte) {
  Mesh mesh = Torus(12, 1, 0.3F, Eigen::Vector3f::Zero());
  for (const Eigen::Vector3f& p : mesh.vertices) mesh.confidence.push_back(0.5F + 0.3F * p.x());
  const Mesh decoded = RoundTrip(mesh);
  ASSERT_EQ(decoded.confidence.size(), decoded.vertices.size());
  for (size_t i = 0; i < decoded.vertices.size(); ++i) {
    EXPECT_NEAR(decoded.confidence[i], std::clamp(0.5F + 0.3F * decoded.vertices[i].x(), 0.0F, 1.0F), 0.003F);
  }
  mesh.confidence.pop_back();
  EXPECT_THAT(EncodeError(mesh), HasSubstr("mesh has 143 confidences for 144 vertices"));
}

TEST(MeshCodec, RoundTripKeepsGeometryWithinAHundredthOfAMillimeter) {
  const Mesh mesh = Torus(40, 0.1f, 0.05f, {0.4f, -0.2f, 0.1f});  // 30 cm across
  const Mesh decoded = RoundTrip(mesh);
  ASSERT_EQ(decoded.vertices.size(), mesh.vertices.size());
  ASSERT_EQ(decoded.triangles.size(), mesh.triangles.size());
  ASSERT_EQ(decoded.colors.size(), mesh.colors.size());
  ASSERT_EQ(decoded.normals.size(), mesh.normals.size());
  for (size_t k = 0; k < decoded.vertices.size(); ++k) {
    const size_t original = decoded.colors[k][0] * 40 + decoded.colors[k][1];  // the color identifies the vertex
    ASSERT_EQ(decoded.colors[k], mesh.colors[original]);
    EXPECT_LT((decoded.vertices[k] - mesh.vertices[original]).cwiseAbs().maxCoeff(), 1e-5f);
    EXPECT_GT(decoded.normals[k].dot(mesh.normals[original]), std::cos(0.7 * kRadPerDeg));
    EXPECT_NEAR(decoded.normals[k].norm(), 1.0f, 1e-4f);
  }
}

// The color of a vertex identifies it, because the order of the vertices changes.
TEST(MeshCodec, RoundTripKeepsTextureCoordinatesWithinAnEighthOfATexel) {
  Mesh mesh = Torus(20, 0.1f, 0.04f, {0, 0, 0});
  std::map<Rgb8, Eigen::Vector2f> uv;
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    mesh.uv.emplace_back(static_cast<float>(i) / 400, 1 - static_cast<float>(i % 20) / 20);
    uv[mesh.colors[i]] = mesh.uv[i];
  }
  const Mesh decoded = RoundTrip(mesh);
  ASSERT_EQ(decoded.uv.size(), mesh.vertices.size());
  for (size_t i = 0; i < decoded.uv.size(); ++i) {
    EXPECT_LT((decoded.uv[i] - uv.at(decoded.colors[i])).cwiseAbs().maxCoeff(), 0.125f / 1024);
  }
}

TEST(MeshCodec, VerticesAtTheSamePositionKeepTheirTextureCoordinates) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  mesh.uv = {{0, 0}, {0.25f, 0}, {0, 0.25f}, {0.75f, 0.5f}, {0.5f, 0.75f}, {1, 1}};
  mesh.triangles = {{0, 1, 2}, {3, 5, 4}};
  const Mesh decoded = RoundTrip(mesh);
  ASSERT_EQ(decoded.uv.size(), 6u);
  EXPECT_EQ(std::count_if(decoded.vertices.begin(), decoded.vertices.end(),
                          [](const auto& v) { return (v - Eigen::Vector3f(1, 0, 0)).norm() < 1e-3f; }),
            2);
}

TEST(MeshCodec, RoundTripKeepsOrientation) {
  Mesh mesh = Torus(24, 0.1f, 0.05f, {0, 0, 0});
  ASSERT_GT(Volume(mesh), 0);
  EXPECT_NEAR(Volume(RoundTrip(mesh)), Volume(mesh), 1e-3 * Volume(mesh));
  for (auto& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
  EXPECT_NEAR(Volume(RoundTrip(mesh)), Volume(mesh), -1e-3 * Volume(mesh));
}

TEST(MeshCodec, MoreBitsAreMorePrecise) {
  const Mesh mesh = Torus(24, 100.0f, 50.0f, {0, 0, 0});
  const auto error = [&](int bits) {
    const Mesh decoded = RoundTrip(mesh, {.position_bits = bits});
    float worst = 0;
    for (size_t k = 0; k < decoded.vertices.size(); ++k) {
      const size_t original = decoded.colors[k][0] * 24 + decoded.colors[k][1];
      worst = std::max(worst, (decoded.vertices[k] - mesh.vertices[original]).cwiseAbs().maxCoeff());
    }
    return worst;
  };
  EXPECT_LT(error(8), 300.0f / 256);
  EXPECT_LT(error(16), 300.0f / 65536);
  EXPECT_GT(error(8), error(16));
}

TEST(MeshCodec, NormalsAndColorsAreOptional) {
  Mesh mesh = Torus(12, 0.1f, 0.05f, {0, 0, 0});
  mesh.normals.clear();
  EXPECT_TRUE(RoundTrip(mesh).normals.empty());
  EXPECT_EQ(RoundTrip(mesh).colors.size(), mesh.colors.size());
  mesh.colors.clear();
  EXPECT_TRUE(RoundTrip(mesh).colors.empty());
  EXPECT_EQ(RoundTrip(mesh).vertices.size(), mesh.vertices.size());
}

TEST(MeshCodec, DegenerateTrianglesAndUnusedVerticesAreDropped) {
  Mesh mesh = Torus(12, 0.1f, 0.05f, {0, 0, 0});
  const size_t good = mesh.triangles.size();
  mesh.triangles.insert(mesh.triangles.begin() + 5, {7, 7, 8});
  mesh.triangles.push_back({3, 3, 3});
  mesh.vertices.push_back({9, 9, 9});
  mesh.normals.push_back({0, 0, 1});
  mesh.colors.push_back({1, 2, 3});
  const Mesh decoded = RoundTrip(mesh);
  EXPECT_EQ(decoded.triangles.size(), good);
  EXPECT_EQ(decoded.vertices.size(), 144u);
}

TEST(MeshCodec, TrianglesWithoutAreaAndOpenBordersAreKept) {
  Mesh mesh;
  mesh.vertices = {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}};
  mesh.triangles = {{0, 1, 2}};
  EXPECT_EQ(RoundTrip(mesh).triangles.size(), 1u);
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 1, 2}, {2, 1, 3}, {0, 1, 4}};  // three triangles at one edge: not a manifold
  EXPECT_EQ(RoundTrip(mesh).triangles.size(), 3u);
}

TEST(MeshCodec, InvalidMeshesAreRejectedWithTheReason) {
  EXPECT_THAT(EncodeError({}), HasSubstr("no triangle"));
  Mesh mesh = Torus(6, 1.0f, 0.5f, {0, 0, 0});
  mesh.triangles[4][1] = 36;
  EXPECT_THAT(EncodeError(mesh), HasSubstr("triangle 4 uses vertex 36, but the mesh has 36 vertices"));
  mesh = Torus(6, 1.0f, 0.5f, {0, 0, 0});
  mesh.vertices[2].y() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(EncodeError(mesh), HasSubstr("vertex 2 is not finite"));
  mesh = Torus(6, 1.0f, 0.5f, {0, 0, 0});
  mesh.colors.pop_back();
  EXPECT_THAT(EncodeError(mesh), HasSubstr("35 colors for 36 vertices"));
  mesh = Torus(6, 1.0f, 0.5f, {0, 0, 0});
  mesh.triangles = {{1, 1, 2}};
  EXPECT_THAT(EncodeError(mesh), HasSubstr("no triangle with three different vertices"));
  EXPECT_THAT(EncodeError(Torus(6, 1.0f, 0.5f, {0, 0, 0}), {.position_bits = 31}),
              HasSubstr("position_bits must be 1..30, got 31"));
}

TEST(MeshCodec, OtherBytesThanADracoMeshAreRejected) {
  EXPECT_THAT(DecodeError(""), HasSubstr("not a Draco mesh: the 0 bytes"));
  EXPECT_THAT(DecodeError("hello, world"), HasSubstr("do not start with DRACO"));
  EXPECT_THAT(DecodeError("DRACO\x02\x02"), HasSubstr("truncated after 7 bytes"));
  const std::string sequential("DRACO\x02\x02\x01\x00\x00\x00\x00\x10\x10", 14);
  EXPECT_THAT(DecodeError(sequential), HasSubstr("method 0"));
}

TEST(MeshCodec, SizesInTheHeaderAreCheckedBeforeAllocation) {
  std::string bytes("DRACO\x02\x02\x01\x01\x00\x00\x00", 12);
  bytes += std::string("\x10", 1) + "\xff\xff\xff\xff\x07";  // 16 vertices, 2^31 - 1 triangles
  bytes += std::string(64, '\x01');
  EXPECT_THAT(DecodeError(bytes), HasSubstr("header has 2147483647 triangles"));
}

TEST(MeshCodec, EveryTruncatedStreamIsRejected) {
  const std::string bytes = *EncodeDraco(Torus(8, 0.1f, 0.05f, {0, 0, 0}));
  for (size_t length = 0; length < bytes.size(); ++length) {
    EXPECT_FALSE(DecodeDraco(bytes.substr(0, length)).ok()) << length << " of " << bytes.size();
  }
}

// Decoding a stream with flipped bits gives a valid mesh or an error.
TEST(MeshCodec, DamagedStreamsGiveAValidMeshOrAnError) {
  const std::string bytes = *EncodeDraco(Torus(10, 0.1f, 0.05f, {0, 0, 0}));
  std::mt19937 random(5);
  for (int round = 0; round < 1500; ++round) {
    std::string damaged = bytes;
    for (uint32_t flips = 1 + random() % 4; flips > 0; --flips) damaged[random() % damaged.size()] ^= 1 << random() % 8;
    const absl::StatusOr<Mesh> mesh = DecodeDraco(damaged);
    if (!mesh.ok()) {
      EXPECT_EQ(mesh.status().code(), absl::StatusCode::kInvalidArgument);
      continue;
    }
    for (const auto& triangle : mesh->triangles) {
      for (const uint32_t index : triangle) ASSERT_LT(index, mesh->vertices.size());
    }
  }
}

}  // namespace romap::mesh_codec_test
