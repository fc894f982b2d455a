#include "server/mesh/confidence.h"

#include <gtest/gtest.h>

#include <numeric>

#include "server/mesh/extract_mesh.h"
#include "tests/unit/server/mesh/field_fakes.h"
#include "tests/unit/server/mesh/mesh_checks.h"

namespace romap::mesh::confidence_test {

constexpr double kFar = 4.0;

Mesh Extract(FieldSnapshot snapshot, const std::vector<TrainingCamera>& views, const MeshConfig& config = {}) {
  snapshot.cameras = views;
  absl::StatusOr<Mesh> mesh = ExtractMesh(snapshot, config);
  EXPECT_TRUE(mesh.ok()) << mesh.status();
  return mesh.ok() ? *std::move(mesh) : Mesh{};
}

// Confidence of the vertex nearest to a point.
float ConfidenceAt(const Mesh& mesh, const Eigen::Vector3f& point) {
  const auto nearest = std::min_element(mesh.vertices.begin(), mesh.vertices.end(), [&](const auto& a, const auto& b) {
    return (a - point).squaredNorm() < (b - point).squaredNorm();
  });
  return mesh.confidence[static_cast<size_t>(nearest - mesh.vertices.begin())];
}

// Extraction without the rules that edit the field.
MeshConfig UneditedConfig() {
  MeshConfig config;
  config.fill_unseen = false;
  config.cut_below_support = false;
  return config;
}

TEST(Confidence, DecreasesWithTheViewingAngle) {
  const Mesh mesh = Extract(SnapshotOf(Sphere(0.6f)), {ViewFrom({kFar, 0, 0})}, UneditedConfig());
  ASSERT_EQ(mesh.confidence.size(), mesh.vertices.size());
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Eigen::Vector3f to_view = Eigen::Vector3f(kFar, 0, 0) - mesh.vertices[i];
    const float cosine = mesh.vertices[i].normalized().dot(to_view.normalized());
    const float expected = cosine > 0 ? 1 - std::exp(-cosine / 2) : 0;
    if (std::abs(cosine) < 0.05f) continue;
    EXPECT_NEAR(mesh.confidence[i], expected, 0.02f) << "cosine " << cosine;
  }
}

TEST(Confidence, GrowsWithTheNumberAndResolutionOfViews) {
  const FieldSnapshot ball = SnapshotOf(Sphere(0.6f));
  const Eigen::Vector3f front(0.6f, 0, 0);
  const TrainingCamera view = ViewFrom({kFar, 0, 0});
  const auto with = [&](const std::vector<TrainingCamera>& views) {
    return ConfidenceAt(Extract(ball, views, UneditedConfig()), front);
  };
  EXPECT_NEAR(with({view}), 0.39f, 0.01f);
  EXPECT_NEAR(with({view, view, view, view, view}), 0.92f, 0.01f);
  EXPECT_NEAR(with(std::vector<TrainingCamera>(40, view)), 1.0f, 1e-3f);  // more views than are used
  // At a distance of 25 from the front, a side of length 2 is 32 px long.
  EXPECT_NEAR(with({ViewFrom({25.6f, 0, 0})}), 1 - std::exp(-0.25f), 0.01f);
}

TEST(Confidence, HiddenVerticesAreNotObserved) {
  const InsideDistance row = Union({Sphere(0.25f, {0.5f, 0, 0}), Sphere(0.25f, {-0.5f, 0, 0})});
  const FieldSnapshot snapshot = SnapshotOf(row);
  const Eigen::Vector3f front_of_second(-0.25f, 0, 0);
  EXPECT_EQ(ConfidenceAt(Extract(snapshot, {ViewFrom({kFar, 0, 0})}, UneditedConfig()), front_of_second), 0);
  // From above both spheres are visible.
  const Mesh mesh = Extract(snapshot, {ViewFrom({0.1f, 0, kFar})}, UneditedConfig());
  EXPECT_NEAR(ConfidenceAt(mesh, {-0.5f, 0, 0.25f}), 0.39f, 0.02f);
  EXPECT_NEAR(ConfidenceAt(mesh, {0.5f, 0, 0.25f}), 0.39f, 0.02f);
}

TEST(Confidence, OnlyPixelsOfTheObjectCount) {
  const FieldSnapshot ball = SnapshotOf(Sphere(0.6f));
  TrainingCamera view = ViewFrom({kFar, 0, 0});
  // The image y axis of this view points along +y of the object.
  const Eigen::Vector3f upper(0.5f, -0.3f, 0), lower(0.5f, 0.3f, 0);
  ASSERT_LT(view.camera.Project(view.T_camera_object * upper.cast<double>()).y(), 180);
  const auto confidences = [&] {
    const Mesh mesh = Extract(ball, {view}, UneditedConfig());
    return std::pair(ConfidenceAt(mesh, upper), ConfidenceAt(mesh, lower));
  };
  view.ray_kind.rowRange(0, 200).setTo(static_cast<int>(RayKind::kOccluder));
  const auto [occluded, visible] = confidences();
  EXPECT_EQ(occluded, 0);
  EXPECT_GT(visible, 0.3f);
  view.roi_px = {1000, 0, 400, 400};  // the crop does not contain the object
  EXPECT_EQ(confidences(), std::pair(0.0f, 0.0f));
}

TEST(Confidence, InvalidViewsAreIgnored) {
  TrainingCamera no_pose = ViewFrom({std::numeric_limits<float>::quiet_NaN(), 0, 0});
  TrainingCamera no_mask = ViewFrom({kFar, 0, 0});
  no_mask.ray_kind = cv::Mat();
  TrainingCamera no_focal = ViewFrom({kFar, 0, 0});
  no_focal.camera.fx_px = std::numeric_limits<double>::quiet_NaN();
  const TrainingCamera inside = ViewFrom({0.1f, 0, 0});
  const Mesh mesh = Extract(SnapshotOf(Sphere(0.6f)), {no_pose, no_mask, no_focal, inside}, UneditedConfig());
  for (const float confidence : mesh.confidence) EXPECT_EQ(confidence, 0);
}

TEST(TrimUnseen, KeepsTheObservedSurfaceAsAValidMesh) {
  const FieldSnapshot ball = SnapshotOf(Sphere(0.6f));
  MeshConfig config = UneditedConfig();
  const Mesh whole = Extract(ball, {ViewFrom({kFar, 0, 0})}, config);
  config.trim_unseen = true;
  config.trim_confidence = 0.05;
  const Mesh trimmed = Extract(ball, {ViewFrom({kFar, 0, 0})}, config);
  EXPECT_NEAR(Area(trimmed) / Area(whole), 0.4, 0.06);  // the part with cosine > 0.1, from a distance of 4
  ASSERT_EQ(trimmed.normals.size(), trimmed.vertices.size());
  ASSERT_EQ(trimmed.colors.size(), trimmed.vertices.size());
  ASSERT_EQ(trimmed.confidence.size(), trimmed.vertices.size());
  std::vector<bool> used(trimmed.vertices.size(), false);
  for (const auto& triangle : trimmed.triangles) {
    float best = 0;
    for (const uint32_t v : triangle) {
      ASSERT_LT(v, trimmed.vertices.size());
      used[v] = true;
      best = std::max(best, trimmed.confidence[v]);
    }
    EXPECT_GE(best, 0.05f);
  }
  EXPECT_EQ(std::count(used.begin(), used.end(), false), 0);
  for (size_t i = 0; i < trimmed.vertices.size(); ++i) {
    EXPECT_GT(trimmed.normals[i].dot(trimmed.vertices[i].normalized()), 0.99f);  // each vertex keeps its own normal
  }
}

TEST(TrimUnseen, FailsIfNoViewObservedTheObject) {
  MeshConfig config;
  config.trim_unseen = true;
  const absl::Status status = ExtractMesh(SnapshotOf(Sphere(0.6f)), config).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
}

}  // namespace romap::mesh::confidence_test
