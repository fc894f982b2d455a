#include "common/color_image.h"

#include "common/image_bytes.h"
#include "common/jpeg_reader.h"
#include "common/png_reader.h"
#include "common/status.h"

namespace romap {

absl::StatusOr<cv::Mat> DecodeColor(std::string_view bytes, SampleRange* range, const DecodeLimits& limits) {
  if (!PngHeader(bytes)) return DecodeJpeg(bytes, limits);
  ROMAP_ASSIGN_OR_RETURN(const cv::Mat image, DecodePng(bytes, PngPixels::kBgr, limits));
  return image.depth() == CV_16U ? range->To8Bit(image) : image;
}

}  // namespace romap
