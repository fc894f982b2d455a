#include "client/synth/options.h"

#include <gtest/gtest.h>

#include <limits>

namespace romap::synth::options_test {

TEST(ParseFrameRangeTest, ParsesTwoNumbers) {
  const auto range = ParseFrameRange("100:130");
  ASSERT_TRUE(range.ok()) << range.status();
  EXPECT_EQ(*range, (FrameRange{100, 130}));
  EXPECT_TRUE(range->Contains(100));
  EXPECT_TRUE(range->Contains(130));
  EXPECT_FALSE(range->Contains(131));
}

TEST(ParseFrameRangeTest, RejectsMalformedRanges) {
  for (const char* text : {"", "100", "100:", ":5", "1:2:3", "a:b", "1-2", "1:2 ", "99999999999:1"}) {
    const auto range = ParseFrameRange(text);
    EXPECT_EQ(range.status().code(), absl::StatusCode::kInvalidArgument) << text;
    EXPECT_NE(Message(range.status()).find("FIRST:LAST"), std::string::npos) << text;
  }
}

TEST(ParseTableTextureTest, ParsesAllKinds) {
  EXPECT_EQ(ParseTableTexture("distinct").value(), TableTexture{});
  EXPECT_EQ(ParseTableTexture("plain").value().kind, TableTexture::Kind::kPlain);
  EXPECT_EQ(ParseTableTexture("faint").value().kind, TableTexture::Kind::kFaint);
  EXPECT_EQ(ParseTableTexture("repeat:3").value(), (TableTexture{TableTexture::Kind::kRepeated, 3}));
}

TEST(ParseTableTextureTest, RejectsMalformedTexts) {
  for (const char* text : {"", "repeat", "repeat:", "repeat:x", "repeat:2x", "wood"}) {
    const auto table = ParseTableTexture(text);
    EXPECT_EQ(table.status().code(), absl::StatusCode::kInvalidArgument) << text;
    EXPECT_NE(Message(table.status()).find("repeat:N"), std::string::npos) << text;
  }
}

TEST(ParseCameraJumpTest, ParsesFrameAndAngle) {
  const auto jump = ParseCameraJump("150:-90.5");
  ASSERT_TRUE(jump.ok()) << jump.status();
  EXPECT_EQ(jump->frame, 150);
  EXPECT_EQ(jump->turn_deg, -90.5);
}

TEST(ParseCameraJumpTest, RejectsMalformedTexts) {
  for (const char* text : {"", "150", "150:", "x:90", "0:90", "150:90deg"}) {
    const auto jump = ParseCameraJump(text);
    EXPECT_EQ(jump.status().code(), absl::StatusCode::kInvalidArgument) << text;
    EXPECT_NE(Message(jump.status()).find("FRAME:DEGREES"), std::string::npos) << text;
  }
}

TEST(ParseImageCropTest, ParsesFourNumbers) {
  EXPECT_EQ(ParseImageCrop("160:120:320:240").value(), (ImageCrop{160, 120, 320, 240}));
  for (const char* text : {"", "1:2:3", "1:2:3:4:5", "-1:0:64:64", "1.5:0:64:64", "1:2:3:x"}) {
    const auto crop = ParseImageCrop(text);
    EXPECT_EQ(crop.status().code(), absl::StatusCode::kInvalidArgument) << text;
    EXPECT_NE(Message(crop.status()).find("X:Y:WIDTH:HEIGHT"), std::string::npos) << text;
  }
}

TEST(ParseGainRangeTest, ParsesTwoFactors) {
  EXPECT_EQ(ParseGainRange("0.3:1.6").value(), (GainRange{0.3, 1.6}));
  for (const char* text : {"", "0.3", "0.3:", "0.3-1.6", "a:b"}) {
    const auto range = ParseGainRange(text);
    EXPECT_EQ(range.status().code(), absl::StatusCode::kInvalidArgument) << text;
    EXPECT_NE(Message(range.status()).find("LOW:HIGH"), std::string::npos) << text;
  }
}

TEST(ValidateSynthOptionsTest, NamesOptionsOutOfRange) {
  SynthOptions options;
  options.arc_deg = -1;
  options.rotation.first_frames = options.frames + 1;
  options.rotation.speed_deg = 0;
  options.shake_mm = std::numeric_limits<double>::quiet_NaN();
  options.jump.frame = options.frames + 1;
  options.surroundings.table.repeats = 0;
  options.fx_px = 5;
  options.crop = {.x_px = 600, .y_px = 0, .width_px = 100, .height_px = 100};
  options.readout = 1.5;
  options.exposure = -0.1;
  options.jpeg_quality = 0;
  options.gripper_share = 1;
  options.occluder_share = -1;
  options.gain_steps = {1.6, 0.3};
  options.depth_noise_mm = -1;
  const absl::Status status = ValidateSynthOptions(options);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  for (const char* name :
       {"arc_deg is -1", "rotation.first_frames", "rotation.speed_deg", "shake_mm", "jump.frame",
        "surroundings.table.repeats is 0; expected 1..100", "fx_px is 5", "crop.width_px is 100; expected 32..40",
        "readout is 1.5", "exposure is -0.1", "jpeg_quality", "gripper_share", "occluder_share",
        "gain_steps.high is 0.3", "depth_noise_mm"}) {
    EXPECT_NE(Message(status).find(name), std::string::npos) << status;
  }
  EXPECT_TRUE(ValidateSynthOptions({}).ok());
}

}  // namespace romap::synth::options_test
