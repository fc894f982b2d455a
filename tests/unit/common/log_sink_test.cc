#include "common/log_sink.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdio>
#include <memory>
#include <string>

namespace romap::log_sink_test {

using ::testing::EndsWith;
using ::testing::HasSubstr;

class LogSinkTest : public ::testing::Test {
 protected:
  void SetUp() override {
    int ends[2] = {};
    ASSERT_EQ(pipe(ends), 0);
    read_end_ = ends[0];
    file_ = fdopen(ends[1], "w");
    setvbuf(file_, nullptr, _IONBF, 0);  // as stderr
    logger_ = std::make_unique<spdlog::logger>("test", MakeLogSink(file_));
  }
  ~LogSinkTest() override {
    if (read_end_ >= 0) close(read_end_);
    fclose(file_);
  }
  // What is in the pipe.
  std::string Read() {
    fcntl(read_end_, F_SETFL, O_NONBLOCK);
    std::string text, piece(65536, '\0');
    while (true) {
      const ssize_t count = read(read_end_, piece.data(), piece.size());
      if (count <= 0) return text;
      text.append(piece, 0, static_cast<size_t>(count));
    }
  }

  int read_end_ = -1;
  std::FILE* file_ = nullptr;
  std::unique_ptr<spdlog::logger> logger_;
};

TEST_F(LogSinkTest, EscapesControlCharacters) {
  logger_->info("name {}", "\x1b[2J\nfake");
  const std::string line = Read();
  EXPECT_THAT(line, EndsWith("] [test] [info] name \\x1b[2J\\nfake\n"));
}

TEST_F(LogSinkTest, APipeThatNobodyReadsDropsMessages) {
  for (int i = 0; i < 20000; ++i) logger_->info("message {}", i);  // returns
  const std::string first = Read();
  EXPECT_THAT(first, HasSubstr("message 0\n"));
  EXPECT_LE(first.size(), size_t{1} << 20);
  logger_->info("again");
  const std::string later = Read();
  EXPECT_THAT(later, HasSubstr("log messages were dropped, because nobody read them\n"));
  EXPECT_THAT(later, EndsWith("again\n"));
}

TEST_F(LogSinkTest, LongMessagesAreCut) {
  for (const char c : {'x', '\x1b', '\xc3'}) {
    logger_->info("{}", std::string(100'000, c));
    const std::string line = Read();
    EXPECT_LE(line.size(), 4096U);
    EXPECT_THAT(line, EndsWith(" ...\n"));
  }
}

TEST_F(LogSinkTest, AReaderThatIsGoneDoesNotEndTheProcess) {
  close(read_end_);
  read_end_ = -1;
  logger_->info("nobody");
}

}  // namespace romap::log_sink_test
