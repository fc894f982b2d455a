#include "common/utf8.h"

#include <utf8.h>

namespace romap {

bool IsUtf8(const std::string& text) { return utf8::is_valid(text.begin(), text.end()); }

}  // namespace romap
