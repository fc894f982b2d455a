#include "server/texture/texture_view.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>

#include "tests/unit/server/texture/rendered_views.h"

namespace romap::texture::texture_view_test {

TrainingCamera Valid() {
  return {LookAtOrigin({5, 0, 0}), TestCamera(), cv::Rect(10, 20, 30, 40), cv::Mat(40, 30, CV_8UC1),
          cv::Mat(40, 30, CV_8UC3)};
}

std::string MessageAfter(const std::function<void(TrainingCamera&)>& damage) {
  TrainingCamera view = Valid();
  damage(view);
  const absl::Status status = ValidateTextureView(view);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  return std::string(status.message());
}

TEST(TextureViewTest, FaultsAreExplained) {
  EXPECT_TRUE(ValidateTextureView(Valid()).ok());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(MessageAfter([&](TrainingCamera& view) {
              view.T_camera_object = {Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, nan, 0)};
            }),
            "the pose is not finite");
  EXPECT_EQ(
      MessageAfter([](TrainingCamera& view) { view.camera.fx_px = 0; }),
      "the camera has focal lengths 0 x 400 px and principal point (320, 240), must be finite, with focal lengths "
      "above 0");
  EXPECT_EQ(MessageAfter([](TrainingCamera& view) { view.camera.distortion[0] = 0.1; }),
            "the camera has distortion, must be a pinhole");
  EXPECT_EQ(MessageAfter([](TrainingCamera& view) { view.roi_px = {}; }), "the crop is 0 x 0 px, must not be empty");
  EXPECT_EQ(MessageAfter([](TrainingCamera& view) { view.color_bgr = cv::Mat(40, 31, CV_8UC3); }),
            "color_bgr has type 16 and 31 x 40 px, must be CV_8UC3 (16) with the 30 x 40 px of the crop");
  EXPECT_EQ(MessageAfter([](TrainingCamera& view) { view.ray_kind = cv::Mat(40, 30, CV_8UC3); }),
            "ray_kind has type 16 and 30 x 40 px, must be CV_8UC1 (0) with the 30 x 40 px of the crop");
}

}  // namespace romap::texture::texture_view_test
