#include "server/slam/tracking_status.h"

#include <gtest/gtest.h>

namespace romap::slam::tracking_status_test {

TEST(TrackingStatus, ReportsRelocalizationOnceAfterALoss) {
  TrackingStatus status;
  status.OnMapInitialized();
  EXPECT_EQ(status.OnTracked(), TrackingState::kTracking);
  status.OnLost(7, 700);
  EXPECT_TRUE(status.IsLost());
  EXPECT_EQ(status.OnTracked(), TrackingState::kRelocalized);
  EXPECT_EQ(status.OnTracked(), TrackingState::kTracking);
}

TEST(TrackingStatus, KeepsTheFirstFrameOfALoss) {
  TrackingStatus status;
  status.OnMapInitialized();
  status.OnLost(7, 700);
  status.OnLost(8, 800);
  EXPECT_EQ(status.lost_since_frame(), 7u);
  EXPECT_EQ(status.lost_since_ns(), 700);
  status.OnTracked();
  status.OnLost(12, 1200);
  EXPECT_EQ(status.lost_since_frame(), 12u);
  EXPECT_EQ(status.lost_since_ns(), 1200);
}

TEST(TrackingStatus, RequiresConfirmationForSomeFramesAfterALoss) {
  TrackingStatus status;
  status.OnMapInitialized();
  status.OnLost(1, 100);
  EXPECT_TRUE(status.NeedsConfirmation());
  int frames = 0;
  while (status.NeedsConfirmation() && frames < 100) {
    status.OnTracked();
    ++frames;
  }
  EXPECT_GT(frames, 5);
  EXPECT_LT(frames, 30);
}

TEST(TrackingStatus, MapResetStartsInitialization) {
  TrackingStatus status;
  status.OnMapInitialized();
  status.OnMapReset();
  EXPECT_FALSE(status.IsTracking());
  EXPECT_FALSE(status.IsLost());
}

}  // namespace romap::slam::tracking_status_test
