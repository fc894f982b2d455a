#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "client/files/associate.h"
#include "client/files/text_file.h"
#include "client/files/tum.h"

namespace romap::files {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

std::string TempPath(const std::string& name) {
  return testing::TempDir() + "romap_" + testing::UnitTest::GetInstance()->current_test_info()->name() + "_" + name;
}

TEST(ParseSecondsTest, KeepsAllDigitsOfAUnixTime) {
  EXPECT_EQ(ParseSeconds("1700000000.123456789"), 1700000000123456789);
  EXPECT_EQ(ParseSeconds("0.0333333333"), 33333333);
  EXPECT_EQ(ParseSeconds("0.9999999996"), 1000000000);
  EXPECT_EQ(ParseSeconds("-0.5"), -500000000);
  EXPECT_EQ(ParseSeconds("+7"), 7000000000);
  EXPECT_EQ(ParseSeconds("1.5e-3"), 1500000);
  EXPECT_EQ(ParseSeconds("1.2.3"), std::nullopt);
  EXPECT_EQ(ParseSeconds("inf"), std::nullopt);
  EXPECT_EQ(ParseSeconds("1e12"), std::nullopt);
  for (const int64_t t_ns : {int64_t{0}, int64_t{-1}, int64_t{-1500000000}, int64_t{1700000000123456789}}) {
    EXPECT_EQ(ParseSeconds(FormatSeconds(t_ns)), t_ns);
  }
}

TEST(ReadTableTest, SplitsAtBlanksOrCommas) {
  const std::string path = TempPath("table");
  std::ofstream(path) << "# head\n\n 1 \t two  3 # tail\r\na b";
  const auto words = ReadTable(path, ' ');
  ASSERT_TRUE(words.ok());
  EXPECT_EQ((*words)[0].number, 3);
  EXPECT_THAT((*words)[0].fields, ElementsAre("1", "two", "3"));
  EXPECT_THAT((*words)[1].fields, ElementsAre("a", "b"));
  std::ofstream(path) << "1, potted plant ,,\n";
  EXPECT_THAT((*ReadTable(path, ','))[0].fields, ElementsAre("1", "potted plant", "", ""));
  std::filesystem::remove(path);
  EXPECT_EQ(ReadTable(path, ',').status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(ReadTable(testing::TempDir(), ',').status().code(), absl::StatusCode::kPermissionDenied) << "a folder";
}

TEST(AssociateTimestampsTest, PairsOneToOneAndClosestFirst) {
  const std::vector<int64_t> a{0, 100, 200, 300};
  const std::vector<int64_t> b{95, 104, 190, 1000};
  EXPECT_THAT(AssociateTimestamps(a, b, 10), ElementsAre(Pair(1, 1), Pair(2, 2)));
  EXPECT_THAT(AssociateTimestamps(a, b, 9), ElementsAre(Pair(1, 1)));
  EXPECT_THAT(AssociateTimestamps(a, b, 100), ElementsAre(Pair(0, 0), Pair(1, 1), Pair(2, 2)));
  EXPECT_TRUE(AssociateTimestamps(a, {}, 10).empty());
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

}  // namespace
}  // namespace romap::files
