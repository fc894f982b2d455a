#include "client/files/time_unit.h"

#include <gtest/gtest.h>

namespace romap::files::time_unit_test {

// Twenty timestamps: start, start + step, ...
std::vector<std::string> Times(int64_t start, int64_t step) {
  std::vector<std::string> times;
  for (int64_t k = 0; k < 20; ++k) times.push_back(std::to_string(start + k * step));
  return times;
}

TEST(TimeUnitTest, DecimalsAreSeconds) {
  const std::vector<std::string> epoch = {"1700000000.1", "1700000000.2"}, short_list = {"0.033", "0.066"};
  EXPECT_EQ(DetectTimeUnit(epoch), TimeUnit::kSeconds);
  EXPECT_EQ(DetectTimeUnit(short_list), TimeUnit::kSeconds);
  const std::vector<std::string> slow = {"0.0", "20.0", "40.0"};
  EXPECT_EQ(DetectTimeUnit(slow), TimeUnit::kSeconds);
}

TEST(TimeUnitTest, TimesSince1970) {
  EXPECT_EQ(DetectTimeUnit(Times(1403636579763555584, 50'000'000)), TimeUnit::kNanoseconds);
  EXPECT_EQ(DetectTimeUnit(Times(1700000000123456, 33'333)), TimeUnit::kMicroseconds);
  EXPECT_EQ(DetectTimeUnit(Times(1700000000123, 33)), TimeUnit::kMilliseconds);
  EXPECT_EQ(DetectTimeUnit(Times(1700000000, 1)), TimeUnit::kSeconds);
  const std::vector<std::string> one = {"1403636579763555584"}, decimals = {"1700000000123.25", "1700000000156.5"};
  EXPECT_EQ(DetectTimeUnit(one), TimeUnit::kNanoseconds);
  EXPECT_EQ(DetectTimeUnit(decimals), TimeUnit::kMilliseconds);
  const std::vector<std::string> exponents = {"1.403636579763555584e+18", "1.403636579813555456e+18"};
  EXPECT_EQ(DetectTimeUnit(exponents), TimeUnit::kNanoseconds);
}

TEST(TimeUnitTest, TimesSinceTheStartOfADevice) {
  EXPECT_EQ(DetectTimeUnit(Times(0, 33'333'333)), TimeUnit::kNanoseconds);
  EXPECT_EQ(DetectTimeUnit(Times(2'000'000'000'000, 33'333'333)), TimeUnit::kNanoseconds) << "as large as epoch ms";
  EXPECT_EQ(DetectTimeUnit(Times(2'000'000'000'000, 5'000'000)), TimeUnit::kNanoseconds) << "poses at 200 Hz";
  EXPECT_EQ(DetectTimeUnit(Times(1'700'000'000, 33'333)), TimeUnit::kMicroseconds) << "as large as epoch seconds";
  EXPECT_EQ(DetectTimeUnit(Times(5, 33)), TimeUnit::kMilliseconds);
  EXPECT_EQ(DetectTimeUnit(Times(0, 100)), TimeUnit::kMilliseconds) << "10 Hz rather than 10 kHz";
}

TEST(TimeUnitTest, AmbiguousTimesAreSeconds) {
  EXPECT_EQ(DetectTimeUnit(Times(0, 1)), TimeUnit::kSeconds);
  EXPECT_EQ(DetectTimeUnit(Times(0, 5)), TimeUnit::kSeconds) << "or milliseconds at 200 Hz";
  EXPECT_EQ(DetectTimeUnit(Times(0, 1000)), TimeUnit::kSeconds) << "milliseconds at 1 Hz or microseconds at 1 kHz";
  const std::vector<std::string> same = {"5", "5"}, text = {"a", "33"}, none;
  EXPECT_EQ(DetectTimeUnit(same), TimeUnit::kSeconds);
  EXPECT_EQ(DetectTimeUnit(text), TimeUnit::kSeconds);
  EXPECT_EQ(DetectTimeUnit(none), TimeUnit::kSeconds);
}

TEST(TimeUnitTest, ConversionIsExact) {
  EXPECT_EQ(ParseTimestamp("1403636579763555584", TimeUnit::kNanoseconds), 1403636579763555584);
  EXPECT_EQ(ParseTimestamp("1700000000123457", TimeUnit::kMicroseconds), 1700000000123457000);
  EXPECT_EQ(ParseTimestamp("1700000000123", TimeUnit::kMilliseconds), 1700000000123000000);
  EXPECT_EQ(ParseTimestamp("1.5", TimeUnit::kSeconds), 1500000000);
  EXPECT_EQ(ParseTimestamp("nan", TimeUnit::kNanoseconds), std::nullopt);
}

}  // namespace romap::files::time_unit_test
