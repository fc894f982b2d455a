#include "tests/support/recording.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <regex>
#include <sstream>

namespace romap::testing_support {

namespace fs = std::filesystem;

Recording::Recording(const std::string& source, const std::string& dir) : dir_(dir) {
  fs::create_directories(dir);
  for (const auto& entry : fs::directory_iterator(source)) {
    const fs::path target = fs::path(dir) / entry.path().filename();
    if (entry.is_directory()) {
      fs::create_directory_symlink(fs::absolute(entry.path()), target);
    } else {
      fs::copy_file(entry.path(), target);
    }
  }
}

std::string Recording::Read(const std::string& name) const {
  std::ifstream in(Path(name), std::ios::binary);
  EXPECT_TRUE(in) << name;
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

void Recording::Write(const std::string& name, std::string_view bytes) const {
  std::ofstream(Path(name), std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

void Recording::Replace(const std::string& name, const std::string& pattern, const std::string& text) const {
  const std::regex expression(pattern, std::regex::ECMAScript | std::regex::multiline);
  Write(name, std::regex_replace(Read(name), expression, text));
}

void Recording::Remove(const std::string& name) const { fs::remove(Path(name)); }

std::vector<std::string> Recording::Files(const std::string& kind) const {
  std::vector<std::string> files;
  for (const auto& entry : fs::directory_iterator(Path(kind))) files.push_back(entry.path().string());
  std::sort(files.begin(), files.end());
  return files;
}

void Recording::Own(const std::string& kind) const {
  if (!fs::is_symlink(Path(kind))) return;
  const fs::path source = fs::read_symlink(Path(kind));
  fs::remove(Path(kind));
  fs::copy(source, Path(kind), fs::copy_options::recursive);
}

void Recording::ChangeImages(const std::string& kind, const ImageChange& change) const {
  Own(kind);
  const std::vector<std::string> files = Files(kind);
  for (size_t index = 0; index < files.size(); ++index) {
    const cv::Mat changed = change(cv::imread(files[index], cv::IMREAD_UNCHANGED), index);
    ASSERT_TRUE(cv::imwrite(files[index], changed, {cv::IMWRITE_PNG_COMPRESSION, 1})) << files[index];
  }
}

std::vector<std::string> Recording::Stamps() const {
  std::istringstream lines(Read("mask.txt"));
  std::vector<std::string> stamps;
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty() && line[0] != '#') stamps.push_back(line.substr(0, line.find(' ')));
  }
  return stamps;
}

void Recording::AddDetections(int label, const std::string& class_name) const {
  std::istringstream lines(Read("detections.csv"));
  std::string header, text;
  std::getline(lines, header);
  std::vector<std::string> rows;
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty()) rows.push_back(line);
  }
  for (const std::string& stamp : Stamps())
    rows.push_back(stamp + "," + std::to_string(label) + "," + class_name + ",0.9");
  std::stable_sort(rows.begin(), rows.end(),
                   [](const std::string& a, const std::string& b) { return std::stod(a) < std::stod(b); });
  text = header + "\n";
  for (const std::string& row : rows) text += row + "\n";
  Write("detections.csv", text);
}

std::vector<files::StampedPose> Recording::Poses() const {
  auto poses = files::ReadTum(Path("groundtruth.txt"));
  EXPECT_TRUE(poses.ok()) << poses.status();
  return *std::move(poses);
}

void Recording::WritePoses(const std::vector<files::StampedPose>& poses) const {
  EXPECT_TRUE(files::WriteTum(Path("groundtruth.txt"), poses).ok());
}

}  // namespace romap::testing_support
