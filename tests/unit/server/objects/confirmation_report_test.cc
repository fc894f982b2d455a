#include "server/objects/confirmation_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace romap::objects::confirmation_report_test {

using ::testing::HasSubstr;

TEST(ConfirmationReportTest, ASessionWithoutMasksNeedsNoReason) {
  EXPECT_FALSE(ConfirmationReport().Check(ObjectsConfig{}).has_value());
}

TEST(ConfirmationReportTest, AConfirmedObjectNeedsNoReason) {
  ConfirmationReport report;
  report.CountMaskedFrame(/*has_pose=*/true);
  report.AddUnconfirmed("too few keyframes");
  report.AddConfirmed();
  EXPECT_FALSE(report.Check(ObjectsConfig{}).has_value());
}

TEST(ConfirmationReportTest, StatesTheReasonsOfAllCandidates) {
  ConfirmationReport report;
  for (int i = 0; i < 6; ++i) report.CountMaskedFrame(/*has_pose=*/true);
  report.AddUnconfirmed("too few keyframes");
  report.AddUnconfirmed("too little parallax");
  report.AddUnconfirmed("too few keyframes");
  const auto diagnostic = report.Check(ObjectsConfig{});
  ASSERT_TRUE(diagnostic.has_value());
  EXPECT_EQ(diagnostic->code, "no_object_confirmed");
  EXPECT_EQ(diagnostic->severity, Severity::kWarning);
  EXPECT_THAT(diagnostic->text, HasSubstr("6 frames with masks"));
  EXPECT_THAT(diagnostic->text, HasSubstr("too few keyframes (2), too little parallax (1)"));
}

TEST(ConfirmationReportTest, StatesThatNoMaskedFrameHasAPose) {
  ConfirmationReport report;
  report.CountMaskedFrame(/*has_pose=*/false);
  const auto diagnostic = report.Check(ObjectsConfig{});
  ASSERT_TRUE(diagnostic.has_value());
  EXPECT_THAT(diagnostic->text, HasSubstr("none of them has a camera pose"));
}

}  // namespace romap::objects::confirmation_report_test
