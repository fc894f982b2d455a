#include "client/eval/map_alignment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/client/eval/eval_world.h"

namespace romap::eval::map_alignment_test {

using eval_world::Moved;
using eval_world::Orbit;
using eval_world::OtherWorld;
using ::testing::HasSubstr;

class MapAlignmentTest : public testing::Test {
 protected:
  MapAlignment Determine(const RunRecord& record, const std::vector<files::StampedPose>& estimated) {
    EXPECT_TRUE(files::WriteTum(folder_ / "run/trajectory.txt", estimated).ok());
    EXPECT_TRUE(files::WriteTum(folder_ / "set/groundtruth.txt", Orbit()).ok());
    return DetermineAlignment(record, folder_ / "run", folder_ / "set");
  }

  eval_world::TempFolder folder_;
};

TEST_F(MapAlignmentTest, TheRecordOfTheRunDecides) {
  EXPECT_EQ(Determine({.poses = "given"}, Moved(Orbit(), OtherWorld())).alignment, Alignment::kNone);
  const MapAlignment estimated = Determine({.poses = "none"}, Orbit());
  EXPECT_EQ(estimated.alignment, Alignment::kSim3);
  EXPECT_THAT(estimated.reason, HasSubstr("--poses none"));
  EXPECT_EQ(Determine({.poses = "prior"}, Orbit()).alignment, Alignment::kSim3);
}

TEST_F(MapAlignmentTest, WithoutARecordTheTrajectoriesDecide) {
  EXPECT_EQ(Determine({}, Orbit()).alignment, Alignment::kNone);
  EXPECT_EQ(Determine({}, eval_world::WithNoise(Orbit(), 0.002, 1)).alignment, Alignment::kNone);
  EXPECT_EQ(Determine({}, Moved(Orbit(), OtherWorld())).alignment, Alignment::kSim3);
  EXPECT_EQ(DetermineAlignment({}, folder_ / "none", folder_ / "set").alignment, Alignment::kSim3);
}

TEST(HaveSameWorldTest, OrientationsMustAgreeToo) {
  std::vector<files::StampedPose> rolled = Orbit();
  const Eigen::Quaterniond roll(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitZ()));
  for (files::StampedPose& pose : rolled) {
    pose.T_world_camera = {pose.T_world_camera.rotation() * roll, pose.T_world_camera.translation()};
  }
  EXPECT_TRUE(HaveSameWorld(Orbit(), Orbit(), 0.02));
  EXPECT_FALSE(HaveSameWorld(rolled, Orbit(), 0.02));
  EXPECT_FALSE(HaveSameWorld({}, Orbit(), 0.02));
}

}  // namespace romap::eval::map_alignment_test
