#pragma once

#include <string_view>

namespace romap::masks {

// Whether a class name denotes a surface or the surroundings, such as "table", "dining table" or "floor-wood": the
// "stuff" classes of the public segmentation sets. A name alone decides nothing, because the name may be wrong and a
// small table may be an object; with it, less evidence suffices.
bool IsSurfaceName(std::string_view class_name);

}  // namespace romap::masks
