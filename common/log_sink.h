#pragma once

#include <spdlog/common.h>

#include <cstdio>

namespace romap {

enum class LogFormat {
  kText,  // [date] [logger] [level] message
  kJson,  // an object per line: time (UTC), level, logger, message, and session if the message is about one
};

// Writes log messages to `file`, usually stderr, one line each: control characters are escaped (Printable()), and long
// messages are cut off. Messages of threads with a LogContext name its session. A pipe that nobody reads must not stop
// the threads that log: while it is full, messages are dropped, and their number is logged later. Nothing is lost when
// the process exits, as it could be with an asynchronous logger, and the exit never waits for the reader.
spdlog::sink_ptr MakeLogSink(std::FILE* file, LogFormat format = LogFormat::kText);

}  // namespace romap
