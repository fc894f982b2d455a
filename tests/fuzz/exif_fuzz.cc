// The Exif data of a JPEG file, and files that only begin like images.

#include "client/files/image_file.h"
#include "client/importers/any_image.h"
#include "client/importers/calibration_guess.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/sample_images.h"
#include "tests/fuzz/scratch_folder.h"
#include "tests/support/test_png.h"

namespace romap::fuzz::exif_fuzz {
namespace {

// The segment of the focal length for film of 35 mm (tag 0xa405, 27 mm), in the directory that 0x8769 refers to.
std::string FocalSegment() {
  std::string exif("Exif\0\0MM\0\x2a\0\0\0\x08", 14);
  exif += std::string("\0\x01\x87\x69\0\x04\0\0\0\x01\0\0\0\x1a\0\0\0\0", 18);
  exif += std::string("\0\x01\xa4\x05\0\x03\0\0\0\x01\0\x1b\0\0\0\0\0\0", 18);
  const size_t length = exif.size() + 2;
  return std::string("\xff\xe1") + static_cast<char>(length >> 8) + static_cast<char>(length) + exif;
}

}  // namespace
}  // namespace romap::fuzz::exif_fuzz

std::vector<std::string> romap::fuzz::Seeds() {
  const std::string jpeg = SampleJpeg(false);
  std::string focal = jpeg;
  focal.insert(2, exif_fuzz::FocalSegment());
  const ScratchFolder folder;
  const auto found_mm = importers::FocalLength35mm(folder.Write("a.jpg", focal));
  Require(found_mm && *found_mm == 27, "the focal length of the seed is read");
  return {focal, testing_support::WithOrientation(jpeg, 6), SamplePng(3, 8), "P6\n2 2\n255\n............", "BM......"};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  static const fuzz::ScratchFolder folder;
  const std::string path = folder.Write("a.jpg", fuzz::TextOf(data, size));
  (void)importers::FocalLength35mm(path);
  (void)importers::LooksLikeImage(path);
  (void)files::ReadImageFile(path);
  (void)files::ReadPngFile(path);
  return 0;
}
