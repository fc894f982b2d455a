#pragma once

#include <compare>
#include <cstdint>
#include <functional>
#include <ostream>
#include <string>

namespace romap {

// A 64-bit id; ids of different kinds do not convert to each other. 0 means "none". Prints as e.g. `object/12`.
template <class Tag>
struct Id {
  uint64_t value = 0;

  constexpr explicit operator bool() const { return value != 0; }
  constexpr auto operator<=>(const Id&) const = default;
  std::string ToString() const { return std::string(Tag::kName) + "/" + std::to_string(value); }
  friend std::ostream& operator<<(std::ostream& os, const Id& id) { return os << id.ToString(); }
};

struct ObjectTag {
  static constexpr const char* kName = "object";
};
struct KeyframeTag {
  static constexpr const char* kName = "keyframe";
};
// A sparse map of a session. 1 is the first map.
struct SparseMapTag {
  static constexpr const char* kName = "map";
};
struct MapPointTag {
  static constexpr const char* kName = "point";
};

using ObjectId = Id<ObjectTag>;
using KeyframeId = Id<KeyframeTag>;
using SparseMapId = Id<SparseMapTag>;
using MapPointId = Id<MapPointTag>;

}  // namespace romap

template <class Tag>
struct std::hash<romap::Id<Tag>> {
  size_t operator()(const romap::Id<Tag>& id) const noexcept { return std::hash<uint64_t>{}(id.value); }
};
