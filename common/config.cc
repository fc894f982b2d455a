#include "common/config.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>

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

const ConfigField* Find(const std::string& name, const std::vector<ConfigField>& fields) {
  const auto it = std::find_if(fields.begin(), fields.end(), [&](const ConfigField& f) { return f.name == name; });
  return it == fields.end() ? nullptr : &*it;
}

std::string RangeText(const FieldInfo& info) {
  if (!info.choices.empty()) return fmt::format("one of {}", fmt::join(info.choices, ", "));
  const bool low = info.min > -1e299, high = info.max < 1e299;
  if (low && high) return fmt::format("{} to {}", info.min, info.max);
  if (low) return fmt::format("at least {}", info.min);
  if (high) return fmt::format("at most {}", info.max);
  return "";
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
  *target = value;
  return "";
}

// Puts the value into the field; returns what is wrong with it, or "".
std::string Store(const ConfigField& field, const std::string& text) {
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

// Reads the entries of a section whose fields set others, or those whose do not.
void LoadEntries(const std::string& section, const YAML::Node& entries, const std::string& origin, bool setters,
                 const std::vector<ConfigField>& fields, std::vector<std::string>& faults) {
  for (const auto& entry : entries) {
    const std::string name = section + "." + entry.first.as<std::string>("");
    const int line = entry.first.Mark().line + 1;
    const ConfigField* field = Find(name, fields);
    if ((field != nullptr && field->info.on_set) != setters) continue;
    if (field == nullptr) {
      faults.push_back(
          fmt::format("{}:{}: unknown key '{}', did you mean '{}'?", origin, line, name, Nearest(name, fields)));
    } else if (!entry.second.IsScalar()) {
      faults.push_back(fmt::format("{}:{}: {} must be a single value", origin, line, name));
    } else if (const std::string fault = Store(*field, entry.second.Scalar()); !fault.empty()) {
      faults.push_back(fmt::format("{}:{}: {}", origin, line, fault));
    }
  }
}

absl::Status FromFaults(const std::vector<std::string>& faults) {
  if (faults.empty()) return absl::OkStatus();
  return InvalidArgument("{}", fmt::join(faults, "; "));
}

}  // namespace

void ConfigFields::Add(const std::string& name, FieldPointer value, FieldInfo info) {
  fields_.push_back({section_.empty() ? name : section_ + "." + name, value, std::move(info)});
}

absl::Status ConfigFields::LoadYaml(const std::string& text, const std::string& origin) {
  YAML::Node root;
  try {
    root = YAML::Load(text);
  } catch (const YAML::Exception& e) {
    return InvalidArgument("{}:{}: {}", origin, e.mark.line + 1, e.msg);
  }
  if (root.IsNull()) return absl::OkStatus();
  if (!root.IsMap()) return InvalidArgument("{}: expected sections such as 'mesh:' with fields below them", origin);

  std::vector<std::string> faults;
  for (const auto& section : root) {
    const auto section_name = section.first.as<std::string>("");
    const int section_line = section.first.Mark().line + 1;
    if (!section.second.IsMap()) {
      if (section.second.IsNull()) continue;
      faults.push_back(
          fmt::format("{}:{}: '{}' must be a section with fields below it", origin, section_line, section_name));
      continue;
    }
    for (const bool setters : {true, false})
      LoadEntries(section_name, section.second, origin, setters, fields_, faults);
  }
  return FromFaults(faults);
}

absl::Status ConfigFields::Set(std::span<const std::string> assignments) {
  std::vector<std::string> faults;
  for (const std::string& assignment : assignments) {
    const size_t equals = assignment.find('=');
    if (equals == std::string::npos) {
      faults.push_back(fmt::format("--set {}: expected section.field=value", assignment));
      continue;
    }
    const std::string name = assignment.substr(0, equals);
    const ConfigField* field = Find(name, fields_);
    if (field == nullptr) {
      faults.push_back(fmt::format("--set: unknown key '{}', did you mean '{}'?", name, Nearest(name, fields_)));
    } else if (const std::string fault = Store(*field, assignment.substr(equals + 1)); !fault.empty()) {
      faults.push_back("--set " + fault);
    }
  }
  return FromFaults(faults);
}

std::string ConfigFields::DumpYaml() const {
  std::ostringstream out;
  std::string section;
  for (const ConfigField& field : fields_) {
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
