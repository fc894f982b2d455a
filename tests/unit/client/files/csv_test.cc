#include "client/files/csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/files/text_file.h"

namespace romap::files::csv_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class CsvTest : public testing::Test {
 protected:
  absl::StatusOr<std::vector<CsvRow>> Read(const std::string& text) {
    EXPECT_TRUE(WriteFile(path_, text).ok());
    return ReadCsv(path_);
  }
  std::vector<std::string> Row(const std::string& text) {
    const auto rows = Read(text);
    EXPECT_TRUE(rows.ok()) << rows.status();
    return rows.ok() && rows->size() == 1 ? rows->front().fields : std::vector<std::string>{};
  }
  void TearDown() override { std::filesystem::remove(path_); }

  const std::string path_ =
      testing::TempDir() + "romap_csv_" + testing::UnitTest::GetInstance()->current_test_info()->name() + ".csv";
};

TEST_F(CsvTest, SplitsFields) {
  EXPECT_THAT(Row("1, potted plant ,,\n"), ElementsAre("1", "potted plant", "", ""));
  EXPECT_THAT(Row("a;b,c #d,5\" disk"), ElementsAre("a;b", "c #d", "5\" disk"));
  EXPECT_THAT(Row("a\r\n"), ElementsAre("a"));
}

TEST_F(CsvTest, SemicolonsOrTabsSeparateFieldsIfTheFirstRowHasNoComma) {
  const auto rows = Read("# a, b\ntimestamp;label\n1.5; \"cup; red\" ;a,b\r\n");
  ASSERT_TRUE(rows.ok()) << rows.status();
  ASSERT_EQ(rows->size(), 2u);
  EXPECT_THAT((*rows)[0].fields, ElementsAre("timestamp", "label"));
  EXPECT_THAT((*rows)[1].fields, ElementsAre("1.5", "cup; red", "a,b"));
  EXPECT_THAT(Row("1\t potted plant\t\t\"x\"\n"), ElementsAre("1", "potted plant", "", "x"));
}

TEST_F(CsvTest, QuotedFieldsKeepEveryCharacter) {
  EXPECT_THAT(Row("1,\"cup, red\",\"the \"\"best\"\" one\"\r\n"), ElementsAre("1", "cup, red", "the \"best\" one"));
  EXPECT_THAT(Row("\" blank \" ,\"two\nlines\",\"\""), ElementsAre(" blank ", "two\nlines", ""));
  EXPECT_THAT(Row("\"#1\",b"), ElementsAre("#1", "b"));
}

TEST_F(CsvTest, SkipsCommentsEmptyLinesAndTheByteOrderMark) {
  const auto rows = Read("\xEF\xBB\xBF# a, \"b\r\n\r\n1,\"x\ny\"\n  \n#\n2\n");
  ASSERT_TRUE(rows.ok()) << rows.status();
  ASSERT_EQ(rows->size(), 2u);
  EXPECT_EQ((*rows)[0].line, 3);
  EXPECT_EQ((*rows)[1].line, 7);
  EXPECT_THAT((*rows)[1].fields, ElementsAre("2"));
}

TEST_F(CsvTest, NamesTheLineOfAMalformedQuote) {
  EXPECT_THAT(std::string(Read("1\n2,\"open\n3\n").status().message()),
              HasSubstr(path_ + ":2: the double quote that opens here has no end"));
  EXPECT_THAT(std::string(Read("1\n\"a\"b,2\n").status().message()),
              HasSubstr(path_ + ":2: text follows a closing double quote"));
}

}  // namespace romap::files::csv_test
