#include "server/slam/point_positions.h"

#include <gmock/gmock.h>

namespace romap::slam::point_positions_test {

TEST(PointPositionsTest, AreThoseOfTheMapOrEvenlyChosen) {
  SlamMap map{SlamConfig()};
  EXPECT_THAT(PointPositions(map, 10), ::testing::IsEmpty());
  for (int k = 0; k < 10; ++k) map.AddPoint(Eigen::Vector3d(k, 0, 0));
  EXPECT_THAT(PointPositions(map, 10), ::testing::SizeIs(10));
  const std::vector<Eigen::Vector3f> chosen = PointPositions(map, 5);
  ASSERT_THAT(chosen, ::testing::SizeIs(5));
  EXPECT_EQ(chosen[1], Eigen::Vector3f(2, 0, 0));
  EXPECT_THAT(PointPositions(map, 9), ::testing::SizeIs(::testing::Le(9u)));
}

}  // namespace romap::slam::point_positions_test
