#include "common/log_context.h"

#include <utility>

namespace romap {
namespace {

std::string& CurrentSession() {
  thread_local std::string session;
  return session;
}

}  // namespace

LogContext::LogContext(const std::string& session) : outer_(std::exchange(CurrentSession(), session)) {}
LogContext::~LogContext() { CurrentSession() = std::move(outer_); }

const std::string& LogContext::Session() { return CurrentSession(); }

}  // namespace romap
