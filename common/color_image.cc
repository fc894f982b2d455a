#include "common/color_image.h"

#include <opencv2/imgcodecs.hpp>

namespace romap {

cv::Mat DecodeColor(std::string_view bytes, SampleRange* range) {
  if (bytes.empty()) return {};  // cv::imdecode throws
  try {
    const cv::Mat buffer(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
    const cv::Mat image = cv::imdecode(buffer, cv::IMREAD_COLOR | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
    return image.depth() == CV_16U ? range->To8Bit(image) : image;
  } catch (const cv::Exception&) {
    return {};
  }
}

}  // namespace romap
