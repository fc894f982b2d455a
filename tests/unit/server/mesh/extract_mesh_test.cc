#include "server/mesh/extract_mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "common/angles.h"
#include "common/status.h"
#include "tests/unit/server/mesh/field_fakes.h"
#include "tests/unit/server/mesh/mesh_checks.h"

namespace romap::mesh::extract_mesh_test {

using ::testing::HasSubstr;

constexpr double kPi = std::numbers::pi;

Mesh Extract(const FieldSnapshot& snapshot, const MeshConfig& config = {}) {
  absl::StatusOr<Mesh> mesh = ExtractMesh(snapshot, config);
  EXPECT_TRUE(mesh.ok()) << mesh.status();
  return mesh.ok() ? *std::move(mesh) : Mesh{};
}

TEST(ExtractMesh, SphereIsAccurateToAFractionOfAVoxel) {
  const InsideDistance sphere = Sphere(0.6f);
  const Mesh mesh = Extract(SnapshotOf(sphere));
  const Topology topology = CheckTopology(mesh);
  EXPECT_TRUE(topology.IsClosedManifold());
  EXPECT_EQ(topology.components, 1u);
  EXPECT_EQ(topology.euler_characteristic, 2);
  EXPECT_NEAR(Volume(mesh), 4.0 / 3.0 * kPi * 0.216, 0.003 * 0.905);
  EXPECT_NEAR(Area(mesh), 4.0 * kPi * 0.36, 0.003 * 4.524);
  EXPECT_LT(LargestDistance(mesh, sphere), 0.0012);  // a voxel is 0.032
}

TEST(ExtractMesh, NormalsHaveUnitLengthAndPointOutward) {
  const Mesh mesh = Extract(SnapshotOf(Sphere(0.6f)));
  ASSERT_EQ(mesh.normals.size(), mesh.vertices.size());
  double worst_cosine = 1;
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    EXPECT_NEAR(mesh.normals[i].norm(), 1.0f, 1e-5f);
    worst_cosine = std::min<double>(worst_cosine, mesh.normals[i].dot(mesh.vertices[i].normalized()));
  }
  EXPECT_GT(worst_cosine, std::cos(5.0 * kRadPerDeg));
}

TEST(ExtractMesh, ColorsAreThoseOfTheFieldAtTheVertices) {
  const FieldSnapshot snapshot = SnapshotOf(Sphere(0.6f));
  const Mesh mesh = Extract(snapshot);
  ASSERT_EQ(mesh.colors.size(), mesh.vertices.size());
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    EXPECT_EQ(mesh.colors[i], DistanceField::ColorAt(mesh.vertices[i], snapshot.box_half_extents));
  }
}

TEST(ExtractMesh, TorusKeepsItsHole) {
  const InsideDistance torus = Torus(0.6f, 0.2f);
  const Mesh mesh = Extract(SnapshotOf(torus));
  const Topology topology = CheckTopology(mesh);
  EXPECT_TRUE(topology.IsClosedManifold());
  EXPECT_EQ(topology.euler_characteristic, 0);
  EXPECT_NEAR(Volume(mesh), 2 * kPi * kPi * 0.6 * 0.04, 0.01 * 0.474);
  EXPECT_LT(LargestDistance(mesh, torus), 0.003);
}

TEST(ExtractMesh, FlatBoxesHaveFlatVoxels) {
  const InsideDistance book = [](const Eigen::Vector3f& p) {
    const Eigen::Vector3f d = Eigen::Vector3f(0.8f, 0.6f, 0.08f) - p.cwiseAbs();
    return d.minCoeff();
  };
  const Mesh mesh = Extract(SnapshotOf(book, {0.9f, 0.7f, 0.1f}));
  EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
  EXPECT_NEAR(Volume(mesh), 8 * 0.8 * 0.6 * 0.08, 0.01 * 0.307);
}

TEST(ExtractMesh, ScalingTheMapScalesTheMesh) {
  const Mesh reference = Extract(SnapshotOf(Sphere(0.6f)));
  for (const float scale : {0.01f, 100.0f}) {
    const Mesh mesh = Extract(SnapshotOf(Sphere(0.6f * scale), Eigen::Vector3f::Constant(scale)));
    EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
    EXPECT_NEAR(Volume(mesh) / std::pow(scale, 3), Volume(reference), 1e-4);
    EXPECT_LT(LargestDistance(mesh, Sphere(0.6f * scale)) / scale, 0.0012);
  }
}

TEST(ExtractMesh, ObjectsThatExtendBeyondTheBoxAreClosedAtTheBox) {
  const Mesh mesh = Extract(SnapshotOf([](const Eigen::Vector3f& p) { return 0.2f - p.z(); }));
  EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
  EXPECT_NEAR(Volume(mesh), 4 * 1.2, 0.02 * 4.8);
}

TEST(ExtractMesh, SolidNodesOutsideTheHullAreRemoved) {
  FieldSnapshot snapshot = SnapshotOf(Sphere(0.8f));
  snapshot.hull.resolution = 8;
  for (int cell = 0; cell < 512; ++cell) snapshot.hull.bits.push_back(cell % 8 < 4);  // x < 0 only
  const Mesh mesh = Extract(snapshot);
  EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
  EXPECT_NEAR(Volume(mesh), 2.0 / 3.0 * kPi * 0.512, 0.03);
  for (const Eigen::Vector3f& p : mesh.vertices) EXPECT_LT(p.x(), 0.04f);  // at most a voxel beyond the hull
}

TEST(ExtractMesh, TheHullMayBeFinerThanTheGrid) {
  FieldSnapshot snapshot = SnapshotOf(Sphere(0.5f));
  snapshot.hull.resolution = 50;
  snapshot.hull.bits.assign(50 * 50 * 50, 1);
  MeshConfig config;
  config.resolution = 20;
  EXPECT_NEAR(Volume(Extract(snapshot, config)), 4.0 / 3.0 * kPi * 0.125, 0.02);
}

TEST(ExtractMesh, FloatersAreRemoved) {
  const InsideDistance scene = Union({Sphere(0.4f), Sphere(0.15f, {0.7f, 0.7f, 0.7f})});
  const Mesh mesh = Extract(SnapshotOf(scene));
  EXPECT_EQ(CheckTopology(mesh).components, 1u);
  EXPECT_NEAR(Volume(mesh), 4.0 / 3.0 * kPi * 0.064, 0.01);
}

TEST(ExtractMesh, ComponentsAboveTheMinimumShareAreKept) {
  const InsideDistance scene =
      Union({Sphere(0.3f, {-0.5f, 0, 0}), Sphere(0.27f, {0.5f, 0, 0})});  // the smaller has 0.73 of the volume
  MeshConfig config;
  config.min_component_share = 0.6;
  EXPECT_EQ(CheckTopology(Extract(SnapshotOf(scene), config)).components, 2u);
  config.min_component_share = 0.9;
  EXPECT_EQ(CheckTopology(Extract(SnapshotOf(scene), config)).components, 1u);
}

// The stem is below the surface level, as thin parts can be; it still connects the small sphere to the large one.
TEST(ExtractMesh, AStemBelowTheSurfaceLevelConnectsItsEnds) {
  const InsideDistance spheres = Union({Sphere(0.35f, {-0.6f, 0, 0}), Sphere(0.15f, {0.7f, 0, 0})});
  const InsideDistance scene = [&](const Eigen::Vector3f& p) {
    return std::max(spheres(p), Stem(-0.6f, 0.7f, 0.006f)(p));  // raw = level - 1 at the nodes nearest to its axis
  };
  FieldSnapshot snapshot = SnapshotOf(scene);
  EXPECT_EQ(CheckTopology(Extract(snapshot)).components, 2u);
  snapshot.connect_level = snapshot.surface_level;
  EXPECT_EQ(CheckTopology(Extract(snapshot)).components, 1u);
}

TEST(ExtractMesh, CavitiesAreFilled) {
  const InsideDistance shell = [](const Eigen::Vector3f& p) { return 0.1f - std::abs(p.norm() - 0.6f); };
  const Mesh mesh = Extract(SnapshotOf(shell));
  EXPECT_EQ(CheckTopology(mesh).components, 1u);
  EXPECT_NEAR(Volume(mesh), 4.0 / 3.0 * kPi * 0.343, 0.01);
}

// An upside-down bowl: its cavity opens downward, and all cameras look from above.
TEST(ExtractMesh, InvisibleSpaceIsFilled) {
  const InsideDistance bowl = [](const Eigen::Vector3f& p) {
    return std::min(0.1f - std::abs(p.norm() - 0.6f), p.z() + 0.05f);
  };
  FieldSnapshot snapshot = SnapshotOf(bowl);
  const double hollow_volume = Volume(Extract(snapshot));
  for (int i = 0; i < 8; ++i) {
    snapshot.cameras.push_back(ViewFrom({4 * std::cos(i * kPi / 4), 4 * std::sin(i * kPi / 4), 3.0}));
  }
  // The hull contains only the space above the rim.
  snapshot.hull.resolution = 40;
  for (int cell = 0; cell < 64000; ++cell) snapshot.hull.bits.push_back(cell / 1600 >= 19);
  const Mesh mesh = Extract(snapshot);
  EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
  EXPECT_EQ(CheckTopology(mesh).components, 1u);
  const double dome_volume = 2.0 / 3.0 * kPi * 0.343 + 0.05 * kPi * 0.49;
  EXPECT_LT(hollow_volume, 0.65 * dome_volume);
  EXPECT_NEAR(Volume(mesh), dome_volume, 0.06 * dome_volume);

  MeshConfig config;
  config.fill_unseen = false;
  EXPECT_LT(Volume(Extract(snapshot, config)), 0.65 * dome_volume);
}

// A box on a table, seen from above from all sides, so that the masks do not show its lower end.
TEST(ExtractMesh, EndsAtTheLowestVisibleHeight) {
  const InsideDistance column = [](const Eigen::Vector3f& p) {  // the lower end is at z = -0.6
    return std::min({0.5f - p.head<2>().cwiseAbs().maxCoeff(), 0.5f - p.z(), p.z() + 0.6f});
  };
  FieldSnapshot snapshot = SnapshotOf(column);
  for (int i = 0; i < 24; ++i) {
    snapshot.cameras.push_back(ViewFrom({4 * std::cos(i * kPi / 12), 4 * std::sin(i * kPi / 12), 2.0}));
  }
  const auto lowest = [](const Mesh& mesh) {
    float z = 1e9f;
    for (const Eigen::Vector3f& p : mesh.vertices) z = std::min(z, p.z());
    return z;
  };
  const Mesh mesh = Extract(snapshot);
  EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
  EXPECT_NEAR(lowest(mesh), -0.6f, 0.048f);  // a voxel and a half
  EXPECT_NEAR(Volume(mesh), 1.1, 0.04);

  MeshConfig config;
  config.cut_below_support = false;
  EXPECT_LT(lowest(Extract(snapshot, config)), -0.7f);
}

// Its lowest part turns away from the views above. Where they show nothing, the hull is the only limit.
TEST(ExtractMesh, ARoundBottomIsKept) {
  FieldSnapshot snapshot = SnapshotOf(Sphere(0.6f));
  for (int i = 0; i < 24; ++i) {
    snapshot.cameras.push_back(ViewFrom({4 * std::cos(i * kPi / 12), 4 * std::sin(i * kPi / 12), 2.5}));
  }
  const Mesh mesh = Extract(snapshot);
  float lowest = 1e9f;
  for (const Eigen::Vector3f& p : mesh.vertices) lowest = std::min(lowest, p.z());
  EXPECT_NEAR(lowest, -0.6f, 0.06f);
  EXPECT_NEAR(Volume(mesh), 4.0 / 3.0 * kPi * 0.216, 0.03 * 0.905);
}

// A cone that stands on its tip: its normals point downward, but do not turn, so nothing is known below the lowest part
// that the views show.
TEST(ExtractMesh, AnInclinedWallIsNoRoundBottom) {
  const InsideDistance cone = [](const Eigen::Vector3f& p) {  // cut at z = -0.5, radius 0.2 there
    return std::min({0.92f * (0.2f + 0.42f * (p.z() + 0.5f) - p.head<2>().norm()), 0.5f - p.z(), p.z() + 0.5f});
  };
  FieldSnapshot snapshot = SnapshotOf(cone);
  for (int i = 0; i < 24; ++i) {
    snapshot.cameras.push_back(ViewFrom({4 * std::cos(i * kPi / 12), 4 * std::sin(i * kPi / 12), 2.0}));
  }
  float lowest = 1e9f;
  for (const Eigen::Vector3f& p : Extract(snapshot).vertices) lowest = std::min(lowest, p.z());
  EXPECT_GT(lowest, -0.52f);
  EXPECT_LT(lowest, -0.43f);
}

TEST(ExtractMesh, AVisibleUndersideIsNotCut) {
  FieldSnapshot snapshot = SnapshotOf(Sphere(0.6f));
  const double whole = Volume(Extract(snapshot));
  for (int i = 0; i < 6; ++i) {
    snapshot.cameras.push_back(ViewFrom({4 * std::cos(i * kPi / 3), 4 * std::sin(i * kPi / 3), i % 2 ? 3.0 : -3.0}));
  }
  EXPECT_NEAR(Volume(Extract(snapshot)), whole, 0.01 * whole);
}

TEST(ExtractMesh, ViewsFromStraightAboveCutNothing) {
  FieldSnapshot snapshot = SnapshotOf([](const Eigen::Vector3f& p) { return 0.5f - p.cwiseAbs().maxCoeff(); });
  snapshot.cameras = {ViewFrom({0.1, 0, 6}), ViewFrom({0, 0.1, 6}), ViewFrom({-0.1, 0, 6})};
  EXPECT_GT(Volume(Extract(snapshot)), 1.0);
}

// An upright bowl: a camera looks into it.
TEST(ExtractMesh, VisibleSpaceStaysEmpty) {
  const InsideDistance bowl = [](const Eigen::Vector3f& p) {
    return std::min(0.1f - std::abs(p.norm() - 0.6f), 0.05f - p.z());
  };
  FieldSnapshot snapshot = SnapshotOf(bowl);
  const double hollow_volume = Volume(Extract(snapshot));
  snapshot.cameras.push_back(ViewFrom({0.3f, 0.2f, 5.0f}));
  for (int i = 0; i < 8; ++i) {
    snapshot.cameras.push_back(ViewFrom({4 * std::cos(i * kPi / 4), 4 * std::sin(i * kPi / 4), 0.0}));
  }
  snapshot.cameras.push_back(ViewFrom({0.0f, 0.0f, -4.0f}));
  EXPECT_NEAR(Volume(Extract(snapshot)), hollow_volume, 0.04 * hollow_volume);
}

TEST(ExtractMesh, NanCountsAsEmpty) {
  const InsideDistance half_nan = [](const Eigen::Vector3f& p) {
    if (p.x() > 0.05f) return std::numeric_limits<float>::quiet_NaN();
    if (p.norm() < 0.2f) return std::numeric_limits<float>::infinity();
    return 0.6f - p.norm();
  };
  FieldSnapshot snapshot = SnapshotOf(half_nan);
  snapshot.cameras = {ViewFrom({0, 0, 5}), ViewFrom({std::numeric_limits<double>::quiet_NaN(), 0, 0})};
  const Mesh mesh = Extract(snapshot);
  EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
  for (const Eigen::Vector3f& p : mesh.vertices) ASSERT_TRUE(p.allFinite());
}

TEST(ExtractMesh, ErrorsOfEmptyFieldsNameTheObject) {
  const InsideDistance nowhere = [](const Eigen::Vector3f&) { return -1.0f; };
  const InsideDistance nan = [](const Eigen::Vector3f&) { return std::numeric_limits<float>::quiet_NaN(); };
  for (const InsideDistance& field : {nowhere, nan}) {
    const absl::Status status = ExtractMesh(SnapshotOf(field), {}).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_EQ(Message(status), "object/3: the field is nowhere above the surface level");
  }
}

TEST(ExtractMesh, ErrorsOfInvalidSnapshotsNameTheObject) {
  const auto error = [](const FieldSnapshot& snapshot) {
    const absl::Status status = ExtractMesh(snapshot, {}).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    return Message(status);
  };
  FieldSnapshot snapshot = SnapshotOf(Sphere(0.5f));
  snapshot.field = nullptr;
  EXPECT_THAT(error(snapshot), HasSubstr("object/3: the snapshot has no field"));
  snapshot = SnapshotOf(Sphere(0.5f));
  snapshot.box_half_extents.y() = 0;
  EXPECT_THAT(error(snapshot), HasSubstr("half extents 1 0 1"));
  snapshot = SnapshotOf(Sphere(0.5f));
  snapshot.hull.resolution = 4;
  EXPECT_THAT(error(snapshot), HasSubstr("hull has 0 cells, must have 4^3"));
  snapshot = SnapshotOf(Sphere(0.5f));
  snapshot.surface_level = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(error(snapshot), HasSubstr("surface_level nan"));
}

TEST(MeshConfig, FieldsCanBeSet) {
  MeshConfig config;
  ConfigFields fields;
  fields.Section("mesh");
  config.Fields(fields);
  const std::vector<std::string> assignments = {"mesh.resolution=96", "mesh.fill_unseen=false"};
  ASSERT_TRUE(fields.Set(assignments).ok());
  EXPECT_EQ(config.resolution, 96);
  EXPECT_FALSE(config.fill_unseen);
}

}  // namespace romap::mesh::extract_mesh_test
