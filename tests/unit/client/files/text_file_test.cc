#include "client/files/text_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace romap::files::text_file_test {

using ::testing::ElementsAre;

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

TEST(ParseScaledTest, IsExact) {
  EXPECT_EQ(ParseScaled("1403636579763555584", 0), 1403636579763555584);
  EXPECT_EQ(ParseScaled("1.403636579763555584e+18", 0), 1403636579763555584);
  EXPECT_EQ(ParseScaled("1700000000123456", 3), 1700000000123456000);
  EXPECT_EQ(ParseScaled("1700000000123.4564", 6), 1700000000123456400);
  EXPECT_EQ(ParseScaled("-2.5", 0), -3);
  EXPECT_EQ(ParseScaled("0.4", 0), 0);
  EXPECT_EQ(ParseScaled("5e-2", 0), 0);
  EXPECT_EQ(ParseScaled("9500000000000000000", 0), std::nullopt);
}

TEST(ReadTableTest, SplitsAtBlanks) {
  const std::string path = TempPath("table");
  std::ofstream(path) << "# head\n\n 1 \t two  3 # tail\r\na b";
  const auto words = ReadTable(path);
  ASSERT_TRUE(words.ok());
  EXPECT_EQ((*words)[0].number, 3);
  EXPECT_THAT((*words)[0].fields, ElementsAre("1", "two", "3"));
  EXPECT_THAT((*words)[1].fields, ElementsAre("a", "b"));
  std::filesystem::remove(path);
  EXPECT_EQ(ReadTable(path).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(ReadTable(testing::TempDir()).status().code(), absl::StatusCode::kPermissionDenied) << "a folder";
}

TEST(ReadLinesTest, IgnoresByteOrderMarkAndCarriageReturns) {
  const std::string path = TempPath("lines");
  std::ofstream(path) << "\xEF\xBB\xBF# head\r\n\r\n 1 my file.png # tail \r\n2";
  const auto lines = ReadLines(path);
  ASSERT_TRUE(lines.ok());
  ASSERT_EQ(lines->size(), 2u);
  EXPECT_EQ((*lines)[0].number, 3);
  EXPECT_EQ((*lines)[0].text, "1 my file.png # tail");
  EXPECT_EQ((*lines)[1].text, "2");
  std::filesystem::remove(path);
}

}  // namespace romap::files::text_file_test
