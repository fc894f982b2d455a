#include "client/files/whole_number.h"

#include <gtest/gtest.h>

#include <limits>

namespace romap::files::whole_number_test {

TEST(WholeNumberTest, TakesOnlyWholeNumbersThatADoubleCanHold) {
  EXPECT_EQ(WholeNumber(-3), -3);
  EXPECT_EQ(WholeNumber(9e15), 9'000'000'000'000'000);
  for (const double value :
       {0.5, 1e16, -1e300, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_EQ(WholeNumber(value), std::nullopt) << value;
  }
}

TEST(WholeNumberTest, ASideIsZeroIfNoImageCanHaveIt) {
  EXPECT_EQ(SideOf_px(640), 640);
  for (const double value : {-1.0, 640.5, 4294967936.0, 1e300}) EXPECT_EQ(SideOf_px(value), 0) << value;
}

}  // namespace romap::files::whole_number_test
