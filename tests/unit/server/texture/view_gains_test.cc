#include "server/texture/view_gains.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "tests/unit/server/texture/rendered_views.h"
#include "tests/unit/server/texture/texture_scenes.h"

namespace romap::texture::view_gains_test {

struct Scene {
  TexturedMesh textured = *UnwrapMesh(SphereMesh(16), {.texels_per_mu = 40});
  std::vector<TrainingCamera> views = PhotographAll(PosesAround(12, 5, 0), SolidSphere(), Checker());

  std::vector<ViewGain> Estimate() const {
    std::vector<PreparedView> prepared;
    for (const TrainingCamera& view : views) prepared.emplace_back(view, textured.mesh);
    return EstimateViewGains(prepared, FindSurfaceTexels(textured));
  }
};

TEST(ViewGainsTest, CompensateTheExposure) {
  Scene scene;
  std::vector<Eigen::Array3f> exposure;
  for (size_t i = 0; i < scene.views.size(); ++i) {
    const auto x = static_cast<float>(i);
    exposure.emplace_back(0.8f + 0.15f * std::sin(7 * x), 0.8f + 0.15f * std::sin(5 * x),
                          0.8f + 0.15f * std::cos(3 * x));
    cv::multiply(scene.views[i].color_bgr, cv::Scalar(exposure[i][0], exposure[i][1], exposure[i][2]),
                 scene.views[i].color_bgr);
  }
  // A highlight and an object in front, each in one view.
  cv::circle(scene.views[3].color_bgr, {100, 100}, 25, cv::Scalar(255, 255, 255), cv::FILLED);
  cv::rectangle(scene.views[7].color_bgr, {60, 60, 40, 90}, cv::Scalar(30, 160, 30), cv::FILLED);
  const std::vector<ViewGain> gains = scene.Estimate();
  Eigen::Array3f mean = Eigen::Array3f::Zero();
  for (size_t i = 0; i < gains.size(); ++i) mean += (gains[i].gain_bgr * exposure[i]).log() / gains.size();
  for (size_t i = 0; i < gains.size(); ++i) {
    const Eigen::Array3f error = (gains[i].gain_bgr * exposure[i]).log() - mean;
    EXPECT_LT(error.abs().maxCoeff(), i == 3 || i == 7 ? 0.05f : 0.03f) << i << ": " << error.transpose();
  }
}

TEST(ViewGainsTest, EqualViewsHaveGainOne) {
  for (const ViewGain& gain : Scene().Estimate()) {
    EXPECT_LT((gain.gain_bgr - 1).abs().maxCoeff(), 0.03f);
    EXPECT_NEAR(gain.sharpness, 1, 0.35);
  }
}

TEST(ViewGainsTest, BlurredViewsAreNotSharp) {
  Scene scene;
  for (size_t i = 0; i < scene.views.size(); i += 3) {
    cv::GaussianBlur(scene.views[i].color_bgr, scene.views[i].color_bgr, {0, 0}, 2);
  }
  const std::vector<ViewGain> gains = scene.Estimate();
  for (size_t i = 0; i < gains.size(); ++i) {
    if (i % 3 == 0) {
      EXPECT_LT(gains[i].sharpness, 0.6f) << i;
    } else {
      EXPECT_GT(gains[i].sharpness, 1.0f) << i;
    }
  }
}

TEST(ViewGainsTest, ViewsWithoutACommonSurfaceHaveGainOne) {
  Scene scene;
  scene.views = {Photograph(LookAtOrigin({5, 0, 0.1}), SolidSphere(), Checker()),
                 Photograph(LookAtOrigin({-5, 0, 0.1}), SolidSphere(), Checker())};
  scene.views[0].color_bgr *= 0.5;
  for (const ViewGain& gain : scene.Estimate()) {
    EXPECT_TRUE(gain.gain_bgr.isApproxToConstant(1)) << gain.gain_bgr.transpose();
    EXPECT_EQ(gain.sharpness, 1);
  }
  EXPECT_TRUE(EstimateViewGains({}, FindSurfaceTexels(scene.textured)).empty());
}

}  // namespace romap::texture::view_gains_test
