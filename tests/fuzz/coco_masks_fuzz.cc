// Masks as COCO files: polygons and run lengths, with and without compression.

#include "client/importers/coco_masks.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/named_masks.h"
#include "tests/fuzz/scratch_folder.h"
#include "tests/support/foreign_layouts.h"

std::vector<std::string> romap::fuzz::Seeds() {
  using testing_support::MaskLayout;
  const ScratchFolder folder;
  const testing_support::SampleRecording sample = testing_support::MakeSample(1);
  std::vector<std::string> seeds = {"04O2N1M3", "PPYo0"};
  for (const MaskLayout layout : {MaskLayout::kCocoPolygons, MaskLayout::kCocoRuns, MaskLayout::kCocoCompressed}) {
    testing_support::WriteMasks(sample, folder.Path("coco.json"), layout);
    seeds.push_back(folder.Read("coco.json"));
  }
  return seeds;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  static const fuzz::ScratchFolder folder;
  const std::string text = fuzz::TextOf(data, size);
  const cv::Size size_px(48, 36);
  const auto runs = importers::DecodeCocoRuns(text);
  if (runs.ok()) {
    const auto mask = importers::MaskOfRuns(*runs, size_px);
    if (mask.ok()) fuzz::Require(mask->size() == size_px, "the mask has the size of the image");
  }
  fuzz::LoadMasks(importers::ReadCocoMasks(folder.Write("coco.json", text), size_px), size_px);
  return 0;
}
