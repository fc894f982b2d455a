#pragma once

#include <string>

namespace romap {

// The session that the current thread works for, while this object exists: log messages of the thread name it (see
// MakeLogSink()). May be nested.
class LogContext {
 public:
  explicit LogContext(const std::string& session);
  ~LogContext();
  LogContext(const LogContext&) = delete;
  LogContext& operator=(const LogContext&) = delete;

  // Empty: none.
  static const std::string& Session();

 private:
  std::string outer_;
};

}  // namespace romap
