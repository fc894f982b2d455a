// COLMAP models, as text and binary. The input is a folder as one text (folder_text.h).

#include "client/importers/colmap_model.h"
#include "tests/fuzz/folder_text.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/support/foreign_layouts.h"

std::vector<std::string> romap::fuzz::Seeds() {
  std::vector<std::string> seeds;
  for (const bool binary : {false, true}) {
    const ScratchFolder folder;
    testing_support::WriteColmapLayout(testing_support::MakeSample(2), folder.path(), binary);
    seeds.push_back(FolderAsText(folder.Path("sparse/0")));
  }
  return seeds;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  static const fuzz::ScratchFolder folder;
  fuzz::WriteFolder(fuzz::TextOf(data, size), folder);
  if (!importers::HasColmapModel(folder.path())) return 0;
  const auto model = importers::ReadColmapModel(folder.path());
  if (!model.ok()) return 0;
  for (const importers::ColmapImage& image : model->images) {
    fuzz::Require(image.T_world_camera.IsFinite(), "poses are finite");
  }
  return 0;
}
