#include "common/version.h"

namespace romap {

const char* Version() { return ROMAP_VERSION; }

}  // namespace romap
