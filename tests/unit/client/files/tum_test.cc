#include "client/files/tum.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace romap::files::tum_test {

using ::testing::HasSubstr;

std::string TempPath(const std::string& name) {
  return testing::TempDir() + "romap_" + testing::UnitTest::GetInstance()->current_test_info()->name() + "_" + name;
}

TEST(TumTest, RoundTripSortsByTime) {
  const std::string path = TempPath("poses.txt");
  const Eigen::Quaterniond q(Eigen::AngleAxisd(1.2, Eigen::Vector3d(1, -2, 3).normalized()));
  const std::vector<StampedPose> poses{{2'000'000'001, {q, Eigen::Vector3d(1, 2, 3)}},
                                       {1'000'000'000, {Eigen::Quaterniond::Identity(), Eigen::Vector3d(-4, 5, 6)}}};
  ASSERT_TRUE(WriteTum(path, poses).ok());
  const auto read = ReadTum(path);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ((*read)[0].timestamp_ns, 1'000'000'000);
  EXPECT_EQ((*read)[1].timestamp_ns, 2'000'000'001);
  EXPECT_LT((*read)[1].T_world_camera.rotation().angularDistance(q), 1e-8);
  EXPECT_TRUE((*read)[1].T_world_camera.translation().isApprox(Eigen::Vector3d(1, 2, 3), 1e-9));
  std::filesystem::remove(path);
}

TEST(TumTest, NamesTheInvalidLine) {
  const std::string path = TempPath("poses.txt");
  for (const auto& [text, message] : std::vector<std::pair<std::string, std::string>>{
           {"0 0 0 0 0 0 0 1\n0 1 2 3\n", "poses.txt:2: 4 fields"},
           {"0 nan 0 0 0 0 0 1\n", "poses.txt:1: 'nan' is not a finite number"},
           {"x 0 0 0 0 0 0 1\n", "poses.txt:1: 'x' is not a finite number"},
           {"1e30 0 0 0 0 0 0 1\n", "poses.txt:1: '1e30' is not a finite number"},
           {"0 0 0 0 0 0 0 2\n", "quaternion norm is 2.000"},
           {"# empty\n", "contains no poses"}}) {
    std::ofstream(path) << text;
    EXPECT_THAT(std::string(ReadTum(path).status().message()), HasSubstr(message));
  }
  std::filesystem::remove(path);
}

TEST(PoseAtTest, InterpolatesBetweenTwoPoses) {
  const std::vector<StampedPose> poses{
      {0, {Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()}},
      {20'000'000, {Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ())), Eigen::Vector3d(2, 0, 0)}}};
  const auto pose = PoseAt(poses, 10'000'000, 10'000'000);
  ASSERT_TRUE(pose.has_value());
  EXPECT_NEAR(Eigen::AngleAxisd(pose->rotation()).angle(), 0.2, 1e-12);
  EXPECT_NEAR(pose->translation().x(), 1, 1e-12);
  EXPECT_FALSE(PoseAt(poses, 10'000'000, 9'999'999).has_value());
  EXPECT_TRUE(PoseAt(poses, 25'000'000, 5'000'000).has_value());
  EXPECT_FALSE(PoseAt(poses, -5'000'001, 5'000'000).has_value());
  EXPECT_FALSE(PoseAt({}, 0, 5'000'000).has_value());
}

}  // namespace romap::files::tum_test
