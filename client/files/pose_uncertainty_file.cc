#include "client/files/pose_uncertainty_file.h"

#include <algorithm>
#include <filesystem>
#include <map>

#include "client/files/text_file.h"

namespace romap::files {

std::string UncertaintyPath(const std::string& trajectory_path) {
  const std::filesystem::path path(trajectory_path);
  return (path.parent_path() / (path.stem().string() + "_uncertainty" + path.extension().string())).string();
}

absl::Status WriteUncertainties(const std::string& path, std::span<const StampedPose> poses) {
  std::string text =
      "# timestamp position_sigma rotation_sigma (seconds; map units; radians). Standard deviations per axis after\n"
      "# alignment of the whole trajectory; 95 % of the errors are expected to be shorter than 2.80 sigma\n";
  for (const StampedPose& pose : poses) {
    if (!pose.uncertainty) continue;
    text += fmt::format("{} {:.6g} {:.6g}\n", FormatSeconds(pose.timestamp_ns), pose.uncertainty->position_sigma_mu,
                        pose.uncertainty->rotation_sigma_rad);
  }
  return WriteFile(path, text);
}

absl::Status ReadUncertainties(const std::string& path, std::vector<StampedPose>* poses) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<TableLine> lines, ReadTable(path));
  std::map<int64_t, PoseUncertainty> uncertainties;
  for (const TableLine& line : lines) {
    if (line.fields.size() != 3) {
      return InvalidArgument("{}:{}: {} fields; expected 3 (t position_sigma rotation_sigma)", path, line.number,
                             line.fields.size());
    }
    const auto timestamp_ns = ParseSeconds(line.fields[0]);
    const auto position = ParseNumber(line.fields[1]);
    const auto rotation = ParseNumber(line.fields[2]);
    if (!timestamp_ns || !position || !rotation || !(*position > 0 && *rotation > 0)) {
      return InvalidArgument("{}:{}: expected a time and two positive numbers", path, line.number);
    }
    uncertainties[*timestamp_ns] = {*position, *rotation};
  }
  for (StampedPose& pose : *poses) {
    const auto found = uncertainties.find(pose.timestamp_ns);
    if (found != uncertainties.end()) pose.uncertainty = found->second;
  }
  return absl::OkStatus();
}

absl::Status WriteTrajectory(const std::string& path, std::span<const StampedPose> poses) {
  ROMAP_RETURN_IF_ERROR(WriteTum(path, poses));
  if (std::any_of(poses.begin(), poses.end(), [](const StampedPose& pose) { return pose.uncertainty.has_value(); })) {
    return WriteUncertainties(UncertaintyPath(path), poses);
  }
  std::error_code error;
  std::filesystem::remove(UncertaintyPath(path), error);
  return absl::OkStatus();
}

}  // namespace romap::files
