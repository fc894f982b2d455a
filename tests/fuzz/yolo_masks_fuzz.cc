// Masks as YOLO segmentations, with the names of the classes. The input is a folder as one text (folder_text.h).

#include "client/importers/yolo_masks.h"
#include "tests/fuzz/folder_text.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/named_masks.h"
#include "tests/support/foreign_layouts.h"

std::vector<std::string> romap::fuzz::Seeds() {
  const ScratchFolder folder;
  testing_support::WriteMasks(testing_support::MakeSample(2), folder.path(), testing_support::MaskLayout::kYolo);
  return {FolderAsText(folder.path()),
          "=== data.yaml\nnames: [cup, book]\n=== labels/1.txt\n0 0.1 0.1 0.5 0.1 0.5 0.5 0.9\n",
          "=== classes.txt\ncup\n=== labels/1.txt\n7 0 0 1 0 1 1\n"};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  static const fuzz::ScratchFolder folder;
  fuzz::WriteFolder(fuzz::TextOf(data, size), folder);
  const cv::Size size_px(48, 36);
  fuzz::LoadMasks(importers::ReadYoloMasks(folder.Path("labels"), size_px), size_px);
  return 0;
}
