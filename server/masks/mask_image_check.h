#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "common/diagnostic.h"
#include "server/masks/mask_thumbnail.h"

namespace romap::masks {

// Finds masks that do not belong to the images of their frames: masks of earlier or later frames, e.g. because a
// detector stamps its results when they are ready, and masks of other images altogether. The border of a mask lies on
// edges of the image that it was made from, so that the strength of the image edges there is largest for that image.
// The check compares the image of each mask with those of the frames before and after it. Where the masks hardly move,
// all of them fit alike, and there is no decision.
class MaskImageCheck {
 public:
  // Every frame, in order. `gray`: of MakeGray().
  void AddImage(uint64_t frame_id, int64_t timestamp_ns, const cv::Mat& gray);
  // The masks of a frame, at most once, after its image. Ignored if the image is not known any more.
  void AddMasks(uint64_t frame_id, const MaskThumbnail& masks);

  // masks_displaced or masks_contradict_images.
  std::optional<Diagnostic> Check() const;

 private:
  static constexpr int kMaxShift = 25;  // frames

  struct Frame {
    uint64_t frame_id = 0;
    int64_t timestamp_ns = 0;
    cv::Mat edges;                  // CV_16UC1, kEdgeUnit times the strength relative to its mean over the image
    std::vector<cv::Point> border;  // of the masks; empty: no masks
    cv::Mat near_border = {};       // CV_8UC1, nonzero within 2 px of the border
    double fit = 0;                 // of the masks to the image
    double far_fits = 0;            // sum of the fits to the images of frames that are far away
    int far_images = 0;
    double far_overlaps = 0;  // sum of the shares of the border that lie near that of masks far away
    int far_masks = 0;
  };
  // Of masks with the images of the frames at one distance.
  struct Shift {
    double masks = 0;   // recent ones: older ones count less
    double better = 0;  // fit this image better than their own
    double fit = 0;     // sum
    double own_fit = 0;
  };

  // Masks that were compared with images far away: recent ones, older ones count less.
  struct Verdict {
    double masks = 0;
    double fitting = 0;  // fit their own image better
    double overlap = 0;  // sum of the mean shares of the border that lie near that of masks far away

    void Add(const Frame& masks);
  };

  // Mean strength of the edges of an image at the border of masks, relative to its mean over the image.
  static double Fit(const Frame& masks, const Frame& image);
  static double Overlap(const Frame& masks, const Frame& others);
  void Compare(Frame& masks, size_t masks_index, size_t image_index);
  std::optional<Diagnostic> FindShift() const;

  std::deque<Frame> frames_;          // the newest ones
  std::map<int, Shift> shifts_;       // by the number of frames from the masks to the image, without 0
  std::deque<int64_t> intervals_ns_;  // between frames, the newest ones
  Verdict concluded_;                 // of the masks that left `frames_`
};

}  // namespace romap::masks
