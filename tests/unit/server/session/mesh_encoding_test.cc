#include "server/session/mesh_encoding.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "common/mesh_codec.h"
#include "tests/unit/server/mesh/field_fakes.h"

namespace romap::session::mesh_encoding_test {

// A ball that is red in all of its views.
FieldSnapshot RedBall() {
  FieldSnapshot snapshot = mesh::SnapshotOf(mesh::Sphere(0.6f));
  snapshot.converged = true;
  for (int k = 0; k < 8; ++k) {
    const double azimuth = k * 2 * EIGEN_PI / 8;
    snapshot.cameras.push_back(mesh::ViewFrom({3 * std::cos(azimuth), 3 * std::sin(azimuth), 1}));
    snapshot.cameras.back().color_bgr = cv::Mat(400, 400, CV_8UC3, cv::Scalar(0, 0, 200));
  }
  return snapshot;
}

TEST(MeshEncodingTest, AFinalMeshIsSimpleAndHasTheColorsOfTheImages) {
  const auto update = MakeMeshUpdate(RedBall(), {});
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_TRUE(update->final);
  EXPECT_LE(update->triangle_count, 8000u);
  const auto mesh = DecodeDraco(update->draco);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->uv.size(), mesh->vertices.size());
  // Below the last tangents of the views nothing limits the ball but its round bottom.
  for (const Eigen::Vector3f& vertex : mesh->vertices) {
    EXPECT_NEAR(vertex.norm(), 0.6f, vertex.z() < -0.3f ? 0.035f : 0.02f);
  }
  EXPECT_EQ(update->texture.media_type, "image/jpeg");
  const cv::Mat image =
      cv::imdecode(std::vector<uint8_t>(update->texture.image.begin(), update->texture.image.end()), cv::IMREAD_COLOR);
  ASSERT_FALSE(image.empty());
  const cv::Scalar mean = cv::mean(image);
  EXPECT_LT(mean[0], 10);
  EXPECT_NEAR(mean[2], 200, 10);
}

TEST(MeshEncodingTest, AFinalMeshHasSimplerLevelsWithItsTexture) {
  const auto update = MakeMeshUpdate(RedBall(), {});
  ASSERT_TRUE(update.ok()) << update.status();
  ASSERT_FALSE(update->levels.empty());
  uint32_t triangles = update->triangle_count;
  double error_mu = 0;
  for (const MeshLevel& level : update->levels) {
    EXPECT_LT(level.triangle_count, 0.6 * triangles);
    EXPECT_GT(level.error_mu, error_mu);
    triangles = level.triangle_count;
    error_mu = level.error_mu;
    const auto mesh = DecodeDraco(level.draco);
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    EXPECT_EQ(mesh->triangles.size(), level.triangle_count);
    EXPECT_EQ(mesh->uv.size(), mesh->vertices.size());
    // Flat triangles cut into the ball.
    for (const auto& [a, b, c] : mesh->triangles) {
      const Eigen::Vector3f center = (mesh->vertices[a] + mesh->vertices[b] + mesh->vertices[c]) / 3.0f;
      EXPECT_NEAR(center.norm(), 0.6f, 0.02f + 3 * level.error_mu);
    }
  }
}

TEST(MeshEncodingTest, AnObjectThatWasSeenFromOneSideHasANextView) {
  FieldSnapshot snapshot = RedBall();
  snapshot.converged = false;
  snapshot.cameras.resize(1);  // from x
  const auto update = MakeMeshUpdate(snapshot, {});
  ASSERT_TRUE(update.ok()) << update.status();
  ASSERT_TRUE(update->next_view.has_value());
  EXPECT_LT(update->next_view->direction.x(), 0.3);
}

TEST(MeshEncodingTest, MeshesOfFieldsThatStillTrainHaveNoTexture) {
  FieldSnapshot snapshot = RedBall();
  snapshot.converged = false;
  const auto update = MakeMeshUpdate(snapshot, {});
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_TRUE(update->texture.image.empty());
  EXPECT_TRUE(update->levels.empty());
  EXPECT_FALSE(DecodeDraco(update->draco)->colors.empty());
}

TEST(MeshEncodingTest, TheTextureCanBeSwitchedOff) {
  mesh::MeshConfig config;
  config.texture = false;
  const auto update = MakeMeshUpdate(RedBall(), config);
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_TRUE(update->texture.image.empty());
  EXPECT_GT(update->triangle_count, 8000u);
}

TEST(MeshEncodingTest, WithoutImagesTheFinalMeshKeepsItsColors) {
  FieldSnapshot snapshot = RedBall();
  for (TrainingCamera& camera : snapshot.cameras) camera.color_bgr = cv::Mat();
  const auto update = MakeMeshUpdate(snapshot, {});
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_TRUE(update->texture.image.empty());
  EXPECT_FALSE(DecodeDraco(update->draco)->colors.empty());
}

}  // namespace romap::session::mesh_encoding_test
