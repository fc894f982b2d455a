// Recordings of all layouts: which reader takes a folder, what it reads, and the frames. The input is a folder as one
// text (folder_text.h). Masks are joined from `masks` or `masks.json`.

#include <filesystem>

#include "client/files/camera_yaml.h"
#include "client/importers/open_recording.h"
#include "tests/fuzz/folder_text.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/support/foreign_layouts.h"

namespace romap::fuzz::sequence_fuzz {
namespace {

using testing_support::SampleRecording;

// camera.yaml, rgb.txt and so on: romap's own layout, made of the TUM layout.
void WriteNativeLayout(const SampleRecording& sample, const ScratchFolder& folder) {
  testing_support::WriteTumLayout(sample, folder.path());
  Require(files::WriteCameraYaml(folder.Path("camera.yaml"), {.camera = sample.camera, .depth_scale = 0.0002}).ok(),
          "a camera can be written");
  folder.Write("detections.csv", "timestamp,label,class\n1305031102.175,1,cup\n");
  folder.Write("objects.yaml",
               "objects:\n  - {id: 1, class: cup, center: [0, 0, 0], yaw: 0, half_extents: [1, 1, 1]}\n");
}

}  // namespace
}  // namespace romap::fuzz::sequence_fuzz

std::vector<std::string> romap::fuzz::Seeds() {
  using namespace testing_support;
  const SampleRecording sample = MakeSample(2);
  std::vector<std::string> seeds;
  const auto add = [&](const auto& write) {
    const ScratchFolder folder;
    write(folder);
    seeds.push_back(FolderAsText(folder.path()));
  };
  add([&](const ScratchFolder& folder) { sequence_fuzz::WriteNativeLayout(sample, folder); });
  add([&](const ScratchFolder& folder) { WriteTumLayout(sample, folder.path()); });
  add([&](const ScratchFolder& folder) { WriteSevenScenesLayout(sample, folder.path()); });
  add([&](const ScratchFolder& folder) { WriteReplicaLayout(sample, folder.Path("scene")); });
  add([&](const ScratchFolder& folder) { WriteVmapLayout(sample, folder.path()); });
  add([&](const ScratchFolder& folder) { WriteTransformsLayout(sample, folder.path()); });
  add([&](const ScratchFolder& folder) {
    WriteTransformsLayout(sample, folder.path(), {.instant_ngp = true, .per_frame_camera = true});
  });
  add([&](const ScratchFolder& folder) { WriteColmapLayout(sample, folder.path(), /*binary=*/false); });
  add([&](const ScratchFolder& folder) { WriteBopLayout(sample, folder.path()); });
  add([&](const ScratchFolder& folder) { WriteScanNetLayout(sample, folder.path()); });
  add([&](const ScratchFolder& folder) { WriteEurocLayout(sample, folder.path()); });
  add([&](const ScratchFolder& folder) { WriteArkitScenesLayout(sample, folder.path()); });
  add([&](const ScratchFolder& folder) { WritePolycamLayout(sample, folder.path(), /*corrected=*/true); });
  for (const MaskLayout layout :
       {MaskLayout::kLabelPng, MaskLayout::kInstanceFiles, MaskLayout::kInstanceFolders, MaskLayout::kYolo}) {
    add([&](const ScratchFolder& folder) {
      WriteImageFolder(sample, folder.path());
      WriteMasks(sample, folder.Path("masks"), layout);
    });
  }
  add([&](const ScratchFolder& folder) {
    WriteImageFolder(sample, folder.path());
    WriteMasks(sample, folder.Path("masks.json"), MaskLayout::kCocoCompressed);
  });
  return seeds;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  static const fuzz::ScratchFolder folder;
  fuzz::WriteFolder(fuzz::TextOf(data, size), folder);
  importers::ReadOptions options;
  options.files.use_depth = true;
  for (const char* masks : {"masks", "masks.json"}) {
    if (std::filesystem::exists(folder.Path(masks))) options.files.masks = masks;
  }
  // The Replica layout has its calibration in the folder above.
  const bool is_below = std::filesystem::is_directory(folder.Path("scene"));
  const auto sequence = importers::OpenRecording(is_below ? folder.Path("scene") : folder.path(), options);
  if (!sequence.ok()) return 0;
  fuzz::Require(sequence->size() > 0, "a sequence has frames");
  for (size_t k = 0; k < sequence->size() && k < 8; ++k) {
    std::vector<files::UnreadableFile> unreadable;
    (void)sequence->LoadReadable(k, &unreadable);
  }
  return 0;
}
