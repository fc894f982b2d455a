#include "common/config.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numeric>
#include <sstream>
#include <type_traits>

#include "common/file_status.h"
#include "common/printable.h"
#include "common/status.h"

namespace romap {
namespace {

size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] != b[j - 1])});
      diagonal = above;
    }
  }
  return row[b.size()];
}

std::string Nearest(const std::string& name, const std::vector<ConfigField>& fields) {
  const auto best = std::min_element(fields.begin(), fields.end(), [&](const ConfigField& a, const ConfigField& b) {
    return EditDistance(name, a.name) < EditDistance(name, b.name);
  });
  return best == fields.end() ? "" : best->name;
}

ConfigField* Find(const std::string& name, std::vector<ConfigField>& fields) {
  const auto it = std::find_if(fields.begin(), fields.end(), [&](const ConfigField& f) { return f.name == name; });
  return it == fields.end() ? nullptr : &*it;
}

std::string RangeText(const FieldInfo& info) {
  if (!info.choices.empty()) return fmt::format("one of {}", fmt::join(info.choices, ", "));
  const bool low = info.min > -1e299, high = info.max < 1e299;
  std::string range;
  if (low && high) {
    range = fmt::format("{} to {}", info.min, info.max);
  } else if (low) {
    range = fmt::format("at least {}", info.min);
  } else if (high) {
    range = fmt::format("at most {}", info.max);
  }
  if (info.multiple_of > 1) range += fmt::format("{}multiple of {}", range.empty() ? "" : ", ", info.multiple_of);
  return range;
}

template <class T>
std::string StoreNumber(const ConfigField& field, T* target, const std::string& text, const char* kind) {
  T value{};
  try {
    value = YAML::Node(text).as<T>();
  } catch (const YAML::Exception&) {
    return fmt::format("{}: '{}' is not {}", field.name, text, kind);
  }
  const double number = static_cast<double>(value);
  if (!(number >= field.info.min && number <= field.info.max)) {
    return fmt::format("{}: {} is out of range ({}{}{})", field.name, text, RangeText(field.info),
                       field.info.unit.empty() ? "" : " ", field.info.unit);
  }
  if constexpr (std::is_same_v<T, int>) {
    if (value % field.info.multiple_of != 0) {
      return fmt::format("{}: {} is not a multiple of {}", field.name, text, field.info.multiple_of);
    }
  }
  *target = value;
  return "";
}

// Stores the value in the field. Returns the error message if the value is invalid, otherwise "".
std::string StoreValue(const ConfigField& field, const std::string& text) {
  struct Visitor {
    const ConfigField& field;
    const std::string& text;
    std::string operator()(int* target) const { return StoreNumber(field, target, text, "a whole number"); }
    std::string operator()(double* target) const { return StoreNumber(field, target, text, "a number"); }
    std::string operator()(bool* target) const {
      try {
        *target = YAML::Node(text).as<bool>();
        return "";
      } catch (const YAML::Exception&) {
        return fmt::format("{}: '{}' is neither true nor false", field.name, text);
      }
    }
    std::string operator()(std::string* target) const {
      if (Printable(text) != text) {
        return fmt::format("{}: '{}' has control characters or is not UTF-8", field.name, Printable(text));
      }
      const auto& choices = field.info.choices;
      if (!choices.empty() && std::find(choices.begin(), choices.end(), text) == choices.end()) {
        return fmt::format("{}: '{}' is not {}", field.name, text, RangeText(field.info));
      }
      *target = text;
      if (field.info.on_set) field.info.on_set(text);
      return "";
    }
  };
  return std::visit(Visitor{field, text}, field.value);
}

std::string Store(const std::string& text, const std::string& origin, ConfigField& field) {
  std::string fault = StoreValue(field, text);
  field.origin = origin;
  field.is_invalid = !fault.empty();
  return fault;
}

std::string ValueText(const FieldPointer& pointer) {
  struct Visitor {
    std::string operator()(const bool* v) const { return *v ? "true" : "false"; }
    std::string operator()(const int* v) const { return fmt::format("{}", *v); }
    std::string operator()(const double* v) const { return fmt::format("{}", *v); }
    std::string operator()(const std::string* v) const {
      YAML::Emitter out;
      out << YAML::DoubleQuoted << *v;
      return out.c_str();
    }
  };
  return std::visit([](auto* v) { return Visitor{}(v); }, pointer);
}

// Reads the entries of a section: with `setters` those of fields that set other fields, otherwise all others.
void LoadEntries(const std::string& section, const YAML::Node& entries, const std::string& origin, bool setters,
                 std::vector<ConfigField>& fields, std::vector<std::string>& faults) {
  for (const auto& entry : entries) {
    const std::string name = section + "." + entry.first.as<std::string>("");
    const int line = entry.first.Mark().line + 1;
    ConfigField* field = Find(name, fields);
    if ((field != nullptr && field->info.on_set) != setters) continue;
    if (field == nullptr) {
      faults.push_back(
          fmt::format("{}:{}: unknown key '{}', did you mean '{}'?", origin, line, name, Nearest(name, fields)));
    } else if (!entry.second.IsScalar()) {
      field->is_invalid = true;
      faults.push_back(fmt::format("{}:{}: {} must be a single value", origin, line, name));
    } else if (const std::string fault = Store(entry.second.Scalar(), fmt::format("{}:{}", origin, line), *field);
               !fault.empty()) {
      faults.push_back(fmt::format("{}:{}: {}", origin, line, fault));
    }
  }
}

absl::Status FromFaults(const std::vector<std::string>& faults) {
  if (faults.empty()) return absl::OkStatus();
  return InvalidArgument("{}", fmt::join(faults, "; "));
}

absl::StatusOr<std::string> ReadTextFile(const std::string& path) {
  // Opening a folder succeeds, and reading from it throws.
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) return FileError(path, "read", EISDIR);
  errno = 0;
  std::ifstream file(path);
  std::string text;
  if (file) text.assign(std::istreambuf_iterator<char>(file), {});
  if (!file) return FileError(path, "read");
  return text;
}

const void* AddressOf(const FieldPointer& pointer) {
  return std::visit([](auto* value) { return static_cast<const void*>(value); }, pointer);
}

const ConfigField* FindByAddress(const void* address, const std::vector<ConfigField>& fields) {
  const auto it = std::find_if(fields.begin(), fields.end(),
                               [&](const ConfigField& field) { return AddressOf(field.value) == address; });
  return it == fields.end() ? nullptr : &*it;
}

std::string SettingText(const ConfigField& field) {
  const auto* text = std::get_if<std::string*>(&field.value);
  return fmt::format("{} = {}", field.name, text != nullptr ? **text : ValueText(field.value));
}

}  // namespace

void ConfigRules::RequireAtMost(const int* low, const int* high) { Forbid(*low > *high, low, "must not exceed", high); }

void ConfigRules::RequireAtMost(const double* low, const double* high) {
  Forbid(*low > *high, low, "must not exceed", high);
}

void ConfigRules::Forbid(bool is_fault, ConstFieldPointer first, std::string_view relation, ConstFieldPointer second,
                         std::string_view advice) {
  const auto address = [](ConstFieldPointer pointer) {
    return std::visit([](auto* value) { return static_cast<const void*>(value); }, pointer);
  };
  const ConfigField* a = FindByAddress(address(first), fields_.fields());
  const ConfigField* b = FindByAddress(address(second), fields_.fields());
  if (!is_fault || a == nullptr || b == nullptr || a->is_invalid || b->is_invalid) return;
  const std::string& origin = a->origin.empty() ? b->origin : a->origin;
  std::string fault = origin.empty() ? "" : origin + ": ";
  fault += fmt::format("{} {} {}", SettingText(*a), relation, SettingText(*b));
  if (!b->origin.empty() && b->origin != origin) fault += fmt::format(" ({})", b->origin);
  if (!advice.empty()) fault += fmt::format("; {}", advice);
  faults_.push_back(std::move(fault));
}

void ConfigFields::Add(const std::string& name, FieldPointer value, FieldInfo info) {
  fields_.push_back({section_.empty() ? name : section_ + "." + name, value, std::move(info)});
}

absl::Status ConfigFields::Load(const std::string& path, std::span<const std::string> assignments) {
  Faults faults;
  if (!path.empty()) {
    ROMAP_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(path));
    LoadYaml(text, path, faults);
  }
  Set(assignments, faults);
  Validate(faults);
  return FromFaults(faults);
}

absl::Status ConfigFields::LoadYaml(const std::string& text, const std::string& origin) {
  Faults faults;
  LoadYaml(text, origin, faults);
  return FromFaults(faults);
}

absl::Status ConfigFields::Set(std::span<const std::string> assignments) {
  Faults faults;
  Set(assignments, faults);
  return FromFaults(faults);
}

absl::Status ConfigFields::Validate() const {
  Faults faults;
  Validate(faults);
  return FromFaults(faults);
}

void ConfigFields::LoadYaml(const std::string& text, const std::string& origin, Faults& faults) {
  YAML::Node root;
  try {
    root = YAML::Load(text);
  } catch (const YAML::Exception& e) {
    faults.push_back(fmt::format("{}:{}: {}", origin, e.mark.line + 1, e.msg));
    return;
  }
  if (root.IsNull()) return;
  if (!root.IsMap()) {
    faults.push_back(fmt::format("{}: expected sections such as 'mesh:' with fields below them", origin));
    return;
  }
  for (const auto& section : root) {
    const auto section_name = section.first.as<std::string>("");
    const int section_line = section.first.Mark().line + 1;
    if (std::find(ignored_sections_.begin(), ignored_sections_.end(), section_name) != ignored_sections_.end())
      continue;
    if (!section.second.IsMap()) {
      if (section.second.IsNull()) continue;
      faults.push_back(
          fmt::format("{}:{}: '{}' must be a section with fields below it", origin, section_line, section_name));
      continue;
    }
    for (const bool setters : {true, false})
      LoadEntries(section_name, section.second, origin, setters, fields_, faults);
  }
}

void ConfigFields::Set(std::span<const std::string> assignments, Faults& faults) {
  for (const std::string& assignment : assignments) {
    const size_t equals = assignment.find('=');
    if (equals == std::string::npos) {
      faults.push_back(fmt::format("--set {}: expected section.field=value", assignment));
      continue;
    }
    const std::string name = assignment.substr(0, equals);
    ConfigField* field = Find(name, fields_);
    if (field == nullptr) {
      faults.push_back(fmt::format("--set: unknown key '{}', did you mean '{}'?", name, Nearest(name, fields_)));
    } else if (const std::string fault = Store(assignment.substr(equals + 1), "--set", *field); !fault.empty()) {
      faults.push_back("--set " + fault);
    }
  }
}

void ConfigFields::Validate(Faults& faults) const {
  ConfigRules rules(*this);
  for (const auto& add_faults : rules_) add_faults(rules);
  faults.insert(faults.end(), rules.faults().begin(), rules.faults().end());
}

std::string ConfigFields::DumpYaml(Audience audience) const {
  std::ostringstream out;
  std::string section;
  for (const ConfigField& field : fields_) {
    const bool is_set = !field.origin.empty();
    if (audience == Audience::kOperator && field.info.audience != Audience::kOperator && !is_set) continue;
    const size_t dot = field.name.find('.');
    const std::string field_section = dot == std::string::npos ? "" : field.name.substr(0, dot);
    if (field_section != section) {
      if (!section.empty()) out << '\n';
      out << field_section << ":\n";
      section = field_section;
    }
    std::string facts = field.info.unit;
    if (const std::string range = RangeText(field.info); !range.empty()) facts += (facts.empty() ? "" : ", ") + range;
    out << "  # " << field.info.help << (facts.empty() ? "" : " [" + facts + "]") << '\n';
    out << "  " << field.name.substr(dot + 1) << ": " << ValueText(field.value) << '\n';
  }
  return out.str();
}

}  // namespace romap
