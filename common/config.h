#pragma once

#include <absl/status/status.h>

#include <functional>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace romap {

// Configuration: each stage has one struct with its defaults, and one list of its fields that drives YAML, --set, the
// dump, the documentation and the checks:
//
//   struct MeshConfig {
//     int resolution = 64;
//     void Fields(ConfigFields& fields) {
//       fields.Add("resolution", &resolution, {.unit = "cells", .min = 8, .max = 512, .help = "Grid per box side"});
//     }
//   };
struct FieldInfo {
  std::string unit = {};  // "" for a pure number
  double min = -1e300;
  double max = 1e300;
  std::vector<std::string> choices = {};  // for strings; empty = any
  std::string help = {};
  // For strings that stand for values of other fields: called with the value once it is stored.
  std::function<void(const std::string& value)> on_set = {};
};

using FieldPointer = std::variant<bool*, int*, double*, std::string*>;

struct ConfigField {
  std::string name;  // with its section: "mesh.resolution"
  FieldPointer value;
  FieldInfo info;
};

// Collects the fields of all stages. The pointers live as long as the structs they point into.
class ConfigFields {
 public:
  // Fields added until the next call belong to this section.
  void Section(const std::string& name) { section_ = name; }
  void Add(const std::string& name, FieldPointer value, FieldInfo info);

  // Reads YAML of the form `section: {field: value}` into the fields. All faults are reported together, each with
  // `origin` and line: unknown key (with the nearest known one), wrong type, out of range. A field that sets others
  // goes before the other fields of its section, wherever it stands: what is given explicitly holds.
  absl::Status LoadYaml(const std::string& text, const std::string& origin);
  // Applies assignments of the form "mesh.resolution=96" in their order; all faults together.
  absl::Status Set(std::span<const std::string> assignments);
  // The effective configuration as YAML, each field with its unit, range and help as a comment.
  std::string DumpYaml() const;

  const std::vector<ConfigField>& fields() const { return fields_; }

 private:
  std::string section_;
  std::vector<ConfigField> fields_;
};

}  // namespace romap
