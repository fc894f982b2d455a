#include "client/cli/format_diagnostic.h"

#include <gtest/gtest.h>

namespace romap::cli::format_diagnostic_test {

TEST(FormatDiagnosticTest, StatesSeverityCodeCountAndAdvice) {
  EXPECT_EQ(FormatDiagnostic({.code = "frames_rejected",
                              .severity = Severity::kWarning,
                              .first_frame_id = 17,
                              .count = 3,
                              .text = "frame 20 was rejected",
                              .advice = "repair the file"}),
            "warning: frames_rejected (3 times, first in frame 17): frame 20 was rejected; repair the file");
}

TEST(FormatDiagnosticTest, OmitsWhatIsNotKnown) {
  EXPECT_EQ(FormatDiagnostic({.code = "up_unknown", .severity = Severity::kError, .text = "no evidence"}),
            "error: up_unknown: no evidence");
  EXPECT_EQ(FormatDiagnostic({.code = "x", .severity = Severity::kInfo, .first_frame_id = 2, .text = "y"}),
            "info: x (first in frame 2): y");
}

}  // namespace romap::cli::format_diagnostic_test
