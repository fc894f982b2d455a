#include "client/files/pose_placeholders.h"

#include <gtest/gtest.h>

namespace romap::files::pose_placeholders_test {

// A camera that moves along x, one unit per row, from `start`.
std::vector<StampedPose> Line(int rows, double start) {
  std::vector<StampedPose> poses;
  for (int k = 0; k < rows; ++k) {
    poses.push_back({.timestamp_ns = k, .T_world_camera = {Eigen::Quaterniond::Identity(), {start + k, 0, 0}}});
  }
  return poses;
}

void Lose(std::vector<StampedPose>* poses, size_t first, size_t end) {
  for (size_t k = first; k < end; ++k) (*poses)[k].T_world_camera = {};
}

TEST(PosePlaceholdersTest, RemovesRowsOfALostCamera) {
  std::vector<StampedPose> poses = Line(40, 100);
  Lose(&poses, 0, 3);
  Lose(&poses, 10, 15);
  Lose(&poses, 39, 40);
  EXPECT_EQ(RemovePlaceholders(&poses), 9u);
  ASSERT_EQ(poses.size(), 31u);
  EXPECT_EQ(poses.front().timestamp_ns, 3);
  EXPECT_EQ(poses[7].timestamp_ns, 15);
}

TEST(PosePlaceholdersTest, KeepsACameraThatStartsOrPassesTheOrigin) {
  std::vector<StampedPose> poses = Line(40, -3);
  Lose(&poses, 0, 5);
  EXPECT_EQ(RemovePlaceholders(&poses), 0u);
  poses = Line(40, -20);
  EXPECT_EQ(RemovePlaceholders(&poses), 0u);
  EXPECT_EQ(poses.size(), 40u);
}

TEST(PosePlaceholdersTest, KeepsPosesThatAreAllTheSame) {
  std::vector<StampedPose> poses = Line(5, 0);
  Lose(&poses, 0, 5);
  EXPECT_EQ(RemovePlaceholders(&poses), 0u);
  EXPECT_EQ(poses.size(), 5u);
}

}  // namespace romap::files::pose_placeholders_test
