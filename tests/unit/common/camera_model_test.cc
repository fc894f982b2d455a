#include "common/camera_model.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>

#include "common/status.h"

namespace romap::camera_model_test {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

CameraModel Valid() {
  return {.width_px = 640,
          .height_px = 480,
          .fx_px = 500,
          .fy_px = 500,
          .cx_px = 319.5,
          .cy_px = 239.5,
          .distortion = {-30, 400, 0.001, -0.001, -5000}};  // of a narrow lens
}

std::string ErrorWith(const std::function<void(CameraModel&)>& change) {
  CameraModel camera = Valid();
  change(camera);
  const absl::Status status = ValidateCameraModel(camera);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  return Message(status);
}

TEST(CameraModelTest, AcceptsUsualLenses) {
  EXPECT_TRUE(ValidateCameraModel(Valid()).ok());
  CameraModel telescope = Valid();
  telescope.fx_px = telescope.fy_px = 100 * 640;
  EXPECT_TRUE(ValidateCameraModel(telescope).ok());
  CameraModel fisheye = Valid();
  fisheye.lens = LensModel::kFisheye;
  fisheye.fx_px = fisheye.fy_px = 0.1 * 640;
  fisheye.distortion = {};
  EXPECT_TRUE(ValidateCameraModel(fisheye).ok());
}

TEST(CameraModelTest, NamesFieldRangeAndValue) {
  EXPECT_EQ(ErrorWith([](CameraModel& camera) { camera.fx_px = 1e-300; }),
            "camera: focal lengths must be in 6.4..6.4e+05 px for images of 640x480 px, are fx=1e-300 fy=500 px");
  EXPECT_EQ(ErrorWith([](CameraModel& camera) { camera.fy_px = kNan; }),
            "camera: focal lengths must be in 6.4..6.4e+05 px for images of 640x480 px, are fx=500 fy=nan px");
  EXPECT_EQ(ErrorWith([](CameraModel& camera) { camera.distortion[1] = 1e300; }),
            "camera: distortion (k1 k2 p1 p2 k3) must be in -1e+06..1e+06, has 1e+300");
  EXPECT_EQ(ErrorWith([](CameraModel& camera) { camera.distortion[4] = kNan; }),
            "camera: distortion (k1 k2 p1 p2 k3) must be in -1e+06..1e+06, has nan");
  EXPECT_EQ(
      ErrorWith([](CameraModel& camera) { camera.cx_px = 2000; }),
      "camera: principal point must be at most one image size outside the 640x480 px image, is cx=2000 cy=239.5 px");
}

}  // namespace romap::camera_model_test
