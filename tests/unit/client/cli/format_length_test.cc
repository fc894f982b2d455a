#include "client/cli/format_length.h"

#include <gtest/gtest.h>

namespace romap::cli::format_length_test {

TEST(FormatLengthTest, ShowsFourDigitsOfTheLargestLengthInAnyUnit) {
  const Eigen::Vector3d size_m(0.1234567, 0.0456789, 1.2345678);
  const auto text = [&](double unit) {
    const Eigen::Vector3d size = unit * size_m;
    return FormatVector(size, " x ", DecimalsFor(size.maxCoeff()));
  };
  EXPECT_EQ(text(1), "0.123 x 0.046 x 1.235");
  EXPECT_EQ(text(1e-3), "0.000123 x 0.000046 x 0.001235");
  EXPECT_EQ(text(1e3), "123 x 46 x 1235");
  EXPECT_EQ(text(1e6), "123457 x 45679 x 1234568");
}

TEST(FormatLengthTest, AcceptsLengthsWithoutDigits) {
  EXPECT_EQ(DecimalsFor(0), 3);
  EXPECT_EQ(DecimalsFor(std::numeric_limits<double>::quiet_NaN()), 3);
  EXPECT_EQ(DecimalsFor(std::numeric_limits<double>::infinity()), 3);
  EXPECT_EQ(DecimalsFor(1e-300), 15);
}

}  // namespace romap::cli::format_length_test
