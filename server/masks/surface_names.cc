#include "server/masks/surface_names.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_split.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

namespace romap::masks {

bool IsSurfaceName(std::string_view class_name) {
  static constexpr std::array kWords = {"background", "carpet", "ceiling",  "counter",  "countertop", "desk",   "floor",
                                        "grass",      "ground", "mat",      "pavement", "road",       "rug",    "sky",
                                        "surface",    "table",  "tabletop", "wall",     "workbench",  "terrain"};
  const std::string lower = absl::AsciiStrToLower(std::string(class_name));
  const std::vector<std::string> words = absl::StrSplit(lower, absl::ByAnyChar(" -_/,.:;()"), absl::SkipEmpty());
  return std::any_of(words.begin(), words.end(), [](const std::string& word) {
    return std::find(kWords.begin(), kWords.end(), word) != kWords.end();
  });
}

}  // namespace romap::masks
