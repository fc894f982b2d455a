#include "client/files/detections.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "client/files/associate.h"
#include "client/files/csv.h"
#include "client/files/text_file.h"
#include "common/utf8.h"

namespace romap::files {
namespace {

// Rounding may make a score slightly larger than 1.
constexpr double kMaxFraction = 1.001;

bool IsHeader(const CsvRow& row) {
  return row.fields.size() > 1 && !ParseNumber(row.fields[0]) && !ParseNumber(row.fields[1]);
}

// The score is not yet scaled.
absl::StatusOr<Instance> ParseDetection(const CsvRow& row, const std::string& path) {
  const std::vector<std::string>& fields = row.fields;
  if (fields.size() != 3 && fields.size() != 4) {
    return InvalidArgument(
        "{}:{}: {} fields; expected timestamp,label,class[,score] (a class name with a comma needs double quotes)",
        path, row.line, fields.size());
  }
  const std::optional<double> label = ParseNumber(fields[1]);
  if (!label || *label < 1 || *label > 65535 || *label != std::floor(*label)) {
    return InvalidArgument("{}:{}: label '{}' must be an integer from 1 to 65535", path, row.line, fields[1]);
  }
  if (!IsUtf8(fields[2])) return InvalidArgument("{}:{}: class name is not valid UTF-8", path, row.line);
  const std::optional<double> score = fields.size() == 4 ? ParseNumber(fields[3]) : std::optional(1.0);
  if (!score || *score < 0 || *score > 100) {
    return InvalidArgument("{}:{}: score '{}' must be a number from 0 to 1, or from 0 to 100 in the whole file", path,
                           row.line, fields[3]);
  }
  return Instance{.label = static_cast<uint32_t>(*label), .class_name = fields[2], .score = *score, .track_id = {}};
}

void ScaleScores(DetectionFile& file) {
  double largest = 0;
  for (const DetectionSet& set : file.sets) {
    for (const Instance& instance : set.instances) largest = std::max(largest, instance.score);
  }
  file.scores_in_percent = largest > kMaxFraction;
  for (DetectionSet& set : file.sets) {
    for (Instance& instance : set.instances) {
      instance.score = file.scores_in_percent ? instance.score / 100 : std::min(instance.score, 1.0);
    }
  }
}

int64_t Resolution_ns(const std::vector<DetectionSet>& sets) {
  int64_t resolution_ns = 1'000'000'000;
  for (const DetectionSet& set : sets) {
    while (set.timestamp_ns % resolution_ns != 0) resolution_ns /= 10;
  }
  return resolution_ns;
}

// Builds the set of one timestamp after the other.
class SetBuilder {
 public:
  SetBuilder(const std::string& path, DetectionFile* file) : path_(path), file_(file) {}

  absl::Status Add(const CsvRow& row, int64_t timestamp_ns, Instance instance) {
    std::vector<DetectionSet>& sets = file_->sets;
    if (sets.empty() || sets.back().timestamp_ns != timestamp_ns) {
      sets.push_back({timestamp_ns, row.line, 0, {}});
      repetitions_.clear();
    }
    DetectionSet& set = sets.back();
    ++set.rows;
    Repetition& earlier = repetitions_[instance.label];
    if (++earlier.count == 1) {
      earlier.line = row.line;
      earlier.index = set.instances.size();
      set.instances.push_back(std::move(instance));
      return absl::OkStatus();
    }
    Instance& known = set.instances[earlier.index];
    if (known.class_name != instance.class_name) {
      return InvalidArgument(
          "{}:{}: label {} is '{}' here and '{}' in line {}, both at timestamp {}; each label of a frame has one row, "
          "and each frame needs a timestamp of its own: write the timestamps of the masks with all their decimals",
          path_, row.line, instance.label, instance.class_name, known.class_name, earlier.line, row.fields[0]);
    }
    file_->timestamps_repeat = true;
    known.score += (instance.score - known.score) / earlier.count;
    return absl::OkStatus();
  }

 private:
  struct Repetition {
    int count = 0;
    int line = 0;  // of the first row
    size_t index = 0;
  };

  const std::string& path_;
  DetectionFile* const file_;
  std::map<uint32_t, Repetition> repetitions_;  // by label, at the current timestamp
};

std::vector<int64_t> MatchNearest(const DetectionFile& file, std::span<const int64_t> mask_times_ns,
                                  int64_t max_dt_ns) {
  const std::vector<DetectionSet>& sets = file.sets;
  std::vector<int64_t> match(mask_times_ns.size(), -1);
  for (size_t k = 0; k < match.size(); ++k) {
    const int64_t time_ns = mask_times_ns[k];
    const auto distance_ns = [&](auto it) { return std::abs(it->timestamp_ns - time_ns); };
    auto nearest = std::ranges::lower_bound(sets, time_ns, {}, &DetectionSet::timestamp_ns);
    if (nearest == sets.end() || (nearest != sets.begin() && distance_ns(nearest - 1) < distance_ns(nearest))) {
      --nearest;
    }
    if (distance_ns(nearest) <= std::max(max_dt_ns, file.resolution_ns / 2)) match[k] = nearest - sets.begin();
  }
  return match;
}

}  // namespace

absl::StatusOr<DetectionFile> ReadDetections(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(std::vector<CsvRow> rows, ReadCsv(path));
  if (!rows.empty() && IsHeader(rows.front())) rows.erase(rows.begin());
  std::vector<std::string> timestamps;
  for (const CsvRow& row : rows) timestamps.push_back(row.fields[0]);
  DetectionFile file;
  file.unit = DetectTimeUnit(timestamps);
  SetBuilder builder(path, &file);
  for (const CsvRow& row : rows) {
    const std::optional<int64_t> timestamp_ns = ParseTimestamp(row.fields[0], file.unit);
    if (!timestamp_ns) return InvalidArgument("{}:{}: '{}' is not a timestamp", path, row.line, row.fields[0]);
    ROMAP_ASSIGN_OR_RETURN(Instance instance, ParseDetection(row, path));
    if (!file.sets.empty() && *timestamp_ns < file.sets.back().timestamp_ns) {
      return InvalidArgument("{}:{}: timestamps must not decrease; got {} after {}", path, row.line, row.fields[0],
                             FormatSeconds(file.sets.back().timestamp_ns));
    }
    ROMAP_RETURN_IF_ERROR(builder.Add(row, *timestamp_ns, std::move(instance)));
  }
  ScaleScores(file);
  file.resolution_ns = Resolution_ns(file.sets);
  return file;
}

std::vector<int64_t> MatchDetections(const DetectionFile& file, std::span<const int64_t> mask_times_ns,
                                     int64_t max_dt_ns) {
  if (file.timestamps_repeat) return MatchNearest(file, mask_times_ns, max_dt_ns);
  // One of several masks within the rounding would be chosen by chance.
  max_dt_ns = std::max(max_dt_ns, std::min(file.resolution_ns, MedianStep_ns(mask_times_ns)) / 2);
  std::vector<int64_t> set_times_ns;
  for (const DetectionSet& set : file.sets) set_times_ns.push_back(set.timestamp_ns);
  std::vector<int64_t> match(mask_times_ns.size(), -1);
  for (const auto& [mask, set] : AssociateTimestamps(mask_times_ns, set_times_ns, max_dt_ns)) {
    match[mask] = static_cast<int64_t>(set);
  }
  return match;
}

}  // namespace romap::files
