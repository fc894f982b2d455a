// Wavefront OBJ files.

#include "client/files/obj.h"
#include "client/files/obj_write.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/sample_mesh.h"
#include "tests/fuzz/scratch_folder.h"

std::vector<std::string> romap::fuzz::Seeds() {
  const ScratchFolder folder;
  Require(files::WriteObj(folder.Path("a.obj"), SampleMesh()).ok(), "a mesh can be written");
  return {folder.Read("a.obj"),
          "# a quad\nmtllib a.mtl\no quad\nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0 0.5 0.5 0.5\nv 0 1 0\nvn 0 0 1\nvt 0 0\n"
          "g first\nusemtl m\ns off\nf 1/1/1 2/1/1 3//1 -1\nf 1 2 3\nl 1 2\np 3\n"};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  static const fuzz::ScratchFolder folder;
  const auto file = files::ReadObj(folder.Write("a.obj", fuzz::TextOf(data, size)));
  if (!file.ok()) return 0;
  for (const auto& triangle : file->mesh.triangles) {
    for (const uint32_t vertex : triangle) {
      fuzz::Require(vertex < file->mesh.vertices.size(), "triangles have vertices");
    }
  }
  return 0;
}
