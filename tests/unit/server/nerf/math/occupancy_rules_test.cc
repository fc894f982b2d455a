#include "server/nerf/math/occupancy_rules.h"

#include <gtest/gtest.h>

#include <limits>

namespace romap::nerf::occupancy_rules_test {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

TEST(OccupancyRulesTest, AVisitRaisesOrDecaysTheScore) {
  EXPECT_FLOAT_EQ(ScoreAfterVisit(1.0f, 0.0f, 0.9f), 0.9f);
  EXPECT_FLOAT_EQ(ScoreAfterVisit(0.2f, 0.5f, 0.9f), 0.5f);
  EXPECT_FLOAT_EQ(ScoreAfterVisit(1.0f, kNan, 0.9f), 0.9f) << "NaN counts as no weight";
}

TEST(OccupancyRulesTest, SeveralVisitsEqualSingleOnes) {
  EXPECT_FLOAT_EQ(ScoreAfterVisits(1.0f, 0.0f, 2, 0.9f), 0.81f);
  EXPECT_FLOAT_EQ(ScoreAfterVisits(1.0f, 0.95f, 1, 0.9f), 0.95f);
  EXPECT_FLOAT_EQ(ScoreAfterVisits(0.2f, 0.5f, 3, 0.9f), 0.5f);
  EXPECT_FLOAT_EQ(ScoreAfterVisits(0.7f, 0.1f, 0, 0.9f), 0.7f);
  EXPECT_FLOAT_EQ(ScoreAfterVisits(1.0f, kNan, 1, 0.9f), 0.9f);
}

TEST(OccupancyRulesTest, UpdatesAreDueEveryIntervalFromTheStart) {
  const OccupancyPlan plan{.start = 40, .interval = 20};
  EXPECT_FALSE(OccupancyUpdateIsDue(plan, 20));
  EXPECT_TRUE(OccupancyUpdateIsDue(plan, 40));
  EXPECT_FALSE(OccupancyUpdateIsDue(plan, 59));
  EXPECT_TRUE(OccupancyUpdateIsDue(plan, 60));
}

TEST(OccupancyRulesTest, NeighborsStayWithinTheRow) {
  EXPECT_EQ(WithNeighborsInRow(0b10000), 0b111000u);
  EXPECT_EQ(WithNeighborsInRow(1), 0b11u);
  EXPECT_EQ(WithNeighborsInRow(uint64_t{1} << 63), uint64_t{3} << 62);
}

}  // namespace romap::nerf::occupancy_rules_test
