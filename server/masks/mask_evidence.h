#pragma once

#include <string_view>

#include "server/masks/mask_thumbnail.h"

namespace romap::masks {

// Why the mask of one frame looks like background, not like an object: it has no outline of its own.
enum class BackgroundSign {
  kNone,
  kFillsImage,       // most of it
  kSurroundsOthers,  // the other masks lie within it, but for a part of their outline
  kCrossesBorders,   // it extends beyond most sides of the image
};

BackgroundSign FindBackgroundSign(const MaskThumbnail& thumbnail, const MaskRegion& region,
                                  std::string_view class_name);

}  // namespace romap::masks
