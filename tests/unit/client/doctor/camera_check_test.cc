#include "client/doctor/camera_check.h"

#include <gmock/gmock.h>

namespace romap::doctor::camera_check_test {

using ::testing::HasSubstr;

CameraModel PlausibleCamera() {
  return {.width_px = 640, .height_px = 480, .fx_px = 525, .fy_px = 525, .cx_px = 319.5, .cy_px = 239.5};
}

std::string TextFor(const CameraModel& camera) {
  const std::vector<Diagnostic> found = CheckCamera(camera);
  return found.empty() ? "" : found[0].text;
}

TEST(CameraCheckTest, AcceptsPlausibleCameras) {
  EXPECT_EQ(TextFor(PlausibleCamera()), "");
  CameraModel fisheye = PlausibleCamera();
  fisheye.lens = LensModel::kFisheye;
  fisheye.fx_px = fisheye.fy_px = 100;
  EXPECT_EQ(TextFor(fisheye), "");
}

TEST(CameraCheckTest, NamesIntrinsicsOfAnotherResolution) {
  CameraModel camera = PlausibleCamera();
  camera.cx_px = 639.5;
  camera.cy_px = 479.5;
  EXPECT_THAT(TextFor(camera), HasSubstr("principal point (639.5, 479.5) px"));
}

TEST(CameraCheckTest, NamesAnImplausibleFieldOfView) {
  CameraModel camera = PlausibleCamera();
  camera.fx_px = camera.fy_px = 5250;
  EXPECT_THAT(TextFor(camera), HasSubstr("field of view is 7 deg"));
}

TEST(CameraCheckTest, NamesDifferentFocalLengths) {
  CameraModel camera = PlausibleCamera();
  camera.fy_px = 300;
  EXPECT_THAT(TextFor(camera), HasSubstr("fx is 525.0 px and fy is 300.0 px"));
}

TEST(CameraCheckTest, NamesExcessiveDistortion) {
  CameraModel camera = PlausibleCamera();
  camera.distortion[1] = 9;
  EXPECT_THAT(TextFor(camera), HasSubstr("distortion"));
}

}  // namespace romap::doctor::camera_check_test
