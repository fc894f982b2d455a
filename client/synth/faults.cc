#include "client/synth/faults.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "client/synth/noise.h"

namespace romap::synth {
namespace {

constexpr float kJitterWavelength_px = 14;  // along the border, like the coarse masks of a network

cv::Mat DisplaceBorders(const cv::Mat& labels, double jitter_px, uint32_t seed) {
  cv::Mat displaced(labels.size(), CV_8UC1);
  const auto reach = static_cast<float>(jitter_px);
  for (int v = 0; v < labels.rows; ++v) {
    for (int u = 0; u < labels.cols; ++u) {
      const Eigen::Vector3f p(static_cast<float>(u), static_cast<float>(v), 0.5F);
      const float du = reach * FractalNoise(p, kJitterWavelength_px, 2, 0.5F, 0.5F, seed);
      const float dv = reach * FractalNoise(p, kJitterWavelength_px, 2, 0.5F, 0.5F, seed + 50);
      const int from_u = std::clamp(u + static_cast<int>(std::lround(du)), 0, labels.cols - 1);
      const int from_v = std::clamp(v + static_cast<int>(std::lround(dv)), 0, labels.rows - 1);
      displaced.at<uint8_t>(v, u) = labels.at<uint8_t>(from_v, from_u);
    }
  }
  return displaced;
}

// A normalized motion blur kernel: a line of `length_px` through the kernel center.
cv::Mat MotionBlurKernel(const cv::Vec2d& direction, double length_px) {
  const int radius = static_cast<int>(std::ceil(0.5 * length_px));
  cv::Mat kernel = cv::Mat::zeros(2 * radius + 1, 2 * radius + 1, CV_32FC1);
  const double norm = std::hypot(direction[0], direction[1]);
  const cv::Vec2d along = norm > 0 ? direction / norm : cv::Vec2d(1, 0);
  const int steps = 8 * radius + 1;
  for (int i = 0; i < steps; ++i) {
    const double s = length_px * (static_cast<double>(i) / (steps - 1) - 0.5);
    kernel.at<float>(radius + static_cast<int>(std::lround(s * along[1])),
                     radius + static_cast<int>(std::lround(s * along[0]))) += 1.0F / static_cast<float>(steps);
  }
  return kernel;
}

void Expose(cv::Mat& color_bgr, double gain, double gamma) {
  cv::Mat table(1, 256, CV_8UC1);
  for (int value = 0; value < 256; ++value) {
    table.at<uint8_t>(0, value) = cv::saturate_cast<uint8_t>(255 * gain * std::pow(value / 255.0, gamma));
  }
  cv::LUT(color_bgr, table, color_bgr);
}

// Blur of the frames in SynthOptions::blurred, relative to the image width. Removes corners of a few pixels.
constexpr double kStrongMotionBlur = 1.0 / 16;
constexpr double kStrongDefocus = 1.0 / 200;

}  // namespace

FaultyMask DegradeMask(const cv::Mat& true_labels, int object_count, const SynthOptions& options, Random& random) {
  // Draws the same random numbers for all options, so that enabling one fault does not change the others.
  const auto jitter_seed = static_cast<uint32_t>(random.Bits());
  std::vector<uint8_t> shuffled(static_cast<size_t>(object_count));
  for (int i = 0; i < object_count; ++i) shuffled[static_cast<size_t>(i)] = static_cast<uint8_t>(i + 1);
  for (int i = object_count; i > 1; --i)
    std::swap(shuffled[static_cast<size_t>(i - 1)], shuffled[static_cast<size_t>(random.Below(i))]);

  std::array<uint8_t, 256> new_label{};
  std::array<uint8_t, 256> object_of{};
  std::array<double, 256> score{};
  for (int object = 1; object <= object_count; ++object) {
    const bool dropped = random.Chance(options.mask_drop_share);
    const double confidence = random.Uniform(0.55, 0.98);
    if (dropped) continue;
    const uint8_t label =
        options.permute_labels ? shuffled[static_cast<size_t>(object - 1)] : static_cast<uint8_t>(object);
    new_label[static_cast<size_t>(object)] = label;
    object_of[label] = static_cast<uint8_t>(object);
    score[label] = confidence;
  }

  FaultyMask mask;
  const cv::Mat borders =
      options.mask_jitter_px > 0 ? DisplaceBorders(true_labels, options.mask_jitter_px, jitter_seed) : true_labels;
  mask.labels.create(borders.size(), CV_8UC1);
  std::array<bool, 256> present{};
  for (int v = 0; v < borders.rows; ++v) {
    for (int u = 0; u < borders.cols; ++u) {
      const uint8_t label = new_label[borders.at<uint8_t>(v, u)];
      mask.labels.at<uint8_t>(v, u) = label;
      present[label] = true;
    }
  }
  for (size_t label = 1; label < present.size(); ++label) {
    if (present[label]) mask.detections.push_back({static_cast<uint8_t>(label), object_of[label], score[label]});
  }
  return mask;
}

void DegradeImage(cv::Mat& color_bgr, const cv::Vec2d& motion_px, const SynthOptions& options, Random& random,
                  const FramePlan& plan) {
  if (plan.black) color_bgr.setTo(cv::Scalar::all(0));
  if (plan.gain != 1 || plan.gamma != 1) Expose(color_bgr, plan.gain, plan.gamma);
  const double width_px = plan.blurred ? color_bgr.cols : 0;
  const double blur_px = std::max(options.motion_blur_px, kStrongMotionBlur * width_px);
  const double defocus_px = std::max(options.defocus_px, kStrongDefocus * width_px);
  if (blur_px > 0) {
    cv::filter2D(color_bgr, color_bgr, -1, MotionBlurKernel(motion_px, blur_px), cv::Point(-1, -1), 0,
                 cv::BORDER_REPLICATE);
  }
  if (defocus_px > 0) {
    cv::GaussianBlur(color_bgr, color_bgr, cv::Size(), defocus_px, defocus_px, cv::BORDER_REPLICATE);
  }
  if (options.noise_sigma > 0) {
    for (int v = 0; v < color_bgr.rows; ++v) {
      for (int u = 0; u < color_bgr.cols; ++u) {
        cv::Vec3b& pixel = color_bgr.at<cv::Vec3b>(v, u);
        for (int k = 0; k < 3; ++k) {
          pixel[k] = cv::saturate_cast<uint8_t>(pixel[k] + options.noise_sigma * random.Normal());
        }
      }
    }
  }
}

void DegradeDepth(cv::Mat& depth_m, const SynthOptions& options, Random& random) {
  if (options.depth_noise_mm <= 0) return;
  for (int v = 0; v < depth_m.rows; ++v) {
    for (int u = 0; u < depth_m.cols; ++u) {
      float& z_m = depth_m.at<float>(v, u);
      // The error of a depth from triangulation (structured light, stereo) grows with the square of the depth.
      const double sigma_m = 1e-3 * options.depth_noise_mm * z_m * z_m;
      z_m = std::max(z_m + static_cast<float>(sigma_m * random.Normal()), 0.0F);
    }
  }
}

}  // namespace romap::synth
