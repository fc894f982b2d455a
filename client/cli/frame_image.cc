#include "client/cli/frame_image.h"

#include <opencv2/imgproc.hpp>
#include <vector>

#include "common/color_image.h"
#include "common/label_png.h"
#include "common/lens.h"

namespace romap::cli {

absl::StatusOr<FrameImage> LoadFrameImage(const files::Sequence& sequence, size_t index) {
  std::vector<files::UnreadableFile> unreadable;
  ROMAP_ASSIGN_OR_RETURN(const FrameInput frame, sequence.LoadReadable(index, &unreadable));
  SampleRange range;
  absl::StatusOr<cv::Mat> color = DecodeColor(frame.image, &range);
  if (!color.ok()) return InvalidArgument("{}: {}", sequence.paths(index).image, Message(color.status()));
  FrameImage image{.color_bgr = *std::move(color)};
  if (frame.mask_encoding == MaskEncoding::kLabelPng) {
    if (auto labels = DecodeLabelPng(frame.label_png); labels.ok()) image.labels = *std::move(labels);
  }
  if (!sequence.camera().HasDistortion()) return image;
  const UndistortionMaps maps = MakeUndistortionMaps(sequence.camera());
  FrameImage pinhole;
  cv::remap(image.color_bgr, pinhole.color_bgr, maps.xy, maps.fraction, cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  if (!image.labels.empty()) {
    cv::remap(image.labels, pinhole.labels, maps.xy, maps.fraction, cv::INTER_NEAREST, cv::BORDER_CONSTANT);
  }
  return pinhole;
}

}  // namespace romap::cli
