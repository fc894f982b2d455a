#include "server/slam/epipolar_matcher.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam::epipolar_matcher_test {

// Two cameras side by side, 10 degrees of parallax at the points' depth, and exact features of random points.
class EpipolarMatcherTest : public ::testing::Test {
 protected:
  EpipolarMatcherTest() {
    frame_.camera = TexturedWorld(640, 480).camera();
    std::uniform_real_distribution<double> side(-0.8, 0.8);
    for (size_t i = 0; i < 200; ++i) {
      Descriptor descriptor;
      for (uint64_t& word : descriptor) word = random_();
      Add({side(random_), 0.7 * side(random_), 3 + side(random_)}, descriptor);
    }
  }

  void Add(const Eigen::Vector3d& p_world, const Descriptor& descriptor) {
    first_.push_back(Project(p_world, kFirst, descriptor));
    second_.push_back(Project(p_world, kSecond, descriptor));
  }

  Feature Project(const Eigen::Vector3d& p_world, const SE3<World, Camera>& pose, const Descriptor& descriptor) const {
    const Eigen::Vector2d pixel_px = frame_.camera.Project(pose.Inverse() * p_world);
    return {.pixel_px = pixel_px.cast<float>(), .descriptor = descriptor};
  }

  static MapKeyframe MakeKeyframe(KeyframeId id, const Frame& frame, const SE3<World, Camera>& pose,
                                  const std::vector<Feature>& features) {
    MapKeyframe keyframe;
    keyframe.id = id;
    keyframe.frame = MakeFrameFeatures(frame, features);
    keyframe.points.resize(features.size());
    keyframe.SetPose(pose);
    return keyframe;
  }

  std::vector<FeatureMatch> Match() const {
    return MatchAlongEpipolarPlanes(MakeKeyframe(KeyframeId{2}, frame_, kFirst, first_),
                                    MakeKeyframe(KeyframeId{1}, frame_, kSecond, second_), SlamConfig{});
  }

  inline static const SE3<World, Camera> kFirst{Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, 0)};
  inline static const SE3<World, Camera> kSecond{Eigen::Quaterniond(Eigen::AngleAxisd(-0.1, Eigen::Vector3d::UnitY())),
                                                 Eigen::Vector3d(0.5, 0.1, 0.05)};

  std::mt19937_64 random_{11};
  Frame frame_;
  std::vector<Feature> first_;
  std::vector<Feature> second_;
};

TEST_F(EpipolarMatcherTest, MatchesEveryPoint) {
  const std::vector<FeatureMatch> matches = Match();
  EXPECT_EQ(matches.size(), first_.size());
  for (const FeatureMatch& match : matches) EXPECT_EQ(match.first, match.second);
}

TEST_F(EpipolarMatcherTest, MatchesPointsDuringForwardMotion) {
  const SE3<World, Camera> ahead(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.02, 0.01, 0.6));
  std::vector<Feature> features_ahead;
  SlamConfig config;
  config.min_parallax_deg = 0.2;
  const MapKeyframe here = MakeKeyframe(KeyframeId{1}, frame_, kFirst, first_);
  for (size_t i = 0; i < first_.size(); ++i) {
    features_ahead.push_back(Project(3 * here.BearingWorld(i), ahead, first_[i].descriptor));
  }
  const auto matches =
      MatchAlongEpipolarPlanes(MakeKeyframe(KeyframeId{2}, frame_, ahead, features_ahead), here, config);
  EXPECT_GT(matches.size(), first_.size() / 2);
  for (const FeatureMatch& match : matches) EXPECT_EQ(match.first, match.second);
}

TEST_F(EpipolarMatcherTest, IgnoresEqualDescriptorsOffTheEpipolarPlane) {
  for (size_t i = 0; i < 200; ++i) {
    Feature duplicate = second_[i];
    duplicate.pixel_px.y() += 25;
    second_.push_back(duplicate);
  }
  const std::vector<FeatureMatch> matches = Match();
  EXPECT_GT(matches.size(), 195);
  for (const FeatureMatch& match : matches) EXPECT_EQ(match.first, match.second);
}

TEST_F(EpipolarMatcherTest, RejectsEqualDescriptorsInTheEpipolarPlane) {
  const Descriptor duplicate{1, 2, 3, 4};
  Add({0, 0, 3}, duplicate);
  second_.push_back(Project({0, 0, 2.5}, kSecond, duplicate));  // on the same ray of the first camera
  EXPECT_EQ(Match().size(), 200);
}

TEST_F(EpipolarMatcherTest, SkipsFeaturesThatHaveAPoint) {
  MapKeyframe first = MakeKeyframe(KeyframeId{2}, frame_, kFirst, first_);
  first.points[17] = MapPointId{5};
  const auto matches =
      MatchAlongEpipolarPlanes(first, MakeKeyframe(KeyframeId{1}, frame_, kSecond, second_), SlamConfig{});
  EXPECT_EQ(matches.size(), first_.size() - 1);
}

TEST_F(EpipolarMatcherTest, ReturnsNoMatchesWithoutBaseline) {
  const MapKeyframe keyframe = MakeKeyframe(KeyframeId{1}, frame_, kFirst, first_);
  EXPECT_TRUE(MatchAlongEpipolarPlanes(keyframe, keyframe, SlamConfig{}).empty());
}

}  // namespace romap::slam::epipolar_matcher_test
