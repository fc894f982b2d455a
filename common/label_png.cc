#include "common/label_png.h"

#include "common/png_reader.h"
#include "common/status.h"

namespace romap {

absl::StatusOr<cv::Mat> DecodeLabelPng(std::string_view bytes, const DecodeLimits& limits) {
  ROMAP_ASSIGN_OR_RETURN(cv::Mat values, DecodePng(bytes, PngPixels::kStored, limits));
  if (values.type() == CV_16UC1) return values;
  cv::Mat labels;
  values.convertTo(labels, CV_16U);
  return labels;
}

}  // namespace romap
