#include "tests/bench/object_score.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace romap::measure::object_score_test {

SE3<World, Object> Pose(const Eigen::Vector3d& center, double yaw_rad = 0) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ())), center};
}

// Two boxes of 20 x 10 x 10 cm, 30 cm apart.
files::ObjectsYaml TwoBooks() {
  files::ObjectsYaml truth;
  for (int i = 0; i < 2; ++i) {
    files::ObjectRecord record;
    record.name = i == 0 ? "left" : "right";
    record.class_name = "book";
    record.T_world_object = Pose({0.3 * i, 0, 0.05});
    record.half_extents = {0.1, 0.05, 0.05};
    truth.objects.push_back(record);
  }
  return truth;
}

ObjectUpdate Mapped(uint64_t id, const Eigen::Vector3d& center, double yaw_rad = 0) {
  ObjectUpdate object;
  object.id = ObjectId{id};
  object.state = ObjectState::kConfirmed;
  object.class_name = "book";
  object.cuboid = {.T_world_object = Pose(center, yaw_rad), .half_extents = {0.1, 0.05, 0.05}};
  return object;
}

TEST(ScoreMap, MeasuresTheErrorsOfMatchedObjects) {
  const std::vector<ObjectUpdate> objects = {Mapped(1, {0.33, 0, 0.09}), Mapped(2, {0, 0, 0.05}, std::numbers::pi)};
  const MapScore score = ScoreMap(TwoBooks(), objects, {});
  ASSERT_EQ(score.Found(), 2U);
  EXPECT_EQ(score.Extra(), 0U);
  EXPECT_EQ(score.mapped[0].matched, "right");
  EXPECT_EQ(score.mapped[1].matched, "left");
  EXPECT_NEAR(score.objects[1].errors.center_cm, 5, 1e-9);
  EXPECT_NEAR(score.objects[1].errors.in_plane_cm, 3, 1e-9);
  const double shared = 0.17 * 0.1 * 0.06;
  EXPECT_NEAR(score.objects[1].errors.iou, shared / (2 * 0.002 - shared), 1e-9);
  EXPECT_TRUE(score.objects[1].errors.right_class);
  EXPECT_NEAR(score.objects[0].errors.iou, 1, 1e-9) << "a rotation by 180 degrees does not change a box";
  EXPECT_NEAR(score.objects[0].errors.yaw_deg, 0, 1e-9);
}

TEST(ScoreMap, ADuplicateIsExtra) {
  const std::vector<ObjectUpdate> objects = {Mapped(1, {0.02, 0, 0.05}), Mapped(2, {0.01, 0, 0.05}),
                                             Mapped(3, {0.3, 0, 0.05})};
  const MapScore score = ScoreMap(TwoBooks(), objects, {});
  EXPECT_EQ(score.Found(), 2U);
  EXPECT_EQ(score.Extra(), 1U);
  EXPECT_EQ(score.mapped[0].matched, "") << "the duplicate is closer";
  EXPECT_EQ(score.mapped[0].overlaps, "left");
  EXPECT_EQ(score.mapped[1].matched, "left");
}

TEST(ScoreMap, DoesNotMatchDistantObjects) {
  const std::vector<ObjectUpdate> objects = {Mapped(1, {0, 0, 0.16}), Mapped(2, {0.47, 0, 0.05})};
  const MapScore score = ScoreMap(TwoBooks(), objects, {});
  EXPECT_EQ(score.Found(), 0U)
      << "one does not overlap, and the center of the other is farther away than half the diagonal";
  EXPECT_EQ(score.Extra(), 2U);
  EXPECT_EQ(score.mapped[1].overlaps, "");
}

TEST(ScoreMap, TransformsTheMapToTheTrueWorld) {
  // The map is half as large, rotated by 90 degrees and shifted.
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ()));
  const Sim3<World, World> S_true_map(2, turn, {1, 2, 3});
  const Eigen::Vector3d center_map = S_true_map.Inverse() * Eigen::Vector3d(0.3, 0, 0.05);
  ObjectUpdate object = Mapped(7, center_map, -std::numbers::pi / 2);
  object.cuboid.half_extents /= 2;
  const MapScore score = ScoreMap(TwoBooks(), std::vector<ObjectUpdate>{object}, S_true_map);
  ASSERT_EQ(score.Found(), 1U);
  EXPECT_NEAR(score.objects[1].errors.iou, 1, 1e-9);
  EXPECT_NEAR((score.mapped[0].center_m - Eigen::Vector3d(0.3, 0, 0.05)).norm(), 0, 1e-12);
}

TEST(ScoreMap, AnEmptyMapHasNoFoundObjects) {
  const MapScore score = ScoreMap(TwoBooks(), {}, {});
  EXPECT_EQ(score.Found(), 0U);
  EXPECT_EQ(score.Extra(), 0U);
  EXPECT_EQ(score.objects.size(), 2U);
}

}  // namespace romap::measure::object_score_test
