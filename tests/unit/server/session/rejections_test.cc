#include "server/session/rejections.h"

#include <gtest/gtest.h>

#include "common/status.h"

namespace romap::session::rejections_test {

TEST(RejectionsTest, NothingIsSaidAboutAcceptedFrames) {
  Rejections rejections;
  rejections.CountAcceptedFrame();
  EXPECT_TRUE(rejections.Diagnostics().empty());
}

TEST(RejectionsTest, AFewRejectedFramesAreAWarning) {
  Rejections rejections;
  for (int i = 0; i < 8; ++i) rejections.CountAcceptedFrame();
  rejections.AddFrame(5, InvalidArgument("image: too small"));
  rejections.AddFrame(7, InvalidArgument("image: missing"));
  const auto diagnostics = rejections.Diagnostics();
  ASSERT_EQ(diagnostics.size(), 1u);
  EXPECT_EQ(diagnostics[0].code, "frames_rejected");
  EXPECT_EQ(diagnostics[0].severity, Severity::kWarning);
  EXPECT_EQ(diagnostics[0].count, 2u);
  EXPECT_EQ(diagnostics[0].first_frame_id, 5u);
  EXPECT_EQ(diagnostics[0].text, "2 of 10 frames were rejected; the first, frame 5: image: too small");
}

TEST(RejectionsTest, MoreThanAFifthOfTheFramesIsAnErrorUntilMoreAreAccepted) {
  Rejections rejections;
  for (int i = 0; i < 3; ++i) rejections.CountAcceptedFrame();
  rejections.AddFrame(4, InvalidArgument("image: missing"));
  EXPECT_EQ(rejections.Diagnostics()[0].severity, Severity::kError);
  rejections.CountAcceptedFrame();
  EXPECT_EQ(rejections.Diagnostics()[0].severity, Severity::kWarning);
}

TEST(RejectionsTest, LateMasksCountApart) {
  Rejections rejections;
  rejections.AddMasks(3, InvalidArgument("masks: too late"));
  const auto diagnostics = rejections.Diagnostics();
  ASSERT_EQ(diagnostics.size(), 1u);
  EXPECT_EQ(diagnostics[0].code, "masks_rejected");
  EXPECT_EQ(diagnostics[0].severity, Severity::kWarning);
}

}  // namespace romap::session::rejections_test
