#include "common/log_sink.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "common/log_context.h"

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

TEST_F(LogSinkTest, MessagesNameTheSessionOfTheThread) {
  {
    const LogContext outer("a1");
    logger_->info("tracking lost");
    const LogContext inner("b2");
    logger_->info("session c3: deleted");
  }
  logger_->info("ready");
  const std::string lines = Read();
  EXPECT_THAT(lines, HasSubstr("] session a1: tracking lost\n"));
  EXPECT_THAT(lines, HasSubstr("] session c3: deleted\n"));
  EXPECT_THAT(lines, EndsWith("] ready\n"));
}

TEST_F(LogSinkTest, JsonHasAnObjectPerLine) {
  logger_ = std::make_unique<spdlog::logger>("test", MakeLogSink(file_, LogFormat::kJson));
  const LogContext context("a1");
  logger_->warn("tracking \"lost\"\n\xff\x1b[2J");
  logger_->info("session c3: deleted");
  logger_->info(std::string(9000, '\x01'));
  std::istringstream lines(Read());
  std::vector<nlohmann::json> messages;
  for (std::string line; std::getline(lines, line);) {
    EXPECT_LT(line.size(), 4096u);
    messages.push_back(nlohmann::json::parse(line));
  }
  ASSERT_EQ(messages.size(), 3u);
  EXPECT_EQ(messages[0]["message"], "tracking \"lost\"\n\ufffd\x1b[2J");
  EXPECT_EQ(messages[0]["level"], "warning");
  EXPECT_EQ(messages[0]["session"], "a1");
  EXPECT_THAT(messages[0]["time"].get<std::string>(), ::testing::MatchesRegex("....-..-..T..:..:..\\....Z"));
  EXPECT_EQ(messages[1]["session"], "c3");
  EXPECT_EQ(messages[1]["message"], "deleted");
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
