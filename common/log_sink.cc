#include "common/log_sink.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <poll.h>
#include <spdlog/details/console_globals.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/ansicolor_sink.h>
#include <spdlog/sinks/base_sink.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>

#include "common/log_context.h"
#include "common/printable.h"

namespace romap {
namespace {

// A pipe that is not full takes at least 4096 bytes; the rest is for the date, the level and the name of the logger.
constexpr size_t kMaxMessage_bytes = 3900;

// A message and the session that it is about; empty: none.
struct SessionMessage {
  std::string session;
  std::string_view text;
};

// Messages about a session begin with "session ID: ". Others are about the one that the thread works for.
SessionMessage SplitMessage(std::string_view text) {
  constexpr std::string_view kPrefix = "session ";
  if (!text.starts_with(kPrefix)) return {LogContext::Session(), text};
  const size_t end = text.find(": ", kPrefix.size());
  const std::string_view id = text.substr(kPrefix.size(), end == std::string_view::npos ? end : end - kPrefix.size());
  if (end == std::string_view::npos || id.empty() || id.find(' ') != std::string_view::npos) {
    return {LogContext::Session(), text};
  }
  return {std::string(id), text.substr(end + 2)};
}

class PrintableMessage : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm& /*time*/,
              spdlog::memory_buf_t& destination) override {
    const SessionMessage split = SplitMessage({message.payload.data(), message.payload.size()});
    std::string text = split.session.empty() ? "" : Printable("session " + split.session + ": ");
    text += Printable(split.text.substr(0, kMaxMessage_bytes));
    if (text.size() > kMaxMessage_bytes || split.text.size() > kMaxMessage_bytes) {
      text.resize(std::min(text.size(), kMaxMessage_bytes));
      text = Printable(text) + " ...";  // a character may have been cut
    }
    destination.append(text.data(), text.data() + text.size());
  }
  std::unique_ptr<custom_flag_formatter> clone() const override { return std::make_unique<PrintableMessage>(); }
};

class JsonFormatter : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& destination) override {
    const SessionMessage split = SplitMessage({message.payload.data(), message.payload.size()});
    const auto milliseconds = std::chrono::duration_cast<std::chrono::milliseconds>(message.time.time_since_epoch());
    nlohmann::ordered_json json;
    json["time"] =
        fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z", fmt::gmtime(std::chrono::system_clock::to_time_t(message.time)),
                    milliseconds.count() % 1000);
    const auto level = spdlog::level::to_string_view(message.level);
    json["level"] = std::string_view(level.data(), level.size());
    json["logger"] = std::string_view(message.logger_name.data(), message.logger_name.size());
    if (!split.session.empty()) json["session"] = split.session;
    std::string line;
    // Escapes may make a message up to six times as long.
    for (size_t length = kMaxMessage_bytes; line.empty() || line.size() > kMaxMessage_bytes; length /= 2) {
      const bool is_cut = split.text.size() > length;
      json["message"] = std::string(split.text.substr(0, length)) + (is_cut ? " ..." : "");
      line = json.dump(-1, ' ', /*ensure_ascii=*/true, nlohmann::ordered_json::error_handler_t::replace);
    }
    line += '\n';
    destination.append(line.data(), line.data() + line.size());
  }
  std::unique_ptr<formatter> clone() const override { return std::make_unique<JsonFormatter>(); }
};

class LogSink : public spdlog::sinks::base_sink<std::mutex> {
 public:
  LogSink(std::FILE* file, LogFormat format)
      : file_(file),
        colors_(file, format == LogFormat::kText ? spdlog::color_mode::automatic : spdlog::color_mode::never) {
    if (format == LogFormat::kJson) {
      colors_.set_formatter(std::make_unique<JsonFormatter>());
      return;
    }
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

spdlog::sink_ptr MakeLogSink(std::FILE* file, LogFormat format) { return std::make_shared<LogSink>(file, format); }

}  // namespace romap
