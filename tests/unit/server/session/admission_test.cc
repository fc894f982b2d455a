#include "server/session/admission.h"

#include <gmock/gmock.h>

namespace romap::session::admission_test {

using ::testing::HasSubstr;

constexpr double kVga_mpx = 0.3072;

TEST(AdmissionTest, TheFirstSessionIsAlwaysTaken) { EXPECT_TRUE(AdmitLiveSession({}, 40, 0.1).ok()); }

TEST(AdmissionTest, SessionsThatAreNotMeasuredCountAsUsual) {
  std::vector<LiveSession> sessions;
  while (AdmitLiveSession(sessions, kVga_mpx, 3.4).ok()) sessions.push_back({.image_mpx = kVga_mpx});
  EXPECT_EQ(sessions.size(), 3u);
}

TEST(AdmissionTest, MeasuredLoadDecides) {
  EXPECT_TRUE(AdmitLiveSession(std::vector<LiveSession>(8, {kVga_mpx, 0.1}), kVga_mpx, 1.7).ok());
  const absl::Status refused = AdmitLiveSession(std::vector<LiveSession>(2, {kVga_mpx, 0.7}), kVga_mpx, 1.7);
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(refused.message()), HasSubstr("2 of them need 1.4 of the 1.7 cores"));
  EXPECT_THAT(std::string(refused.message()), HasSubstr("another one would need 0.7; try again in 10 s"));
  EXPECT_TRUE(AdmitLiveSession(std::vector<LiveSession>(2, {kVga_mpx, 0.5}), kVga_mpx, 1.7).ok());
}

TEST(AdmissionTest, IdleSessionsNeedNothing) {
  const LiveSession idle{kVga_mpx, 0.0};
  EXPECT_TRUE(AdmitLiveSession(std::vector<LiveSession>(12, idle), kVga_mpx, 1.7).ok());
}

TEST(AdmissionTest, LargerImagesNeedMore) {
  const std::vector<LiveSession> sessions(1, {kVga_mpx, 0.4});
  EXPECT_TRUE(AdmitLiveSession(sessions, kVga_mpx, 1.0).ok());
  EXPECT_FALSE(AdmitLiveSession(sessions, 9 * kVga_mpx, 1.0).ok());
}

}  // namespace romap::session::admission_test
