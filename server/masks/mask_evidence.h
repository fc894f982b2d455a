#pragma once

#include <string_view>

#include "server/masks/mask_thumbnail.h"

namespace romap::masks {

// Reason why the mask of one frame looks like background, as text; nullptr if it looks like an object. Background has
// no outline of its own: it fills most of the image, extends beyond most sides of it, or surrounds the other masks.
const char* LooksLikeBackground(const MaskThumbnail& thumbnail, const MaskRegion& region, std::string_view class_name);

}  // namespace romap::masks
