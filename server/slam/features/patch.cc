#include "server/slam/features/patch.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace romap::slam {
namespace {

constexpr int kMaxLevels = 4;
constexpr int kMaxIterations = 10;
constexpr double kConverged = 0.01;  // patch grid units
constexpr double kMaxShift = 1.5;    // patch grid units
constexpr double kMinContrast = 2;   // standard deviation, gray levels
// Weight of the start position. The gray values of an edge do not determine the position along it; there the start
// position decides. Equals the variance of the normalized gray values (about 0.25) over that of the start position
// (half a grid unit).
constexpr double kStartWeight = 1;
constexpr int kCount = (2 * Patch::kRadius + 1) * (2 * Patch::kRadius + 1);

using Values = std::array<float, kCount>;

struct Moments {
  double mean = 0;
  double deviation = 0;
};

Moments MomentsOf(const Values& values) {
  double sum = 0, sum2 = 0;
  for (const float value : values) {
    sum += value;
    sum2 += static_cast<double>(value) * value;
  }
  const double mean = sum / kCount;
  return {mean, std::sqrt(std::max(0.0, sum2 / kCount - mean * mean))};
}

// The part of the patch that is compared, normalized to mean 0 and deviation 1, with its gradients.
struct Template {
  Values values{};
  Values gradient_x{}, gradient_y{};  // per patch grid unit
  Eigen::Matrix2d hessian = Eigen::Matrix2d::Zero();
  double deviation = 0;  // before the normalization

  explicit Template(const Patch& patch) {
    size_t i = 0;
    for (int y = -Patch::kRadius; y <= Patch::kRadius; ++y) {
      for (int x = -Patch::kRadius; x <= Patch::kRadius; ++x, ++i) {
        values[i] = patch.At(x, y);
        gradient_x[i] = 0.5F * (patch.At(x + 1, y) - patch.At(x - 1, y));
        gradient_y[i] = 0.5F * (patch.At(x, y + 1) - patch.At(x, y - 1));
      }
    }
    const Moments moments = MomentsOf(values);
    deviation = moments.deviation;
    if (deviation < kMinContrast) return;
    const auto factor = static_cast<float>(1 / deviation);
    for (size_t k = 0; k < values.size(); ++k) {
      values[k] = (values[k] - static_cast<float>(moments.mean)) * factor;
      gradient_x[k] *= factor;
      gradient_y[k] *= factor;
      const Eigen::Vector2d g(gradient_x[k], gradient_y[k]);
      hessian += g * g.transpose();
    }
  }
};

// Reads the image around a pixel on the warped grid, normalized like the template. Returns false outside the image or
// without contrast.
bool ReadWarped(const HalvedImages& image, size_t level, const Eigen::Matrix2d& image_from_patch,
                const Eigen::Vector2d& center_px, Values& values) {
  size_t i = 0;
  for (int y = -Patch::kRadius; y <= Patch::kRadius; ++y) {
    for (int x = -Patch::kRadius; x <= Patch::kRadius; ++x, ++i) {
      const auto gray = image.At(level, center_px + image_from_patch * Eigen::Vector2d(x, y));
      if (!gray) return false;
      values[i] = *gray;
    }
  }
  const Moments moments = MomentsOf(values);
  if (moments.deviation < kMinContrast) return false;
  const auto factor = static_cast<float>(1 / moments.deviation);
  for (float& value : values) value = (value - static_cast<float>(moments.mean)) * factor;
  return true;
}

}  // namespace

HalvedImages::HalvedImages(const cv::Mat& image) {
  cv::Mat gray = image;
  if (image.channels() == 3) cv::cvtColor(image, gray, cv::COLOR_BGR2GRAY);
  levels_.push_back(gray);
  while (levels_.size() < kMaxLevels && std::min(levels_.back().cols, levels_.back().rows) >= 2 * Patch::kSide) {
    cv::Mat half;
    // Averages 2 x 2 pixels: pixel x of the half is centered at 2 x + 0.5.
    cv::resize(levels_.back(), half, {levels_.back().cols / 2, levels_.back().rows / 2}, 0, 0, cv::INTER_AREA);
    levels_.push_back(half);
  }
}

size_t HalvedImages::LevelFor(double pixel_size_px) const {
  const int level = static_cast<int>(std::floor(std::log2(std::max(pixel_size_px, 1.0)) + 0.25));
  return static_cast<size_t>(std::clamp(level, 0, static_cast<int>(levels_.size()) - 1));
}

std::optional<float> HalvedImages::At(size_t level, const Eigen::Vector2d& pixel_px) const {
  const cv::Mat& image = levels_[level];
  const double size = static_cast<double>(1U << level);
  const double x = (pixel_px.x() + 0.5) / size - 0.5;
  const double y = (pixel_px.y() + 0.5) / size - 0.5;
  if (!(x >= 0 && y >= 0 && x < image.cols - 1 && y < image.rows - 1)) return std::nullopt;
  const int column = static_cast<int>(x);
  const int row = static_cast<int>(y);
  const auto u = static_cast<float>(x - column);
  const auto v = static_cast<float>(y - row);
  const uint8_t* top = image.ptr<uint8_t>(row) + column;
  const uint8_t* bottom = image.ptr<uint8_t>(row + 1) + column;
  return (1 - v) * ((1 - u) * top[0] + u * top[1]) + v * ((1 - u) * bottom[0] + u * bottom[1]);
}

std::optional<Patch> Patch::Read(const HalvedImages& image, const Eigen::Vector2d& center_px, double octave_scale) {
  Patch patch;
  const size_t level = image.LevelFor(octave_scale);
  size_t i = 0;
  for (int y = -kRadius - 1; y <= kRadius + 1; ++y) {
    for (int x = -kRadius - 1; x <= kRadius + 1; ++x, ++i) {
      const auto gray = image.At(level, center_px + octave_scale * Eigen::Vector2d(x, y));
      if (!gray) return std::nullopt;
      patch.gray[i] = *gray;
    }
  }
  return patch;
}

std::optional<PatchAlignment> AlignPatch(const Patch& patch, const HalvedImages& image,
                                         const Eigen::Matrix2d& image_from_patch, const Eigen::Vector2d& start_px) {
  const Template reference(patch);
  if (reference.deviation < kMinContrast) return std::nullopt;
  const Eigen::Matrix2d inverse_hessian = (reference.hessian + kStartWeight * Eigen::Matrix2d::Identity()).inverse();
  const size_t level = image.LevelFor(std::sqrt(std::abs(image_from_patch.determinant())));
  PatchAlignment alignment{.pixel_px = start_px};
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();  // patch grid units
  Values values;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    if (!ReadWarped(image, level, image_from_patch, start_px + image_from_patch * shift, values)) return std::nullopt;
    Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
    for (size_t i = 0; i < values.size(); ++i) {
      const double error = values[i] - reference.values[i];
      gradient += error * Eigen::Vector2d(reference.gradient_x[i], reference.gradient_y[i]);
    }
    const Eigen::Vector2d step = -(inverse_hessian * (gradient + kStartWeight * shift));
    shift += step;
    if (shift.norm() > kMaxShift) return std::nullopt;
    if (step.norm() < kConverged) break;
  }
  if (!ReadWarped(image, level, image_from_patch, start_px + image_from_patch * shift, values)) return std::nullopt;
  double squared_error = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    const double error = values[i] - reference.values[i];
    squared_error += error * error;
  }
  alignment.pixel_px = start_px + image_from_patch * shift;
  alignment.correlation = 1 - 0.5 * squared_error / kCount;  // of two normalized signals
  return alignment;
}

}  // namespace romap::slam
