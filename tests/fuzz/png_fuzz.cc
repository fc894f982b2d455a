// PNG files: color images, label images and depth.

#include "common/color_image.h"
#include "common/image_bytes.h"
#include "common/label_png.h"
#include "common/png_reader.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/repair.h"
#include "tests/fuzz/sample_images.h"

std::vector<std::string> romap::fuzz::Seeds() {
  std::vector<std::string> seeds = SampleLabelPngs();
  for (const int bits : {8, 16}) {
    seeds.push_back(SamplePng(1, bits));
    seeds.push_back(SamplePng(3, bits));
  }
  return seeds;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  std::string bytes = fuzz::TextOf(data, size);
  fuzz::RepairPng(&bytes);
  (void)IsCompletePng(bytes);
  const auto header = PngHeader(bytes);
  const DecodeLimits limits{.max_pixels = 1 << 16};
  for (const PngPixels pixels : {PngPixels::kStored, PngPixels::kBgr}) {
    const auto image = DecodePng(bytes, pixels, limits);
    if (!image.ok()) continue;
    fuzz::Require(header.has_value(), "an image that can be decoded has a header");
    fuzz::Require(image->cols == header->width_px && image->rows == header->height_px, "the header states the size");
  }
  const auto labels = DecodeLabelPng(bytes, limits);
  if (labels.ok()) fuzz::Require(labels->type() == CV_16UC1, "labels have 16 bits");
  SampleRange range;
  const auto color = DecodeColor(bytes, &range, limits);
  if (color.ok()) fuzz::Require(color->type() == CV_8UC3, "colors have three channels of 8 bits");
  return 0;
}
