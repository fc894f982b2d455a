#include "common/log_sink.h"

#include <fmt/format.h>
#include <poll.h>
#include <spdlog/details/console_globals.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/ansicolor_sink.h>
#include <spdlog/sinks/base_sink.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <string>

#include "common/printable.h"

namespace romap {
namespace {

// A pipe that is not full takes at least 4096 bytes; the rest is for the date, the level and the name of the logger.
constexpr size_t kMaxMessage_bytes = 3900;

class PrintableMessage : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm& /*time*/,
              spdlog::memory_buf_t& destination) override {
    const std::string_view payload(message.payload.data(), message.payload.size());
    std::string text = Printable(payload.substr(0, kMaxMessage_bytes));
    if (text.size() > kMaxMessage_bytes || payload.size() > kMaxMessage_bytes) {
      text.resize(std::min(text.size(), kMaxMessage_bytes));
      text = Printable(text) + " ...";  // a character may have been cut
    }
    destination.append(text.data(), text.data() + text.size());
  }
  std::unique_ptr<custom_flag_formatter> clone() const override { return std::make_unique<PrintableMessage>(); }
};

class LogSink : public spdlog::sinks::base_sink<std::mutex> {
 public:
  explicit LogSink(std::FILE* file) : file_(file), colors_(file, spdlog::color_mode::automatic) {
    auto formatter = std::make_unique<spdlog::pattern_formatter>();
    formatter->add_flag<PrintableMessage>('*').set_pattern("[%Y-%m-%d %H:%M:%S.%e] [%n] [%^%l%$] %*");
    colors_.set_formatter(std::move(formatter));
  }

 protected:
  void sink_it_(const spdlog::details::log_msg& message) override {
    if (dropped_ > 0 && CanWrite()) {
      const std::string text = fmt::format("{} log messages were dropped, because nobody read them", dropped_);
      dropped_ = 0;
      colors_.log({message.logger_name, spdlog::level::warn, text});
    }
    if (CanWrite()) {
      colors_.log(message);
    } else {
      ++dropped_;
    }
  }
  void flush_() override {}  // every message is flushed
  void set_pattern_(const std::string& /*pattern*/) override {}
  void set_formatter_(std::unique_ptr<spdlog::formatter> /*formatter*/) override {}

 private:
  bool CanWrite() const {
    pollfd descriptor{.fd = fileno(file_), .events = POLLOUT, .revents = 0};
    return poll(&descriptor, 1, 0) == 1 && (descriptor.revents & (POLLERR | POLLNVAL)) == 0;
  }

  std::FILE* const file_;
  spdlog::sinks::ansicolor_sink<spdlog::details::console_nullmutex> colors_;
  uint64_t dropped_ = 0;
};

}  // namespace

spdlog::sink_ptr MakeLogSink(std::FILE* file) { return std::make_shared<LogSink>(file); }

}  // namespace romap
