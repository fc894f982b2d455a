#include "client/cli/format_diagnostic.h"

#include <fmt/format.h>

#include "common/printable.h"

namespace romap::cli {

std::string SeverityName(Severity severity) {
  switch (severity) {
    case Severity::kInfo:
      return "info";
    case Severity::kWarning:
      return "warning";
    case Severity::kError:
      return "error";
  }
  return "warning";
}

std::string FormatDiagnostic(const Diagnostic& diagnostic) {
  std::string where;
  if (diagnostic.count > 1) where = fmt::format("{} times", diagnostic.count);
  if (diagnostic.first_frame_id > 0) {
    where += fmt::format("{}first in frame {}", where.empty() ? "" : ", ", diagnostic.first_frame_id);
  }
  return Printable(fmt::format("{}: {}{}: {}{}{}", SeverityName(diagnostic.severity), diagnostic.code,
                               where.empty() ? "" : fmt::format(" ({})", where), diagnostic.text,
                               diagnostic.advice.empty() ? "" : "; ", diagnostic.advice));
}

}  // namespace romap::cli
