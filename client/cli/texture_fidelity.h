#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/cli/map_files.h"
#include "client/files/sequence.h"
#include "common/status.h"

namespace romap::cli {

// How closely the rendered mesh of an object resembles images that the map was not made from.
struct TextureFidelity {
  std::string object;  // file stem
  double psnr_db = 0;  // over all pixels of all frames, peak 255; mean of the squared errors of R, G and B
  size_t frames = 0;
  size_t pixels = 0;
};

// Renders the meshes with their textures, or with their vertex colors, and compares them with frames of the sequence
// (indices) at the poses of the sequence. A pixel counts if the mesh covers it, is in front of the other meshes there,
// and the mask shows the same object, up to a few pixels from the borders of both: the label that most of the covered
// pixels have. Without masks, all covered pixels count. Objects that no frame shows are left out. Frames without a pose
// or a readable image do not count.
std::vector<TextureFidelity> MeasureTextures(const std::vector<MapObject>& objects, const files::Sequence& sequence,
                                             std::span<const size_t> frames);

// Over the objects; nullopt without objects.
std::optional<double> MeanPsnr_db(std::span<const TextureFidelity> textures);

}  // namespace romap::cli
