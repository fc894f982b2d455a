#include "client/bench/convergence_plot.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

namespace romap::bench::convergence_plot_test {

// Mean position of the pixels with the color of a line, in the left (accuracy) or right (completion) panel, without the
// legend.
cv::Point2d MeanPosition(const cv::Mat& picture, const cv::Scalar& color, bool right) {
  const int half = picture.cols / 2;
  const cv::Mat panel = picture(cv::Rect(right ? half : 0, 0, half, 500));
  cv::Mat same;
  cv::inRange(panel, color, color, same);
  std::vector<cv::Point> pixels;
  cv::findNonZero(same, pixels);
  EXPECT_FALSE(pixels.empty());
  cv::Point2d sum;
  for (const cv::Point& p : pixels) sum += cv::Point2d(p);
  return sum * (1.0 / static_cast<double>(std::max<size_t>(1, pixels.size())));
}

const cv::Scalar kFirst(178, 114, 0), kSecond(0, 94, 213);

TEST(ConvergencePlotTest, SmallErrorsAreLowAndLateTimesAreRight) {
  PaperResults results;
  results.curves = {{"good", 0.1, 0.3, 0.5}, {"good", 0.2, 0.2, 0.4}, {"late", 2, 0.9, 0.1}, {"late", 8, 0.8, 0.05}};
  const cv::Mat picture = DrawConvergence(results);
  ASSERT_EQ(picture.type(), CV_8UC3);
  const cv::Point2d good = MeanPosition(picture, kFirst, false), late = MeanPosition(picture, kSecond, false);
  EXPECT_GT(good.y, late.y + 50);
  EXPECT_LT(good.x, late.x - 50);
  EXPECT_LT(MeanPosition(picture, kFirst, true).y, MeanPosition(picture, kSecond, true).y - 50);
}

TEST(ConvergencePlotTest, AxesAreLogarithmic) {
  const auto x_of = [](double train_s) {
    PaperResults results;
    results.curves = {{"low", 0.01, 0.3, 0.3}, {"at", train_s, 0.3, 0.3}, {"high", 100, 0.3, 0.3}};
    return MeanPosition(DrawConvergence(results), kSecond, false).x;
  };
  EXPECT_NEAR(x_of(1) - x_of(0.1), x_of(10) - x_of(1), 2);
}

TEST(ConvergencePlotTest, AcceptsZeroTimesAndNoCurves) {
  EXPECT_FALSE(DrawConvergence(PaperResults()).empty());
  PaperResults results;
  results.curves = {{"fast", 0, 0, 0}};
  EXPECT_FALSE(DrawConvergence(results).empty());
}

}  // namespace romap::bench::convergence_plot_test
