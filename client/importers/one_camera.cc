#include "client/importers/one_camera.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "client/importers/any_image.h"
#include "client/importers/mask_layers.h"
#include "client/importers/png_masks.h"
#include "common/label_png.h"
#include "common/png_reader.h"

namespace romap::importers {
namespace {

// The largest difference of the four intrinsics.
double Difference_px(const CameraModel& a, const CameraModel& b) {
  return std::max({std::abs(a.fx_px - b.fx_px), std::abs(a.fy_px - b.fy_px), std::abs(a.cx_px - b.cx_px),
                   std::abs(a.cy_px - b.cy_px)});
}

bool HaveSameLens(const CameraModel& a, const CameraModel& b) {
  const auto close = [](double x, double y) { return std::abs(x - y) <= 1e-6 + 1e-3 * std::abs(y); };
  return a.lens == b.lens && std::ranges::equal(a.distortion, b.distortion, close);
}

void ResampleFrame(const CameraModel& from, const CameraModel& to, RecordedFrame* frame) {
  frame->load_image = [load = std::move(frame->load_image), path = frame->paths.image, from,
                       to]() -> absl::StatusOr<files::ImageFile> {
    ROMAP_ASSIGN_OR_RETURN(const files::ImageFile file, load ? load() : files::ReadImageFile(path));
    ROMAP_ASSIGN_OR_RETURN(const cv::Mat image, DecodeImage(file, path));
    return files::ImageFile{EncodePng(ResampleFor(image, from, to, cv::INTER_LINEAR)), ImageEncoding::kPng};
  };
  const cv::Size size_px(to.width_px, to.height_px);
  frame->load_masks = [load = std::move(frame->load_masks), path = frame->paths.mask, instances = frame->instances,
                       from, to, size_px]() -> absl::StatusOr<EncodedMasks> {
    ROMAP_ASSIGN_OR_RETURN(EncodedMasks masks, load ? load() : LoadLabelImage(path, instances, size_px));
    ROMAP_ASSIGN_OR_RETURN(const cv::Mat labels, DecodeLabelPng(masks.label_png));
    masks.label_png = EncodeLabelImage(ResampleFor(labels, from, to, cv::INTER_NEAREST));
    return masks;
  };
  frame->load_depth = [load = std::move(frame->load_depth), path = frame->paths.depth, from,
                       to]() -> absl::StatusOr<std::string> {
    ROMAP_ASSIGN_OR_RETURN(const std::string png, load ? load() : files::ReadPngFile(path));
    const absl::StatusOr<cv::Mat> depth = DecodePng(png, PngPixels::kStored, {});
    if (!depth.ok()) return InvalidArgument("{}: {}", path, Message(depth.status()));
    return EncodePng(ResampleFor(*depth, from, to, cv::INTER_NEAREST));
  };
}

}  // namespace

cv::Mat ResampleFor(const cv::Mat& image, const CameraModel& from, const CameraModel& to, int interpolation) {
  // u_from = fx_from * (u_to - cx_to) / fx_to + cx_from
  const double scale_x = from.fx_px / to.fx_px, scale_y = from.fy_px / to.fy_px;
  const cv::Matx23d from_to(scale_x, 0, from.cx_px - scale_x * to.cx_px,  //
                            0, scale_y, from.cy_px - scale_y * to.cy_px);
  cv::Mat resampled;
  cv::warpAffine(image, resampled, from_to, cv::Size(to.width_px, to.height_px), interpolation | cv::WARP_INVERSE_MAP,
                 cv::BORDER_CONSTANT, cv::Scalar::all(0));
  return resampled;
}

absl::Status UseOneCamera(RecordingContents* contents) {
  const CameraModel& camera = contents->camera.camera;
  size_t resampled = 0;
  double largest_px = 0;
  for (RecordedFrame& frame : contents->frames) {
    if (!frame.camera) continue;
    const CameraModel& own = *frame.camera;
    if (own.width_px != camera.width_px || own.height_px != camera.height_px) {
      return InvalidArgument("{}: {}x{} px, but the first frame has {}x{} px; a recording needs one size",
                             frame.paths.image, own.width_px, own.height_px, camera.width_px, camera.height_px);
    }
    if (!HaveSameLens(own, camera)) {
      return InvalidArgument("{}: the distortion differs from that of the first frame; a recording needs one lens",
                             frame.paths.image);
    }
    const double difference_px = Difference_px(own, camera);
    if (difference_px <= kMaxIntrinsicsDifference_px) continue;
    largest_px = std::max(largest_px, difference_px);
    ++resampled;
    ResampleFrame(own, camera, &frame);
  }
  if (resampled > 0) {
    contents->diagnostics.push_back(
        {.code = "intrinsics_unified",
         .severity = Severity::kInfo,
         .count = resampled,
         .text = fmt::format("the intrinsics of {} of {} frames differ from those of the first, by up to {:.1f} px; "
                             "these frames are resampled for the first camera",
                             resampled, contents->frames.size(), largest_px)});
  }
  return absl::OkStatus();
}

}  // namespace romap::importers
