// Depth images of recordings with their confidence, which are registered to the color camera. The input is a folder as
// one text (folder_text.h) with depth.png and confidence.png.

#include "client/importers/depth_image.h"
#include "common/png_reader.h"
#include "tests/fuzz/folder_text.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/sample_images.h"

namespace romap::fuzz::depth_image_fuzz {
namespace {

CameraModel CameraOf(int side_px) {
  CameraModel camera;
  camera.width_px = camera.height_px = side_px;
  camera.fx_px = camera.fy_px = side_px;
  camera.cx_px = camera.cy_px = 0.5 * side_px;
  return camera;
}

}  // namespace
}  // namespace romap::fuzz::depth_image_fuzz

std::vector<std::string> romap::fuzz::Seeds() {
  return {"=== depth.png\n" + SamplePng(1, 16) + "\n=== confidence.png\n" + SamplePng(1, 8) + "\n",
          "=== depth.png\n" + SamplePng(1, 16) + "\n", "=== depth.png\n" + SampleLabelPngs().front() + "\n"};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  static const fuzz::ScratchFolder folder;
  fuzz::WriteFolder(fuzz::TextOf(data, size), folder);
  importers::DepthRules rules{.unknown = {65535}, .min_confidence = 2};
  for (const bool has_camera : {false, true}) {
    if (has_camera) rules.camera = fuzz::depth_image_fuzz::CameraOf(fuzz::kSide_px);
    for (const std::string& confidence : {std::string(), folder.Path("confidence.png")}) {
      rules.confidence = confidence;
      const auto bytes = importers::LoadDepthImage(folder.Path("depth.png"), rules,
                                                   fuzz::depth_image_fuzz::CameraOf(2 * fuzz::kSide_px));
      if (!bytes.ok()) continue;
      (void)DecodePng(*bytes, PngPixels::kStored, {.max_pixels = 1 << 16});
    }
  }
  return 0;
}
