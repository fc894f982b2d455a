// PLY files: meshes of romap and of other programs.

#include "client/files/ply.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/sample_mesh.h"
#include "tests/fuzz/scratch_folder.h"

std::vector<std::string> romap::fuzz::Seeds() {
  const ScratchFolder folder;
  Mesh mesh = SampleMesh();
  mesh.uv.clear();
  Require(files::WritePly(folder.Path("a.ply"), mesh, {{"label", std::vector<double>(mesh.vertices.size(), 3)}}).ok() &&
              files::WriteWorldPly(folder.Path("b.ply"), mesh, {}).ok(),
          "a mesh can be written");
  const std::string header =
      "ply\ncomment made by hand\nelement vertex 3\nproperty double x\nproperty float y\n"
      "property int z\nproperty uchar red\nproperty list uchar short extra\nelement face 1\n"
      "property list uchar int vertex_indices\nend_header\n";
  std::string text = header, big = header;
  text.insert(4, "format ascii 1.0\n");
  text += "0 0 0 7 0\n1 0 0 8 2 5 6\n0 1 0 9 1 3\n3 0 1 2\n";
  big.insert(4, "format binary_big_endian 1.0\n");
  for (int vertex = 0; vertex < 3; ++vertex) big += std::string(8 + 4 + 4 + 1 + 1, '\0');
  big += std::string("\x03\0\0\0\0\0\0\0\1\0\0\0\2", 13);
  return {folder.Read("a.ply"), folder.Read("b.ply"), text, big};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  const auto file = files::ParsePly(fuzz::TextOf(data, size), "a.ply");
  if (!file.ok()) return 0;
  const size_t vertices = file->mesh.vertices.size();
  for (const auto& triangle : file->mesh.triangles) {
    for (const uint32_t vertex : triangle) fuzz::Require(vertex < vertices, "triangles have vertices");
  }
  fuzz::Require(file->mesh.normals.empty() || file->mesh.normals.size() == vertices, "every vertex has a normal");
  fuzz::Require(file->mesh.colors.empty() || file->mesh.colors.size() == vertices, "every vertex has a color");
  for (const auto& [name, values] : file->scalars) fuzz::Require(values.size() == vertices, "every vertex has a value");
  return 0;
}
