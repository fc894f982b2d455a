#include "client/files/glb.h"

#include "client/files/text_file.h"
#include "common/gltf/glb.h"

namespace romap::files {

absl::Status WriteGlb(const std::string& path, const Mesh& mesh, const Sim3<World, Object>& S_world_mesh,
                      const MeshTexture& texture) {
  const GlbObject object{.mesh = &mesh, .S_world_mesh = S_world_mesh, .texture = texture};
  ROMAP_ASSIGN_OR_RETURN(const std::string bytes, EncodeGlb({&object, 1}, path));
  return WriteFile(path, bytes);
}

}  // namespace romap::files
