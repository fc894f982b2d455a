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
  for (const Eigen::Vector3f& vertex : mesh->vertices) EXPECT_NEAR(vertex.norm(), 0.6f, 0.02f);
  EXPECT_EQ(update->texture.media_type, "image/jpeg");
  const cv::Mat image =
      cv::imdecode(std::vector<uint8_t>(update->texture.image.begin(), update->texture.image.end()), cv::IMREAD_COLOR);
  ASSERT_FALSE(image.empty());
  const cv::Scalar mean = cv::mean(image);
  EXPECT_LT(mean[0], 10);
  EXPECT_NEAR(mean[2], 200, 10);
}

TEST(MeshEncodingTest, MeshesOfFieldsThatStillTrainHaveNoTexture) {
  FieldSnapshot snapshot = RedBall();
  snapshot.converged = false;
  const auto update = MakeMeshUpdate(snapshot, {});
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_TRUE(update->texture.image.empty());
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
