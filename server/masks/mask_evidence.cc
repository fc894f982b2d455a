#include "server/masks/mask_evidence.h"

#include "server/masks/surface_names.h"

namespace romap::masks {
namespace {

constexpr double kMostOfImage = 0.6;  // share of the image under one mask
constexpr int kMostSides = 3;         // of the four sides of the image
constexpr int kSurfaceSides = 2;      // the same for a mask with the name of a surface
constexpr double kSurrounded = 0.6;   // share of an outline next to one mask
constexpr int kMinSurrounded = 3;     // masks; a sofa may surround its two cushions
constexpr int kMinOutline = 8;        // thumbnail pixels; shorter outlines are too coarse

// How a mask borders on the others.
struct Surroundings {
  int surrounded = 0;  // masks that lie within this one, but for a part of their outline
  double share = 0;    // of the outlines of all other masks next to this one
};

Surroundings MeasureSurroundings(const MaskThumbnail& thumbnail, uint16_t label) {
  Surroundings result;
  int outline = 0;
  int next_to = 0;
  for (const MaskRegion& other : thumbnail.regions) {
    if (other.label == label || other.outline < kMinOutline) continue;
    const auto contact = other.contacts.find(label);
    const int contacts = contact == other.contacts.end() ? 0 : contact->second;
    outline += other.outline;
    next_to += contacts;
    if (contacts >= kSurrounded * other.outline) ++result.surrounded;
  }
  if (outline > 0) result.share = static_cast<double>(next_to) / outline;
  return result;
}

}  // namespace

BackgroundSign FindBackgroundSign(const MaskThumbnail& thumbnail, const MaskRegion& region,
                                  std::string_view class_name) {
  const bool is_surface = IsSurfaceName(class_name);
  if (region.area > kMostOfImage * thumbnail.pixels()) return BackgroundSign::kFillsImage;
  const Surroundings around = MeasureSurroundings(thumbnail, region.label);
  if (around.share >= kSurrounded && around.surrounded >= (is_surface ? 1 : kMinSurrounded)) {
    return BackgroundSign::kSurroundsOthers;
  }
  return region.sides >= (is_surface ? kSurfaceSides : kMostSides) ? BackgroundSign::kCrossesBorders
                                                                   : BackgroundSign::kNone;
}

}  // namespace romap::masks
