#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

namespace romap::slam {

// A gray image and its halves, quarters, ..., for reading patches of any size without aliasing.
class HalvedImages {
 public:
  HalvedImages() = default;
  // `image`: CV_8UC3 (BGR) or CV_8UC1.
  explicit HalvedImages(const cv::Mat& image);

  bool empty() const { return levels_.empty(); }
  // Number of the level whose pixels are at most `pixel_size_px` pixels of the full image wide.
  size_t LevelFor(double pixel_size_px) const;
  // Gray value of a level at a pixel of the full image, interpolated bilinearly; nullopt outside the image.
  std::optional<float> At(size_t level, const Eigen::Vector2d& pixel_px) const;

 private:
  std::vector<cv::Mat> levels_;
};

// The appearance of a map point in its reference keyframe: gray values on a square grid around the feature, one pixel
// of the feature's octave apart.
struct Patch {
  static constexpr int kRadius = 4;                    // of the part that is compared; one more ring is for gradients
  static constexpr int kSide = 2 * (kRadius + 1) + 1;  // 11

  std::array<float, kSide * kSide> gray{};  // row by row

  float At(int x, int y) const { return gray[static_cast<size_t>((y + kRadius + 1) * kSide + x + kRadius + 1)]; }

  // nullopt if the patch extends beyond the image.
  static std::optional<Patch> Read(const HalvedImages& image, const Eigen::Vector2d& center_px, double octave_scale);
};

struct PatchAlignment {
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();  // of the patch's center in the image
  double correlation = 0;                              // zero-mean, normalized; -1..1
};

// Finds the position of a patch in another image to a fraction of a pixel: Gauss-Newton on the gray values, which may
// differ by gain and offset (Lucas and Kanade 1981; inverse compositional form: Baker and Matthews 2004).
// `image_from_patch`: derivative of image pixels by patch grid units at the point, from the geometry. Starts at
// `start_px`. nullopt: no texture, or the position moved by more than one and a half patch grid units, which is more
// than the feature detector's error.
std::optional<PatchAlignment> AlignPatch(const Patch& patch, const HalvedImages& image,
                                         const Eigen::Matrix2d& image_from_patch, const Eigen::Vector2d& start_px);

}  // namespace romap::slam
