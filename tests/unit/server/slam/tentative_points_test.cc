#include "server/slam/tentative_points.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "common/statistics.h"
#include "server/slam/features/feature_extractor.h"
#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam::tentative_points_test {

class TentativePointsTest : public ::testing::Test {
 protected:
  std::shared_ptr<const FrameFeatures> MakeFeatures(double angle_deg, bool with_depth = false) {
    auto frame = world_.Render(next_id_++, TexturedWorld::OrbitPose(angle_deg));
    if (with_depth) frame->depth_mu = world_.RenderDepth(*frame);
    return MakeFrameFeatures(*frame, extractor_.ExtractScene(*frame));
  }

  void Record(double angle_deg, bool with_depth = false, size_t features_with_point = 0) {
    const auto features = MakeFeatures(angle_deg, with_depth);
    std::vector<MapPointId> points(features->size());
    for (size_t i = 0; i < std::min(features_with_point, points.size()); ++i) points[i] = MapPointId{i + 1};
    tentative_.Record(features, TexturedWorld::OrbitPose(angle_deg), std::move(points), 1.6);
    features_ = features->size();
  }

  static double MedianError_mu(const std::vector<LocalPoint>& points) {
    std::vector<double> errors_mu;
    for (const LocalPoint& point : points) {
      errors_mu.push_back(TexturedWorld::DistanceToSurface_mu(point.position_world));
    }
    return errors_mu.empty() ? 1e9 : Median(std::move(errors_mu));
  }

  const TexturedWorld world_{480, 360};
  FeatureExtractor extractor_{SlamConfig{}};
  TentativePoints tentative_{SlamConfig{}};
  uint64_t next_id_ = 1;
  size_t features_ = 0;  // of the newest frame
};

TEST_F(TentativePointsTest, ComeFromParallax) {
  Record(0);
  EXPECT_TRUE(tentative_.Make().empty());
  Record(4);
  const std::vector<LocalPoint> points = tentative_.Make();
  EXPECT_GT(points.size(), features_ / 4);
  EXPECT_LT(MedianError_mu(points), 0.03);  // of 1.6
  EXPECT_TRUE(std::none_of(points.begin(), points.end(), [](const LocalPoint& p) { return bool(p.id); }));
}

TEST_F(TentativePointsTest, UseTheNearestFrameWithEnoughBaseline) {
  Record(0);
  Record(3.5);
  Record(4);  // half a degree from the frame before
  EXPECT_GT(tentative_.Make().size(), features_ / 4);
}

TEST_F(TentativePointsTest, ComeFromTheDepthImage) {
  Record(0, /*with_depth=*/true);
  const std::vector<LocalPoint> points = tentative_.Make();
  EXPECT_GT(points.size(), features_ * 9 / 10);
  EXPECT_LT(MedianError_mu(points), 0.005);
}

TEST_F(TentativePointsTest, AreNotMadeFromFeaturesThatObserveAMapPoint) {
  Record(0, /*with_depth=*/true, /*features_with_point=*/10000);
  EXPECT_TRUE(tentative_.Make().empty());
  Record(0, /*with_depth=*/true, /*features_with_point=*/100);
  EXPECT_LE(tentative_.Make().size(), features_ - 100);
}

TEST_F(TentativePointsTest, MoveWithTheMap) {
  Record(0, /*with_depth=*/true);
  const std::vector<LocalPoint> before = tentative_.Make();
  const SE3<World, Camera> pose = TexturedWorld::OrbitPose(0);
  const SE3<World, Camera> moved(pose.rotation(), pose.translation() + Eigen::Vector3d(0, 0, 1));
  tentative_.Correct({pose, 1}, {moved, 1});
  const std::vector<LocalPoint> after = tentative_.Make();
  ASSERT_EQ(after.size(), before.size());
  for (size_t i = 0; i < before.size(); ++i) {
    EXPECT_NEAR((after[i].position_world - before[i].position_world - Eigen::Vector3d(0, 0, 1)).norm(), 0, 1e-9);
  }
}

TEST_F(TentativePointsTest, ResetDiscardsThem) {
  Record(0, /*with_depth=*/true);
  tentative_.Reset();
  EXPECT_TRUE(tentative_.Make().empty());
}

}  // namespace romap::slam::tentative_points_test
