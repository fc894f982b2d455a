#pragma once

#include <string>

#include "common/diagnostic.h"

namespace romap::cli {

// "info", "warning" or "error".
std::string SeverityName(Severity severity);

// One line: "warning: frames_rejected (3 times, first in frame 17): <text>; <advice>".
std::string FormatDiagnostic(const Diagnostic& diagnostic);

}  // namespace romap::cli
