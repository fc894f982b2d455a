#include "server/session/diagnostic_log.h"

#include <gtest/gtest.h>

#include <optional>

namespace romap::session::diagnostic_log_test {

class DiagnosticLogTest : public ::testing::Test {
 protected:
  // The next event that clients get; nullopt if there is none.
  std::optional<Diagnostic> NextEvent() {
    const std::optional<MapEvent> event = outbox_->Next(std::chrono::milliseconds(0));
    return event ? std::optional(std::get<Diagnostic>(*event)) : std::nullopt;
  }

  MapState map_;
  std::shared_ptr<Outbox> outbox_ = map_.Subscribe(Outbox::Acks::kNewest, 100);
  DiagnosticLog log_{"session", &map_};
};

TEST_F(DiagnosticLogTest, CountsIncidentsAndSendsOneEvent) {
  log_.Report({.code = "frames_rejected", .first_frame_id = 3, .text = "first"});
  log_.Report({.code = "frames_rejected", .first_frame_id = 5, .text = "second"});
  const std::vector<Diagnostic> current = log_.Current();
  ASSERT_EQ(current.size(), 1u);
  EXPECT_EQ(current[0].count, 2u);
  EXPECT_EQ(current[0].first_frame_id, 3u);
  EXPECT_EQ(current[0].text, "second");
  EXPECT_EQ(NextEvent().value().text, "first");
  EXPECT_FALSE(NextEvent().has_value());
}

TEST_F(DiagnosticLogTest, SendsAnEventWhenTheSeverityRises) {
  log_.Report({.code = "frames_rejected", .severity = Severity::kWarning});
  log_.Report({.code = "frames_rejected", .severity = Severity::kError});
  EXPECT_EQ(NextEvent().value().severity, Severity::kWarning);
  EXPECT_EQ(NextEvent().value().severity, Severity::kError);
  EXPECT_FALSE(NextEvent().has_value());
}

TEST_F(DiagnosticLogTest, ConditionsLastUntilTheirStageWithdrawsThem) {
  log_.SetConditions("slam", {{.code = "up_unknown", .text = "no evidence"}});
  log_.SetConditions("objects", {{.code = "label_is_background"}});
  EXPECT_EQ(log_.Current().size(), 2u);
  log_.SetConditions("slam", {});
  ASSERT_EQ(log_.Current().size(), 1u);
  EXPECT_EQ(log_.Current()[0].code, "label_is_background");
}

TEST_F(DiagnosticLogTest, AnnouncesAConditionThatReturnsOnlyOnce) {
  for (int i = 0; i < 3; ++i) {
    log_.SetConditions("slam", {{.code = "up_unknown"}});
    log_.SetConditions("slam", {});
  }
  EXPECT_TRUE(NextEvent().has_value());
  EXPECT_FALSE(NextEvent().has_value());
}

}  // namespace romap::session::diagnostic_log_test
