#include "server/slam/projection_search.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/unit/server/slam/random_descriptor.h"
#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam::projection_search_test {

class ProjectionSearchTest : public ::testing::Test {
 protected:
  ProjectionSearchTest() {
    Frame frame;
    frame.camera = TexturedWorld().camera();
    std::uniform_real_distribution<double> side(-1, 1);
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector3d p_world(side(random_), 0.7 * side(random_), 4);
      const Descriptor descriptor = RandomDescriptor(random_);
      Feature feature;
      feature.pixel_px = frame.camera.Project(p_world).cast<float>();
      feature.descriptor = Flip(descriptor, 12);
      features_.push_back(feature);
      points_.push_back({.id = MapPointId{static_cast<uint64_t>(i + 1)},
                         .position_world = p_world,
                         .direction_world = p_world.normalized(),
                         .size_mu = p_world.norm() / frame.camera.fx_px,
                         .descriptor = descriptor});
    }
    frame_ = MakeFrameFeatures(frame, features_);
  }

  std::mt19937_64 random_{5};
  std::vector<Feature> features_;
  std::vector<LocalPoint> points_;
  std::shared_ptr<const FrameFeatures> frame_;
};

TEST_F(ProjectionSearchTest, FindsPointsNearTheirProjection) {
  const SE3<World, Camera> close(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.02, 0, 0));
  const auto matches = ProjectionMatcher(*frame_, close).MatchAll(points_, {.radius_px = 8}, {});
  EXPECT_GE(matches.size(), 58U);
  for (const PointMatch& match : matches) EXPECT_EQ(match.point, match.feature);
  const SE3<World, Camera> far(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.3, 0, 0));
  EXPECT_LE(ProjectionMatcher(*frame_, far).MatchAll(points_, {.radius_px = 8}, {}).size(), 1U);
}

TEST_F(ProjectionSearchTest, IgnoresImpossibleMatches) {
  const SE3<World, Camera> here;
  ProjectionMatcher matcher(*frame_, here);
  LocalPoint point = points_[0];
  ASSERT_TRUE(matcher.Find(point, {}, {}));
  std::vector<uint8_t> taken(features_.size(), 0);
  taken[0] = 1;
  EXPECT_FALSE(matcher.Find(point, {}, taken));
  LocalPoint from_behind = point;
  from_behind.direction_world = -point.direction_world;
  EXPECT_FALSE(matcher.Find(from_behind, {}, {}));
  LocalPoint much_larger = point;
  much_larger.size_mu *= 3;
  EXPECT_FALSE(matcher.Find(much_larger, {}, {}));
  LocalPoint behind_the_camera = point;
  behind_the_camera.position_world = -point.position_world;
  behind_the_camera.direction_world = -point.direction_world;
  EXPECT_FALSE(matcher.Find(behind_the_camera, {}, {}));
  LocalPoint with_other_descriptor = point;
  with_other_descriptor.descriptor = Flip(point.descriptor, 120);
  EXPECT_FALSE(matcher.Find(with_other_descriptor, {}, {}));
}

TEST_F(ProjectionSearchTest, DescriptorsAloneFindThePoints) {
  const auto matches = MatchByDescriptors(points_, *frame_, 60, 0.8);
  EXPECT_EQ(matches.size(), points_.size());
  for (const PointMatch& match : matches) EXPECT_EQ(match.point, match.feature);
}

}  // namespace romap::slam::projection_search_test
