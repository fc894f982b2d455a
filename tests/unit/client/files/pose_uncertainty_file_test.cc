#include "client/files/pose_uncertainty_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace romap::files::pose_uncertainty_file_test {

using ::testing::HasSubstr;

class PoseUncertaintyFile : public testing::Test {
 protected:
  PoseUncertaintyFile() {
    folder_ = testing::TempDir() + "romap_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::create_directories(folder_);
  }
  ~PoseUncertaintyFile() override { std::filesystem::remove_all(folder_); }

  std::string trajectory() const { return folder_ + "/trajectory.txt"; }

  std::string folder_;
};

TEST_F(PoseUncertaintyFile, IsReadBackByTimestamp) {
  const std::vector<StampedPose> written{{1'000'000'001, {}, PoseUncertainty{0.002, 0.0003}}, {2'000'000'000, {}, {}}};
  ASSERT_TRUE(WriteTrajectory(trajectory(), written).ok());
  EXPECT_EQ(UncertaintyPath(trajectory()), folder_ + "/trajectory_uncertainty.txt");
  auto poses = ReadTum(trajectory());
  ASSERT_TRUE(poses.ok()) << poses.status();
  ASSERT_TRUE(ReadUncertainties(UncertaintyPath(trajectory()), &*poses).ok());
  EXPECT_EQ((*poses)[0].uncertainty, written[0].uncertainty);
  EXPECT_EQ((*poses)[1].uncertainty, std::nullopt);
}

TEST_F(PoseUncertaintyFile, OfAnEarlierRunIsRemoved) {
  ASSERT_TRUE(WriteTrajectory(trajectory(), std::vector<StampedPose>{{1, {}, PoseUncertainty{1, 1}}}).ok());
  EXPECT_TRUE(std::filesystem::exists(UncertaintyPath(trajectory())));
  ASSERT_TRUE(WriteTrajectory(trajectory(), std::vector<StampedPose>{{1, {}, {}}}).ok());
  EXPECT_FALSE(std::filesystem::exists(UncertaintyPath(trajectory())));
}

TEST_F(PoseUncertaintyFile, NamesTheInvalidLine) {
  std::vector<StampedPose> poses(1);
  const std::string path = folder_ + "/sigmas.txt";
  for (const auto& [text, message] : std::vector<std::pair<std::string, std::string>>{
           {"0 1 1\n0 1\n", "sigmas.txt:2: 2 fields"},
           {"0 0 1\n", "sigmas.txt:1: expected a time and two positive numbers"},
           {"0 1 nan\n", "sigmas.txt:1: expected a time and two positive numbers"}}) {
    std::ofstream(path) << text;
    EXPECT_THAT(std::string(ReadUncertainties(path, &poses).message()), HasSubstr(message));
  }
  EXPECT_FALSE(ReadUncertainties(folder_ + "/missing.txt", &poses).ok());
}

}  // namespace romap::files::pose_uncertainty_file_test
