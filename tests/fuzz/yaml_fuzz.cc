// Cameras and cuboids in YAML and JSON.

#include "client/files/camera_yaml.h"
#include "client/files/objects_yaml.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/scratch_folder.h"

std::vector<std::string> romap::fuzz::Seeds() {
  return {
      "width: 640\nheight: 480\nfx: 500\nfy: 500.5\ncx: 319.5\ncy: 239.5\nlens: fisheye\ndistortion: [0.1, 0, 0, 0]\n"
      "readout_s: 0.02\nfps: 25\ndepth_scale: 0.001\nworld_up: -y\n",
      "world_up: [0, 0, 1]\nobjects:\n  - {id: 3, name: a, class: cup, center: [1, 2, 3], yaw: 0.5, half_extents: "
      "[0.1, 0.1, 0.2]}\n  - id: 4\n    name: b\n    class: book\n    half_extents: [1, 1, 1]\n    T_world_object: "
      "[1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n    confidence: 0.5\n",
      R"({"world_up": [0, 1, 0], "objects": [{"id": 1, "class": "cup", "center": [0, 0, 0], "yaw": 0,)"
      R"( "half_extents": [1, 2, 3]}]})"};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  static const fuzz::ScratchFolder folder;
  const std::string path = folder.Write("a.yaml", fuzz::TextOf(data, size));
  const auto camera = files::ReadCameraYaml(path);
  if (camera.ok()) {
    fuzz::Require(files::WriteCameraYaml(folder.Path("copy.yaml"), *camera).ok(), "a camera can be written");
    fuzz::Require(files::ReadCameraYaml(folder.Path("copy.yaml")).ok(), "a camera that was written can be read");
  }
  const auto objects = files::ReadObjects(path);
  if (!objects.ok()) return 0;
  for (const char* name : {"copy.yaml", "copy.json"}) {
    fuzz::Require(files::WriteObjects(folder.Path(name), *objects).ok(), "cuboids can be written");
    const auto copy = files::ReadObjects(folder.Path(name));
    fuzz::Require(copy.ok() && copy->objects.size() == objects->objects.size(),
                  "cuboids that were written can be read");
  }
  return 0;
}
