#include "client/cli/mesh_instance.h"

#include "common/color_image.h"

namespace romap::cli {

render::MeshInstance InstanceOf(const MapObject& entry) {
  cv::Mat texture_bgr;
  SampleRange range;
  if (!entry.texture.image.empty()) texture_bgr = DecodeColor(entry.texture.image, &range).value_or(cv::Mat());
  return {.mesh = &entry.mesh, .id = 1, .S_world_mesh = entry.S_world_mesh, .texture_bgr = texture_bgr};
}

}  // namespace romap::cli
