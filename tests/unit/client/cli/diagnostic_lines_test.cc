#include "client/cli/diagnostic_lines.h"

#include <gmock/gmock.h>

namespace romap::cli::diagnostic_lines_test {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

Diagnostic Warning(const std::string& code, const std::string& text, const std::string& advice = "") {
  return {.code = code, .severity = Severity::kWarning, .text = text, .advice = advice};
}

class DiagnosticLinesTest : public ::testing::Test {
 protected:
  std::vector<std::string> printed_;
  DiagnosticLines lines_{[this](const std::string& line) { printed_.push_back(line); }};
};

Diagnostic OfFrame(uint64_t frame_id, Diagnostic diagnostic) {
  diagnostic.first_frame_id = frame_id;
  return diagnostic;
}

TEST_F(DiagnosticLinesTest, PrintsWarningsAboutTheMapIfTheyLast) {
  const DiagnosticLines::Clock::time_point start;
  const Diagnostic up = Warning("up_unknown", "no evidence"), lens = Warning("readout_time", "contradicted");
  lines_.SayNews(up, start);
  lines_.SayPresent({up}, start + std::chrono::seconds(2));
  lines_.SayPresent({lens}, start + std::chrono::seconds(4));
  lines_.SayPresent({lens, up}, start + std::chrono::seconds(6));
  EXPECT_THAT(printed_, IsEmpty());
  lines_.SayPresent({lens, up}, start + std::chrono::seconds(9));
  EXPECT_THAT(printed_, ElementsAre("warning: readout_time: contradicted"));
}

TEST_F(DiagnosticLinesTest, PrintsACodeOfTheServerOnceAndAgainWhenItGetsWorse) {
  lines_.SayNews(OfFrame(7, Warning("frames_rejected", "1 frame was rejected")));
  lines_.SayNews(OfFrame(7, Warning("frames_rejected", "2 frames were rejected")));
  Diagnostic worse = Warning("frames_rejected", "30 frames were rejected");
  worse.severity = Severity::kError;
  lines_.SayNews(worse);
  lines_.SayNews(OfFrame(7, Warning("frames_rejected", "31 frames were rejected")));
  EXPECT_THAT(printed_, ElementsAre("warning: frames_rejected (first in frame 7): 1 frame was rejected",
                                    "error: frames_rejected: 30 frames were rejected"));
  EXPECT_EQ(lines_.Said().size(), 2u);
}

TEST_F(DiagnosticLinesTest, PrintsAllOfTheClient) {
  lines_.Say(Warning("file_unreadable", "an image"));
  lines_.Say(Warning("file_unreadable", "a mask"));
  EXPECT_THAT(printed_, ElementsAre("warning: file_unreadable: an image", "warning: file_unreadable: a mask"));
}

TEST(FormatFinalDiagnosticsTest, NothingToSay) { EXPECT_THAT(FormatFinalDiagnostics({}, {}), IsEmpty()); }

TEST(FormatFinalDiagnosticsTest, CountsWhatWasPrinted) {
  Diagnostic first = Warning("mask_is_background", "a label fills the image"), last = first;
  last.count = 60;
  const Diagnostic info = {.code = "scores_percent", .severity = Severity::kInfo, .text = "percent"};
  EXPECT_EQ(FormatFinalDiagnostics({info, last}, {info, first}),
            "diagnostics: 1 warning: mask_is_background (60 times); 1 info: scores_percent\n");
}

TEST(FormatFinalDiagnosticsTest, PrintsInFullWhatIsNewOrHasOtherAdvice) {
  const Diagnostic before = Warning("poses_contradict_images", "they do not fit", "check them");
  const Diagnostic now = Warning("poses_contradict_images", "they fit as OpenGL", "run with an option");
  EXPECT_EQ(FormatFinalDiagnostics({now, Warning("up_unknown", "no evidence")}, {before}),
            "warning: poses_contradict_images: they fit as OpenGL; run with an option\n"
            "warning: up_unknown: no evidence\n"
            "diagnostics: 2 warnings: poses_contradict_images, up_unknown\n");
}

TEST(FormatFinalDiagnosticsTest, SaysWhatIsNoLongerTheCase) {
  const Diagnostic before = Warning("up_unknown", "no evidence");
  EXPECT_EQ(FormatFinalDiagnostics({}, {before, before}), "diagnostics: no longer the case: up_unknown\n");
}

}  // namespace romap::cli::diagnostic_lines_test
