#include "client/synth/synth_camera.h"

#include <gtest/gtest.h>

namespace romap::synth::synth_camera_test {

TEST(SynthCameraTest, HasTheGivenFocalLengths) {
  const CameraModel camera = SynthCamera({.fx_px = 900, .fy_px = 800});
  EXPECT_EQ(camera.fx_px, 900);
  EXPECT_EQ(camera.fy_px, 800);
  EXPECT_EQ(SynthCamera({.fx_px = 900}).fy_px, 900);
  EXPECT_EQ(SynthCamera({}).fx_px, 576);
}

TEST(SynthCameraTest, CropKeepsTheRays) {
  const SynthOptions options{.crop = {.x_px = 100, .y_px = 50, .width_px = 320, .height_px = 200}};
  const CameraModel whole = UncroppedCamera(options);
  const CameraModel cropped = SynthCamera(options);
  EXPECT_EQ(whole.width_px, 640);
  EXPECT_EQ(cropped.width_px, 320);
  EXPECT_EQ(cropped.height_px, 200);
  EXPECT_LT((whole.Unproject(110, 70) - cropped.Unproject(10, 20)).norm(), 1e-12);
}

}  // namespace romap::synth::synth_camera_test
