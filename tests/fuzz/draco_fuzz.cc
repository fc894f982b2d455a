// Compressed meshes: from a server, from a session file, and on the way to a GLB file.

#include "common/gltf/glb.h"
#include "common/mesh_codec.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/sample_mesh.h"

std::vector<std::string> romap::fuzz::Seeds() {
  Mesh plain;
  plain.vertices = SampleMesh().vertices;
  plain.triangles = SampleMesh().triangles;
  std::vector<std::string> seeds;
  for (const int speed : {0, 5, 10}) {
    seeds.push_back(EncodeDraco(plain, {.speed = speed}).value());
    // Below 4, texture coordinates are stored with orientations, of which libdraco reads up to 2^31 from a damaged
    // stream before it checks their number. romap encodes with 5.
    if (speed >= 4) seeds.push_back(EncodeDraco(SampleMesh(), {.speed = speed}).value());
  }
  return seeds;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  const auto mesh = DecodeDraco(fuzz::TextOf(data, size));
  if (!mesh.ok()) return 0;
  for (const auto& triangle : mesh->triangles) {
    for (const uint32_t vertex : triangle) fuzz::Require(vertex < mesh->vertices.size(), "triangles have vertices");
  }
  const GlbObject object{.mesh = &*mesh};
  fuzz::Require(EncodeGlb({&object, 1}, "mesh").ok(), "a decoded mesh can be written as GLB");
  return 0;
}
