#include "client/files/csv.h"

#include <algorithm>
#include <string_view>

#include "client/files/text_file.h"

namespace romap::files {
namespace {

constexpr std::string_view kCsvBlanks = " \t";

// Of the first row. A comma in it is a separator, whatever else it contains.
char SeparatorOf(std::string_view text) {
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    const bool is_row = !line.starts_with('#') && line.find_first_not_of(" \t\r") != std::string_view::npos;
    for (const char separator : {',', ';', '\t'}) {
      if (is_row && line.find(separator) != std::string_view::npos) return separator;
    }
    text.remove_prefix(std::min(line.size() + 1, text.size()));
  }
  return ',';
}

class CsvParser {
 public:
  CsvParser(std::string_view text, const std::string& path)
      : text_(text), path_(path), separator_(SeparatorOf(text)), field_end_{separator_, '\n'} {}

  absl::StatusOr<std::vector<CsvRow>> Parse() {
    std::vector<CsvRow> rows;
    while (!text_.empty()) {
      if (text_.starts_with('#') || LineIsEmpty()) {
        SkipLine();
        continue;
      }
      CsvRow row{line_, {}};
      do {
        ROMAP_ASSIGN_OR_RETURN(std::string field, ParseField());
        row.fields.push_back(std::move(field));
      } while (Skip(std::string_view(&separator_, 1)));
      if (!Skip("\r\n")) Skip("\n");
      ++line_;
      rows.push_back(std::move(row));
    }
    return rows;
  }

 private:
  bool LineIsEmpty() const {
    return text_.substr(0, text_.find('\n')).find_first_not_of(" \t\r") == std::string_view::npos;
  }

  void SkipLine() {
    const size_t end = text_.find('\n');
    text_.remove_prefix(end == std::string_view::npos ? text_.size() : end + 1);
    ++line_;
  }

  bool Skip(std::string_view token) {
    if (!text_.starts_with(token)) return false;
    text_.remove_prefix(token.size());
    return true;
  }

  // A tab may separate fields.
  void SkipBlanks() {
    while (!text_.empty() && kCsvBlanks.find(text_[0]) != std::string_view::npos && text_[0] != separator_) {
      text_.remove_prefix(1);
    }
  }

  absl::StatusOr<std::string> ParseField() {
    SkipBlanks();
    if (Skip("\"")) return ParseQuoted();
    std::string_view field = text_.substr(0, text_.find_first_of(field_end_));
    text_.remove_prefix(field.size());
    if (field.ends_with('\r') && !text_.starts_with(separator_)) field.remove_suffix(1);
    return std::string(field.substr(0, field.find_last_not_of(kCsvBlanks) + 1));
  }

  // The rest of a quoted field, after its opening quote.
  absl::StatusOr<std::string> ParseQuoted() {
    const int first_line = line_;
    std::string field;
    while (true) {
      const size_t quote = text_.find('"');
      if (quote == std::string_view::npos) {
        return InvalidArgument("{}:{}: the double quote that opens here has no end; expected \"...\"", path_,
                               first_line);
      }
      const std::string_view part = text_.substr(0, quote);
      line_ += static_cast<int>(std::count(part.begin(), part.end(), '\n'));
      field += part;
      text_.remove_prefix(quote + 1);
      if (!Skip("\"")) break;
      field += '"';
    }
    SkipBlanks();
    if (!text_.empty() && !text_.starts_with(separator_) && !text_.starts_with('\n') && !text_.starts_with("\r\n") &&
        text_ != "\r") {
      return InvalidArgument(
          "{}:{}: text follows a closing double quote; expected a separator (a quote inside of a quoted "
          "field is doubled)",
          path_, line_);
    }
    return field;
  }

  std::string_view text_;  // the rest of the file
  const std::string& path_;
  const char separator_;
  const std::string field_end_;
  int line_ = 1;
};

}  // namespace

absl::StatusOr<std::vector<CsvRow>> ReadCsv(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(path));
  return CsvParser(text, path).Parse();
}

}  // namespace romap::files
