#include "client/files/file_list.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "client/files/text_file.h"
#include "tests/support/subprocess.h"

namespace romap::files::file_list_test {

using ::testing::AllOf;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

class FileListTest : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(dir_ + "/my rgb");
    for (int k = 0; k < 6; ++k) EXPECT_TRUE(WriteFile(dir_ + "/my rgb/" + std::to_string(k) + ".png", "").ok());
    EXPECT_TRUE(WriteFile(dir_ + "/my rgb/a #1#2.png", "").ok());
  }

  absl::StatusOr<FileList> Read(const std::string& text) {
    EXPECT_TRUE(WriteFile(dir_ + "/rgb.txt", text).ok());
    return ReadFileList(dir_, "rgb.txt");
  }
  std::string ErrorOf(const std::string& text) { return std::string(Read(text).status().message()); }

  const testing_support::TemporaryFolder folder_;
  const std::string dir_ = folder_.path();
};

TEST_F(FileListTest, NamesMayHaveBlanksAndQuotes) {
  const auto list = Read(
      "\xEF\xBB\xBF# head\r\n0.0 my rgb/0.png\r\n0.1\t\"my rgb/1.png\" # tail\r\n"
      "0.2   my rgb/2.png  # tail\n0.3 \"my rgb/a #1#2.png\"");
  ASSERT_TRUE(list.ok()) << list.status();
  ASSERT_EQ(list->files.size(), 4u);
  EXPECT_EQ(list->files[0].path, dir_ + "/my rgb/0.png");
  EXPECT_EQ(list->files[1].path, dir_ + "/my rgb/1.png");
  EXPECT_EQ(list->files[2].path, dir_ + "/my rgb/2.png");
  EXPECT_EQ(list->files[3].path, dir_ + "/my rgb/a #1#2.png");
  EXPECT_EQ(list->files[3].timestamp_ns, 300'000'000);
  EXPECT_EQ(list->unit, TimeUnit::kSeconds);
}

TEST_F(FileListTest, ConvertsTheUnit) {
  const auto list = Read("1700000000000000001 my rgb/0.png\n1700000000033333334 my rgb/1.png\n");
  ASSERT_TRUE(list.ok()) << list.status();
  EXPECT_EQ(list->unit, TimeUnit::kNanoseconds);
  EXPECT_EQ(list->files[1].timestamp_ns, 1700000000033333334);
}

TEST_F(FileListTest, NamesTheLineOfMalformedInput) {
  EXPECT_THAT(ErrorOf("0.0 my rgb/0.png\n0.1 \"my rgb/1.png\n"), HasSubstr("rgb.txt:2: expected 'timestamp filename'"));
  EXPECT_THAT(ErrorOf("0.0 \"my rgb/0.png\" x\n"), HasSubstr("rgb.txt:1: expected 'timestamp filename'"));
  EXPECT_THAT(ErrorOf("0.0 # my rgb/0.png\n"), HasSubstr("rgb.txt:1: expected 'timestamp filename'"));
  EXPECT_THAT(ErrorOf("0.0 my rgb/0.png\n20000000000.5 my rgb/1.png\n"), HasSubstr("rgb.txt:2: timestamp"));
}

TEST_F(FileListTest, OneInFiveFilesMayBeMissing) {
  fs::remove(dir_ + "/my rgb/1.png");
  const std::string five = "0 my rgb/0.png\n1 my rgb/1.png\n2 my rgb/2.png\n3 my rgb/3.png\n4 my rgb/4.png\n";
  EXPECT_TRUE(Read(five).ok());
  fs::remove(dir_ + "/my rgb/3.png");
  EXPECT_EQ(Read(five).status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(ErrorOf(five), AllOf(HasSubstr("rgb.txt:2: " + dir_ + "/my rgb/1.png does not exist"),
                                   HasSubstr("2 of 5 listed files are missing")));
}

}  // namespace romap::files::file_list_test
