#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <optional>
#include <utility>

#include "client/files/ply.h"
#include "client/files/text_file.h"
#include "common/mesh_faces.h"

namespace romap::files {
namespace {

enum class Scalar { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };
enum class Layout { kAscii, kLittleEndian, kBigEndian };

struct Property {
  std::string name;
  Scalar type = Scalar::kFloat;
  std::optional<Scalar> count_type;  // of a list
};

struct Element {
  std::string name;
  size_t count = 0;
  std::vector<Property> properties;
};

struct PlyHeader {
  Layout layout = Layout::kAscii;
  std::vector<Element> elements;
  size_t body_offset = 0;
};

size_t SizeOf(Scalar type) {
  constexpr std::array<size_t, 8> kBytes{1, 1, 2, 2, 4, 4, 4, 8};
  return kBytes[static_cast<size_t>(type)];
}

std::optional<Scalar> ParseScalar(const std::string& name) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 8> kNames{{{"char", "int8"},
                                                                                 {"uchar", "uint8"},
                                                                                 {"short", "int16"},
                                                                                 {"ushort", "uint16"},
                                                                                 {"int", "int32"},
                                                                                 {"uint", "uint32"},
                                                                                 {"float", "float32"},
                                                                                 {"double", "float64"}}};
  for (size_t k = 0; k < kNames.size(); ++k) {
    if (name == kNames[k].first || name == kNames[k].second) return static_cast<Scalar>(k);
  }
  return std::nullopt;
}

// Removes the next line from `bytes` and returns its words. nullopt at the end.
std::optional<std::vector<std::string>> NextLine(std::string_view* bytes) {
  const size_t end = bytes->find('\n');
  if (end == std::string_view::npos) return std::nullopt;
  std::string_view line = bytes->substr(0, end);
  bytes->remove_prefix(end + 1);
  std::vector<std::string> words;
  constexpr std::string_view kBlanks = " \t\r";
  for (size_t begin = line.find_first_not_of(kBlanks); begin != std::string_view::npos;
       begin = line.find_first_not_of(kBlanks)) {
    line.remove_prefix(begin);
    words.emplace_back(line.substr(0, line.find_first_of(kBlanks)));
    line.remove_prefix(words.back().size());
  }
  return words;
}

bool ParseLayout(const std::vector<std::string>& words, Layout* layout) {
  if (words.size() < 2) return false;
  if (words[1] == "ascii") return *layout = Layout::kAscii, true;
  if (words[1] == "binary_little_endian") return *layout = Layout::kLittleEndian, true;
  if (words[1] == "binary_big_endian") return *layout = Layout::kBigEndian, true;
  return false;
}

template <class T>
bool HasName(const std::vector<T>& items, const std::string& name) {
  return std::any_of(items.begin(), items.end(), [&](const T& item) { return item.name == name; });
}

bool ParseElement(const std::vector<std::string>& words, std::vector<Element>* elements) {
  if (words.size() < 3) return false;
  Element element{words[1], 0, {}};
  const char* end = words[2].data() + words[2].size();
  const auto [parsed, error] = std::from_chars(words[2].data(), end, element.count);
  if (error != std::errc() || parsed != end || HasName(*elements, element.name)) return false;
  elements->push_back(std::move(element));
  return true;
}

bool ParseProperty(const std::vector<std::string>& words, std::vector<Element>* elements) {
  if (elements->empty() || words.size() < 3) return false;
  const bool is_list = words[1] == "list";
  if (is_list && words.size() < 5) return false;
  const std::optional<Scalar> type = ParseScalar(words[is_list ? 3 : 1]);
  Property property{words[is_list ? 4 : 2], type.value_or(Scalar::kFloat), std::nullopt};
  if (is_list) {
    property.count_type = ParseScalar(words[2]);
    if (!property.count_type) return false;
  }
  std::vector<Property>& properties = elements->back().properties;
  if (!type || HasName(properties, property.name)) return false;
  properties.push_back(std::move(property));
  return true;
}

absl::StatusOr<PlyHeader> ParseHeader(std::string_view bytes, const std::string& name) {
  if (!bytes.starts_with("ply")) return InvalidArgument("{}: not a PLY file (missing 'ply' signature)", name);
  PlyHeader header;
  bool has_layout = false;
  std::string_view rest = bytes;
  while (const auto words = NextLine(&rest)) {
    const std::string keyword = words->empty() ? "" : words->front();
    if (keyword == "end_header") {
      if (!has_layout) return InvalidArgument("{}: the PLY header has no format line", name);
      header.body_offset = bytes.size() - rest.size();
      return header;
    }
    bool ok = true;
    if (keyword == "format") ok = has_layout = ParseLayout(*words, &header.layout);
    if (keyword == "element") ok = ParseElement(*words, &header.elements);
    if (keyword == "property") ok = ParseProperty(*words, &header.elements);
    if (!ok) return InvalidArgument("{}: invalid PLY header line '{}'", name, fmt::join(*words, " "));
  }
  return InvalidArgument("{}: the PLY header has no end_header", name);
}

// Reads the numbers of the data section in order.
class Body {
 public:
  Body(std::string_view bytes, Layout layout) : rest_(bytes), layout_(layout) {}

  // Reads the next number. False at the end of the data or if the next word is not a number.
  bool Next(Scalar type, double* value) {
    return layout_ == Layout::kAscii ? NextWord(value) : NextBinary(type, value);
  }

  // Whether the remaining data can contain `count` rows of these properties.
  bool CanHold(size_t count, const std::vector<Property>& properties) const {
    size_t row_bytes = 0;
    for (const Property& property : properties) {
      row_bytes += layout_ == Layout::kAscii ? 2 : SizeOf(property.count_type.value_or(property.type));
    }
    return row_bytes == 0 || count <= (rest_.size() + 1) / row_bytes;  // + 1: no blank after the last word
  }

 private:
  bool NextWord(double* value) {
    constexpr std::string_view kBlanks = " \t\r\n";
    const size_t begin = rest_.find_first_not_of(kBlanks);
    if (begin == std::string_view::npos) return false;
    rest_.remove_prefix(begin);
    const size_t end = std::min(rest_.find_first_of(kBlanks), rest_.size());
    // from_chars accepts "nan" and "inf"; ValidateMesh rejects them with a better message.
    const auto [parsed, error] = std::from_chars(rest_.data(), rest_.data() + end, *value);
    const bool ok = error == std::errc() && parsed == rest_.data() + end;
    rest_.remove_prefix(end);
    return ok;
  }

  template <class T>
  bool NextAs(double* value) {
    std::array<char, sizeof(T)> bytes;
    if (rest_.size() < sizeof(T)) return false;
    std::memcpy(bytes.data(), rest_.data(), sizeof(T));
    rest_.remove_prefix(sizeof(T));
    const bool swap = (layout_ == Layout::kBigEndian) == (std::endian::native == std::endian::little);
    if (swap) std::reverse(bytes.begin(), bytes.end());
    *value = static_cast<double>(std::bit_cast<T>(bytes));
    return true;
  }

  bool NextBinary(Scalar type, double* value) {
    switch (type) {
      case Scalar::kInt8:
        return NextAs<int8_t>(value);
      case Scalar::kUint8:
        return NextAs<uint8_t>(value);
      case Scalar::kInt16:
        return NextAs<int16_t>(value);
      case Scalar::kUint16:
        return NextAs<uint16_t>(value);
      case Scalar::kInt32:
        return NextAs<int32_t>(value);
      case Scalar::kUint32:
        return NextAs<uint32_t>(value);
      case Scalar::kFloat:
        return NextAs<float>(value);
      case Scalar::kDouble:
        return NextAs<double>(value);
    }
    return false;
  }

  std::string_view rest_;
  Layout layout_;
};

bool IsIndex(double value) { return value >= 0 && value <= UINT32_MAX && value == std::floor(value); }

// Reads one list into `polygon`. Values that are not vertex indices become UINT32_MAX. False if the data is truncated
// or malformed.
bool ReadList(const Property& property, Body* body, std::vector<uint32_t>* polygon) {
  polygon->clear();
  double count = 0;
  if (!body->Next(*property.count_type, &count) || !IsIndex(count)) return false;
  for (size_t k = 0; k < static_cast<size_t>(count); ++k) {
    double value = 0;
    if (!body->Next(property.type, &value)) return false;
    polygon->push_back(IsIndex(value) ? static_cast<uint32_t>(value) : UINT32_MAX);
  }
  return true;
}

using Columns = std::map<std::string, std::vector<double>>;

// Reads all rows of an element: scalars by name, and the polygons of `vertex_indices`. False if the data is truncated
// or malformed.
bool ReadElement(const Element& element, Body* body, Columns* columns,
                 std::vector<std::array<uint32_t, 3>>* triangles) {
  if (!body->CanHold(element.count, element.properties)) return false;
  std::vector<std::vector<double>*> targets;
  for (const Property& property : element.properties) {
    targets.push_back(property.count_type ? nullptr : &(*columns)[property.name]);
    if (targets.back() != nullptr) targets.back()->reserve(element.count);
  }
  std::vector<uint32_t> polygon;
  for (size_t row = 0; row < element.count && !element.properties.empty(); ++row) {
    for (size_t k = 0; k < targets.size(); ++k) {
      const Property& property = element.properties[k];
      double value = 0;
      if (targets[k] == nullptr) {
        if (!ReadList(property, body, &polygon)) return false;
        if (property.name == "vertex_indices" || property.name == "vertex_index") AppendFan(polygon, triangles);
      } else {
        if (!body->Next(property.type, &value)) return false;
        targets[k]->push_back(value);
      }
    }
  }
  return true;
}

// Moves three columns from `columns` to `taken`. False, without changes, if one is missing.
bool TakeColumns(const std::array<const char*, 3>& names, Columns* columns, std::array<std::vector<double>, 3>* taken) {
  for (const char* name : names) {
    if (!columns->contains(name)) return false;
  }
  for (int k = 0; k < 3; ++k) (*taken)[k] = std::move(columns->extract(names[k]).mapped());
  return true;
}

std::vector<Eigen::Vector3f> ToVectors(const std::array<std::vector<double>, 3>& columns) {
  std::vector<Eigen::Vector3f> vectors(columns[0].size());
  for (size_t k = 0; k < vectors.size(); ++k) {
    vectors[k] = Eigen::Vector3d(columns[0][k], columns[1][k], columns[2][k]).cast<float>();
  }
  return vectors;
}

Rgb8 ToColor(double red, double green, double blue) {
  const auto byte = [](double value) { return static_cast<uint8_t>(value > 0 ? std::fmin(value, 255.0) : 0); };
  return {byte(red), byte(green), byte(blue)};
}

}  // namespace

absl::StatusOr<MeshFile> ParsePly(std::string_view bytes, const std::string& name) {
  ROMAP_ASSIGN_OR_RETURN(const PlyHeader header, ParseHeader(bytes, name));
  Body body(bytes.substr(header.body_offset), header.layout);
  MeshFile file;
  for (const Element& element : header.elements) {
    Columns columns;
    std::vector<std::array<uint32_t, 3>> triangles;
    if (!ReadElement(element, &body, &columns, &triangles)) {
      return InvalidArgument("{}: element '{}' ({} rows declared) is truncated or malformed", name, element.name,
                             element.count);
    }
    if (element.name == "face") file.mesh.triangles = std::move(triangles);
    if (element.name != "vertex") continue;
    std::array<std::vector<double>, 3> taken;
    if (!TakeColumns({"x", "y", "z"}, &columns, &taken)) return InvalidArgument("{}: vertices lack x, y or z", name);
    SetPositions(taken, &file);
    if (TakeColumns({"nx", "ny", "nz"}, &columns, &taken)) file.mesh.normals = ToVectors(taken);
    if (TakeColumns({"red", "green", "blue"}, &columns, &taken)) {
      for (size_t k = 0; k < taken[0].size(); ++k) {
        file.mesh.colors.push_back(ToColor(taken[0][k], taken[1][k], taken[2][k]));
      }
    }
    file.scalars = std::move(columns);
  }
  ROMAP_RETURN_IF_ERROR(ValidateMesh(file.mesh, name));
  return file;
}

absl::StatusOr<MeshFile> ReadPly(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  return ParsePly(bytes, path);
}

}  // namespace romap::files
