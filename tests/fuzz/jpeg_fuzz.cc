// JPEG files: color images of frames and of recordings.

#include "common/color_image.h"
#include "common/image_bytes.h"
#include "common/jpeg_reader.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/sample_images.h"
#include "tests/support/test_jpeg.h"

std::vector<std::string> romap::fuzz::Seeds() {
  const std::string progressive = SampleJpeg(true);
  return {SampleJpeg(false), progressive, testing_support::WithScans(progressive, 3)};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  const std::string bytes = fuzz::TextOf(data, size);
  (void)IsCompleteJpeg(bytes);
  const auto header = JpegHeader(bytes);
  // As for a session of small images. Without a limit, libjpeg works long on the sizes that a header can state.
  const DecodeLimits limits{.max_pixels = 1 << 16};
  const auto image = DecodeJpeg(bytes, limits);
  if (image.ok()) {
    fuzz::Require(header.ok(), "an image that can be decoded has a header");
    fuzz::Require(image->cols == header->width_px && image->rows == header->height_px, "the header states the size");
  }
  SampleRange range;
  (void)DecodeColor(bytes, &range, limits);
  return 0;
}
