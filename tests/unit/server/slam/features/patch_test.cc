#include "server/slam/features/patch.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace romap::slam::patch_test {

using Image = double (*)(double x, double y);

// Gray values 128 + contrast * function, for pixel centers displaced by (dx, dy).
cv::Mat Draw(Image function, double dx, double dy, double contrast = 40) {
  cv::Mat image(120, 160, CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      image.at<uint8_t>(y, x) = cv::saturate_cast<uint8_t>(128 + contrast * function(x - dx, y - dy));
    }
  }
  return image;
}

double Blobs(double x, double y) { return std::sin(0.55 * x + 0.2 * y) * std::cos(0.5 * y) + 0.3 * std::sin(0.9 * y); }
double VerticalEdge(double x, double /*y*/) { return std::tanh(0.6 * (x - 80)); }

constexpr double kX_px = 80, kY_px = 60;

std::optional<PatchAlignment> Align(const cv::Mat& reference, const cv::Mat& image, const Eigen::Vector2d& start_px) {
  const auto patch = Patch::Read(HalvedImages(reference), {kX_px, kY_px}, 1);
  return patch ? AlignPatch(*patch, HalvedImages(image), Eigen::Matrix2d::Identity(), start_px) : std::nullopt;
}

TEST(PatchTest, FindsTheDisplacementToAFractionOfAPixel) {
  for (const Eigen::Vector2d& shift_px :
       {Eigen::Vector2d(0.37, -0.62), Eigen::Vector2d(-0.8, 0.25), Eigen::Vector2d(0, 0)}) {
    const auto aligned = Align(Draw(Blobs, 0, 0), Draw(Blobs, shift_px.x(), shift_px.y()), {kX_px, kY_px});
    ASSERT_TRUE(aligned);
    EXPECT_LT((aligned->pixel_px - Eigen::Vector2d(kX_px, kY_px) - shift_px).norm(), 0.08) << shift_px.transpose();
    EXPECT_GT(aligned->correlation, 0.95);
  }
}

TEST(PatchTest, IgnoresGainAndOffset) {
  cv::Mat darker = Draw(Blobs, 0.5, 0.3, /*contrast=*/15);
  darker -= 60;
  const auto aligned = Align(Draw(Blobs, 0, 0), darker, {kX_px, kY_px});
  ASSERT_TRUE(aligned);
  EXPECT_LT((aligned->pixel_px - Eigen::Vector2d(kX_px + 0.5, kY_px + 0.3)).norm(), 0.1);
}

TEST(PatchTest, FollowsAChangeOfScale) {
  const auto larger = [](double x, double y) { return Blobs(kX_px + (x - kX_px) / 1.5, kY_px + (y - kY_px) / 1.5); };
  const auto patch = Patch::Read(HalvedImages(Draw(Blobs, 0, 0)), {kX_px, kY_px}, 1);
  ASSERT_TRUE(patch);
  const auto aligned =
      AlignPatch(*patch, HalvedImages(Draw(larger, 0.4, 0.4)), 1.5 * Eigen::Matrix2d::Identity(), {kX_px, kY_px});
  ASSERT_TRUE(aligned);
  EXPECT_LT((aligned->pixel_px - Eigen::Vector2d(kX_px + 0.4, kY_px + 0.4)).norm(), 0.12);
}

TEST(PatchTest, DoesNotSlideAlongAnEdge) {
  cv::Mat image = Draw(VerticalEdge, 0.5, 0);
  cv::RNG random(1);
  cv::Mat noise(image.size(), CV_8UC1);
  random.fill(noise, cv::RNG::UNIFORM, 0, 4);
  image += noise;
  const auto aligned = Align(Draw(VerticalEdge, 0, 0), image, {kX_px, kY_px});
  ASSERT_TRUE(aligned);
  EXPECT_NEAR(aligned->pixel_px.x(), kX_px + 0.5, 0.15);
  EXPECT_NEAR(aligned->pixel_px.y(), kY_px, 0.5);
}

TEST(PatchTest, OtherTextureDoesNotCorrelate) {
  const auto other = [](double x, double y) { return std::cos(0.7 * x - 0.3 * y) * std::sin(0.35 * y + 0.4 * x); };
  const auto aligned = Align(Draw(Blobs, 0, 0), Draw(other, 0, 0), {kX_px, kY_px});
  EXPECT_TRUE(!aligned || aligned->correlation < 0.7) << aligned->correlation;
}

TEST(PatchTest, RejectsImagesWithoutTextureAndPatchesBeyondTheBorder) {
  const cv::Mat plain(120, 160, CV_8UC1, cv::Scalar(90));
  EXPECT_FALSE(Align(plain, plain, {kX_px, kY_px}));
  EXPECT_FALSE(Align(Draw(Blobs, 0, 0), plain, {kX_px, kY_px}));
  EXPECT_FALSE(Patch::Read(HalvedImages(Draw(Blobs, 0, 0)), {3, 60}, 1));
  EXPECT_FALSE(Align(Draw(Blobs, 0, 0), Draw(Blobs, 0, 0), {158, 60}));
}

}  // namespace romap::slam::patch_test
