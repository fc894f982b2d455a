// What a service refuses, and what a session costs that nobody uses.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/status.h"
#include "server/session/local_mapping_service.h"
#include "tests/support/sanitizer.h"
#include "tests/support/streams.h"

namespace romap::session::session_limits_test {

using ::testing::HasSubstr;

SessionOptions SquareImages(int side_px) {
  SessionOptions options;
  options.camera = {.width_px = side_px,
                    .height_px = side_px,
                    .fx_px = 0.8 * side_px,
                    .fy_px = 0.8 * side_px,
                    .cx_px = 0.5 * side_px,
                    .cy_px = 0.5 * side_px,
                    .distortion = {0.01, 0, 0, 0, 0}};
  return options;
}

TEST(SessionLimitsTest, LargerImagesThanTheServerTakesAreRefused) {
  LocalMappingService service({});
  EXPECT_EQ(
      Message(service.CreateSession(SquareImages(8192)).status()),
      "camera: images must have at most 40 megapixels (session.max_image_mpx), 8192x8192 px are 67.1; send smaller "
      "images, with intrinsics that fit them");
  EXPECT_TRUE(service.CreateSession(SquareImages(1000)).ok());
  ServerConfig config;
  config.session.max_image_mpx = 0.99;
  LocalMappingService small(config);
  EXPECT_THAT(Message(small.CreateSession(SquareImages(1000)).status()), HasSubstr("at most 0.99 megapixels"));
}

TEST(SessionLimitsTest, ASessionWithoutImagesHasNoUndistortionMaps) {
  if (testing_support::kUnderSanitizer) GTEST_SKIP() << "a sanitizer keeps freed memory";
  LocalMappingService service({});
  const auto first = service.CreateSession(SquareImages(1000));
  ASSERT_TRUE(first.ok()) << first.status();
  const auto large = service.CreateSession(SquareImages(6300));
  ASSERT_TRUE(large.ok()) << large.status();
  // The maps need 6 bytes per pixel: 238 MB.
  EXPECT_LT(large->statistics.resident_bytes, first->statistics.resident_bytes + (size_t{60} << 20));
}

TEST(SessionLimitsTest, LiveSessionsAboveTheLoadAreRefused) {
  ServerConfig config;
  config.session.live_load = 1e-6;  // of all cores
  LocalMappingService service(config);
  SessionOptions options;
  options.camera = testing_support::SmallCamera();
  options.mode = FrameMode::kLive;
  ASSERT_TRUE(service.CreateSession(options).ok());
  const absl::Status refused = service.CreateSession(options).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(Message(refused), HasSubstr("the processor cannot take another live session: 1 of them"));
  options.mode = FrameMode::kReplay;
  EXPECT_TRUE(service.CreateSession(options).ok());
}

TEST(SessionLimitsTest, FinishedLiveSessionsNeedNoLoad) {
  ServerConfig config;
  config.session.live_load = 1e-6;
  LocalMappingService service(config);
  SessionOptions options;
  options.camera = testing_support::SmallCamera();
  options.mode = FrameMode::kLive;
  const auto first = service.CreateSession(options);
  ASSERT_TRUE(first.ok()) << first.status();
  ASSERT_TRUE(service.FinishSession(first->id).ok());
  EXPECT_TRUE(service.CreateSession(options).ok());
}

TEST(SessionLimitsTest, AnEmptySessionThatNobodyUsesIsDeleted) {
  ServerConfig config;
  config.session.abandon_after_s = 0.3;
  LocalMappingService service(config);
  SessionOptions options;
  options.camera = testing_support::SmallCamera();
  const std::string abandoned = service.CreateSession(options)->id;
  const std::string mapped = service.CreateSession(options)->id;
  {
    const auto stream = service.OpenMap(mapped).value();
    ASSERT_TRUE(stream->Send(testing_support::MakeFrame(1)).ok());
    const auto ack = testing_support::NextOf<FrameAck>(*stream);
    ASSERT_TRUE(ack && ack->accepted);
  }
  const std::string open = service.CreateSession(options)->id;
  auto stream = service.OpenMap(open).value();
  const auto exists = [&](const std::string& id) { return service.GetSession(id).ok(); };
  EXPECT_TRUE(testing_support::Eventually([&] { return !exists(abandoned); }));
  EXPECT_TRUE(exists(mapped));
  EXPECT_TRUE(exists(open));
  stream = nullptr;
  EXPECT_TRUE(testing_support::Eventually([&] { return !exists(open); }));
  EXPECT_TRUE(exists(mapped));
}

}  // namespace romap::session::session_limits_test
