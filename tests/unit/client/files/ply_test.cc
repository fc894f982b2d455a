#include "client/files/ply.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <numbers>
#include <random>

#include "client/files/text_file.h"
#include "common/mesh_faces.h"

namespace romap::files::ply_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string TempPath(const std::string& name) {
  return testing::TempDir() + "romap_" + testing::UnitTest::GetInstance()->current_test_info()->name() + "_" + name;
}

std::string ErrorOf(const absl::Status& status) { return std::string(status.message()); }

Mesh Tetrahedron() {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.normals = {{0, 0, -1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.colors = {{1, 2, 3}, {250, 251, 252}, {0, 0, 0}, {255, 255, 255}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return mesh;
}

std::string TetrahedronPly() {
  const std::string path = TempPath("tetrahedron.ply");
  EXPECT_TRUE(WritePly(path, Tetrahedron(), {{"seen", {0, 1, 1, 0}}, {"weight", {0.5, -1, 1e3, 2}}}).ok());
  const auto bytes = ReadFile(path);
  std::filesystem::remove(path);
  return *bytes;
}

TEST(PlyTest, RoundTrip) {
  const auto file = ParsePly(TetrahedronPly(), "t.ply");
  ASSERT_TRUE(file.ok()) << file.status();
  const Mesh expected = Tetrahedron();
  EXPECT_EQ(file->mesh.vertices, expected.vertices);
  EXPECT_EQ(file->origin, Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(file->mesh.normals, expected.normals);
  EXPECT_EQ(file->mesh.colors, expected.colors);
  EXPECT_EQ(file->mesh.triangles, expected.triangles);
  EXPECT_THAT(file->scalars.at("seen"), ElementsAre(0, 1, 1, 0));
  EXPECT_THAT(file->scalars.at("weight"), ElementsAre(0.5, -1, 1e3, 2));
}

TEST(PlyTest, WritesTheConfidenceOfTheMesh) {
  Mesh mesh = Tetrahedron();
  mesh.confidence = {0, 0.25f, 1, 0.5f};
  const std::string path = TempPath("confident.ply");
  ASSERT_TRUE(WritePly(path, mesh, {{"seen", {0, 1, 1, 0}}}).ok());
  const auto bytes = ReadFile(path);
  EXPECT_THAT(*bytes, HasSubstr("property float confidence\n"));
  const auto file = ReadPly(path);
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_THAT(file->scalars.at("confidence"), ElementsAre(0, 0.25, 1, 0.5));
  EXPECT_THAT(file->scalars.at("seen"), ElementsAre(0, 1, 1, 0));
  EXPECT_EQ(file->mesh.colors, mesh.colors);
  EXPECT_THAT(ErrorOf(WritePly(path, mesh, {{"confidence", {0, 1, 1, 0}}})),
              HasSubstr("given both by the mesh and by the scalars"));
  mesh.confidence.pop_back();
  EXPECT_THAT(ErrorOf(WritePly(path, mesh)), HasSubstr("3 confidences"));
  std::filesystem::remove(path);
}

TEST(PlyTest, ReadsAsciiPolygonsWithPropertiesInAnyOrder) {
  const auto file = ParsePly(
      "ply\r\nformat ascii 1.0\r\ncomment hand-written\r\nelement vertex 5\r\nproperty uchar seen\r\nproperty double "
      "z\r\n"
      "property float y\r\nproperty float x\r\nelement face 2\r\nproperty uchar flags\r\n"
      "property list uchar uint vertex_index\r\nend_header\r\n"
      "1 0 0 0\r\n0 0 0 1\r\n1 0 1 1\r\n1 0 1 0\r\n1 2.5 0.5 0.5\r\n7 4 0 1 2 3\r\n7 3 0 1 4",
      "a.ply");
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_EQ(file->mesh.vertices[4], Eigen::Vector3f(0.5, 0.5, 2.5));
  using Triangle = std::array<uint32_t, 3>;
  EXPECT_THAT(file->mesh.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{0, 1, 4}));
  EXPECT_THAT(file->scalars.at("seen"), ElementsAre(1, 0, 1, 1, 1));
}

TEST(PlyTest, ReadsBigEndianPointClouds) {
  const std::string header =
      "ply\nformat binary_big_endian 1.0\nelement vertex 1\nproperty float x\nproperty short y\nproperty double z\n"
      "end_header\n";
  const std::string body("\x3f\x80\x00\x00\xff\xfe\x40\x08\x00\x00\x00\x00\x00\x00", 14);  // 1.0f, -2, 3.0
  const auto file = ParsePly(header + body, "b.ply");
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_EQ(file->mesh.vertices[0], Eigen::Vector3f(1, -2, 3));
  EXPECT_TRUE(file->mesh.triangles.empty());
}

TEST(PlyTest, KeepsTheShapeOfAMeshFarFromTheOrigin) {
  const Eigen::Quaterniond quarter_turn(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ()));
  const Sim3<World, Object> S_world_mesh(1e-3, quarter_turn, Eigen::Vector3d(500'000.1, 6'400'000.2, 0.5));
  const std::string path = TempPath("far.ply");
  ASSERT_TRUE(WriteWorldPly(path, Tetrahedron(), S_world_mesh).ok());
  const auto file = ReadPly(path);
  std::filesystem::remove(path);
  ASSERT_TRUE(file.ok()) << file.status();
  for (size_t k = 0; k < 4; ++k) {
    const Eigen::Vector3d expected = S_world_mesh * Tetrahedron().vertices[k].cast<double>();
    EXPECT_LT((file->Position(k) - expected).norm(), 2e-9) << k;
  }
  EXPECT_LT((file->mesh.normals[1] - Eigen::Vector3f(0, 1, 0)).norm(), 1e-6f);
  EXPECT_LT(file->mesh.vertices[1].norm(), 2e-3f) << "relative to an origin nearby";
}

TEST(PlyTest, NamesTheErrorInMalformedFiles) {
  const std::string good = TetrahedronPly();
  const auto error = [](const std::string& bytes) { return ErrorOf(ParsePly(bytes, "x.ply").status()); };
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string bytes = good;
    return bytes.replace(bytes.find(from), from.size(), to);
  };
  EXPECT_THAT(error(""), HasSubstr("x.ply: not a PLY file"));
  EXPECT_THAT(error("plyx"), HasSubstr("no end_header"));
  EXPECT_THAT(error(good.substr(0, 40)), HasSubstr("no end_header"));
  EXPECT_THAT(error(good.substr(0, good.size() - 7)), HasSubstr("'face' (4 rows declared) is truncated"));
  EXPECT_THAT(error(replaced("vertex 4", "vertex 400000000000")), HasSubstr("'vertex'"));
  EXPECT_THAT(error(replaced("vertex 4", "vertex -4")), HasSubstr("invalid PLY header line 'element vertex -4'"));
  EXPECT_THAT(error(replaced("float y", "quad y")), HasSubstr("invalid PLY header line 'property quad y'"));
  EXPECT_THAT(error(replaced("float y", "float x")), HasSubstr("invalid PLY header line 'property float x'"));
  EXPECT_THAT(error(replaced("float y", "float w")), HasSubstr("vertices lack x, y or z"));
  EXPECT_THAT(error(replaced("binary_little_endian", "binary_middle_endian")), HasSubstr("invalid PLY header line"));
  EXPECT_THAT(error(good.substr(0, good.size() - 4) + std::string("\xff\xff\x00\x00", 4)),
              HasSubstr("out of range 0..3"));
  std::string nan = good;
  nan.replace(good.find("end_header\n") + 11, 4, std::string("\x00\x00\xc0\x7f", 4));
  EXPECT_THAT(error(nan), HasSubstr("1 vertices are not finite"));
  EXPECT_THAT(error("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
                    "end_header\n0 zero 0\n"),
              HasSubstr("truncated or malformed"));
  EXPECT_THAT(error("ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\n"
                    "end_header\n"),
              HasSubstr("no vertices"));
}

// Sanitizer builds check that damaged files cause no invalid memory access.
TEST(PlyTest, RejectsDamagedFilesOrReadsAValidMesh) {
  const std::string good = TetrahedronPly();
  for (size_t length = 0; length < good.size(); ++length) {
    EXPECT_FALSE(ParsePly(good.substr(0, length), "x.ply").ok()) << length;
  }
  std::mt19937 random(1);
  for (int round = 0; round < 2000; ++round) {
    std::string bytes = good;
    for (int k = 0; k < 3; ++k) bytes[random() % bytes.size()] = static_cast<char>(random());
    const auto file = ParsePly(bytes, "x.ply");
    if (file.ok()) {
      EXPECT_TRUE(ValidateMesh(file->mesh, "x").ok());
    }
  }
}

TEST(PlyTest, RejectsArraysOfDifferentLengths) {
  EXPECT_THAT(ErrorOf(WritePly(TempPath("x.ply"), Tetrahedron(), {{"seen", {1}}})), HasSubstr("1 values of 'seen'"));
  Mesh mesh = Tetrahedron();
  mesh.colors.pop_back();
  EXPECT_THAT(ErrorOf(WritePly(TempPath("x.ply"), mesh)), HasSubstr("3 colors for 4 vertices"));
}

TEST(PlyTest, WriteReportsAMissingFolder) {
  const absl::Status status = WritePly("/nowhere/x.ply", Tetrahedron());
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(ErrorOf(status), "/nowhere/x.ply: cannot write: No such file or directory");
}

}  // namespace romap::files::ply_test
