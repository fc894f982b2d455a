#pragma once

#include <absl/status/status.h>

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace romap {

// Configuration: each stage has one struct that holds its settings with their defaults. Fields() lists them for YAML,
// --set, the dump and the range checks; Validate() reports faults in combinations of settings:
//
//   struct MeshConfig {
//     int resolution = 64;
//     int min_side_nodes = 48;
//
//     void Fields(ConfigFields& fields) {
//       fields.Add("resolution", &resolution, {.unit = "nodes", .min = 8, .max = 256, .help = "Nodes per box side"});
//       fields.Add("min_side_nodes", ...);
//       fields.AddRules([this](ConfigRules& rules) { Validate(rules); });
//     }
//     void Validate(ConfigRules& rules) const { rules.RequireAtMost(&min_side_nodes, &resolution); }
//   };

// Who sets a field: an operator, for a machine and its clients, or an expert, for experiments.
enum class Audience { kExpert, kOperator };

struct FieldInfo {
  std::string unit = {};  // empty for a pure number
  double min = -1e300;
  double max = 1e300;
  int multiple_of = 1;                    // for whole numbers
  std::vector<std::string> choices = {};  // for strings; empty: any
  Audience audience = Audience::kExpert;
  std::string help = {};
  // For a field that sets other fields, such as a preset: called with the value after it is stored.
  std::function<void(const std::string& value)> on_set = {};
};

using FieldPointer = std::variant<bool*, int*, double*, std::string*>;
using ConstFieldPointer = std::variant<const bool*, const int*, const double*, const std::string*>;

struct ConfigField {
  std::string name;  // with its section: "mesh.resolution"
  FieldPointer value;
  FieldInfo info;
  std::string origin = {};  // "server.yaml:12" or "--set" if it was set, also to an invalid value
  bool is_invalid = false;  // the last value given for it was rejected
};

class ConfigFields;

// Collects the faults in combinations of settings. Settings are named by the addresses of their values.
class ConfigRules {
 public:
  explicit ConfigRules(const ConfigFields& fields) : fields_(fields) {}

  // Reports a fault if `low` exceeds `high`.
  void RequireAtMost(const int* low, const int* high);
  void RequireAtMost(const double* low, const double* high);
  // Reports "first = value relation second = value; advice" if `is_fault`, for example
  // "nerf.backend = cuda does not support nerf.field = sdf; use density".
  void Forbid(bool is_fault, ConstFieldPointer first, std::string_view relation, ConstFieldPointer second,
              std::string_view advice = {});

  const std::vector<std::string>& faults() const { return faults_; }

 private:
  const ConfigFields& fields_;
  std::vector<std::string> faults_;
};

// The fields of all stages. Pointers and rules are valid as long as the structs they refer to.
class ConfigFields {
 public:
  // Fields added until the next call belong to this section.
  void Section(const std::string& name) { section_ = name; }
  void Add(const std::string& name, FieldPointer value, FieldInfo info);
  void AddRules(std::function<void(ConfigRules&)> rules) { rules_.push_back(std::move(rules)); }
  // A section of YAML files that another program reads; its fields are not checked.
  void IgnoreSection(const std::string& name) { ignored_sections_.push_back(name); }

  // Reads the YAML file at `path` (none if empty), applies `assignments` of the form "mesh.resolution=96" in their
  // order, and checks the rules. All faults are reported together as INVALID_ARGUMENT, those of the file with its path
  // and line: an unknown key (with the nearest known one), a wrong type, a value out of range, a forbidden combination.
  // If the file cannot be read, the status is that of FileError().
  absl::Status Load(const std::string& path, std::span<const std::string> assignments);

  // The parts of Load(). The YAML has the form `section: {field: value}`. A field that sets others is applied before
  // the other fields of its section, independent of their order in the file, so that explicit values take precedence.
  absl::Status LoadYaml(const std::string& text, const std::string& origin);
  absl::Status Set(std::span<const std::string> assignments);
  absl::Status Validate() const;

  // The effective configuration as YAML, each field with its unit, range and help as a comment. kOperator: the settings
  // for operators, and all others that were set explicitly. Reading it back gives the same configuration.
  std::string DumpYaml(Audience audience = Audience::kExpert) const;

  const std::vector<ConfigField>& fields() const { return fields_; }

 private:
  using Faults = std::vector<std::string>;

  void LoadYaml(const std::string& text, const std::string& origin, Faults& faults);
  void Set(std::span<const std::string> assignments, Faults& faults);
  void Validate(Faults& faults) const;

  std::string section_;
  std::vector<ConfigField> fields_;
  std::vector<std::function<void(ConfigRules&)>> rules_;
  std::vector<std::string> ignored_sections_;
};

}  // namespace romap
