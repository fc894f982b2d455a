#include "client/importers/join_masks.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <opencv2/core.hpp>
#include <set>

#include "client/importers/coco_masks.h"
#include "client/importers/folder.h"
#include "client/importers/png_masks.h"
#include "client/importers/yolo_masks.h"
#include "common/label_image.h"
#include "common/label_png.h"

namespace romap::importers {
namespace {

constexpr size_t kCheckedMasks = 5;

std::string FrameName(const RecordedFrame& frame) {
  return frame.name.empty() ? NameOf(frame.paths.image) : frame.name;
}

cv::Size SizeOf(const RecordingContents& contents) {
  return {contents.camera.camera.width_px, contents.camera.camera.height_px};
}

absl::StatusOr<std::vector<NamedMasks>> ReadMasks(const std::string& path, const RecordingContents& contents) {
  if (IsFile(path)) return ReadCocoMasks(path, SizeOf(contents));
  if (!IsFolder(path)) return NotFound("{}: no such file or folder with masks", path);
  const std::string labels = IsFolder(path + "/labels") ? path + "/labels" : path;
  const std::vector<std::string> texts = FileNames(labels, ".txt");
  if (FileNames(path, ".png").empty() && std::ranges::any_of(texts, [](const auto& n) { return n != "classes.txt"; })) {
    return ReadYoloMasks(labels, SizeOf(contents));
  }
  std::set<std::string> names;
  for (const RecordedFrame& frame : contents.frames) {
    names.insert(FrameName(frame));
    names.insert(StemOf(FrameName(frame)));
  }
  std::vector<NamedMasks> masks = ReadPngMasks(path, names, SizeOf(contents));
  if (!masks.empty()) return masks;
  return InvalidArgument(
      "{}: no masks; found {}; looked for label images (FRAME.png), instance images (FRAME_ID.png or "
      "FRAME/ID.png), YOLO segmentations (FRAME.txt), or a COCO file instead of a folder",
      path, DescribeSource(path));
}

// The indices of the frames of all masks; -1: none.
std::vector<int64_t> MatchFrames(const std::vector<NamedMasks>& masks, const RecordingContents& contents,
                                 bool* by_number) {
  std::map<std::string, int64_t> by_name;
  std::map<int64_t, int64_t> by_last_number;
  for (size_t k = 0; k < contents.frames.size(); ++k) {
    const std::string name = FrameName(contents.frames[k]);
    for (const std::string& key : {name, StemOf(name)}) by_name.emplace(key, k);
    if (const auto number = LastNumber(StemOf(name))) by_last_number.emplace(*number, k);
  }
  std::vector<int64_t> frames(masks.size(), -1);
  for (size_t k = 0; k < masks.size(); ++k) {
    const std::string name = NameOf(masks[k].image);
    for (const std::string& key : {name, StemOf(name)}) {
      if (const auto found = by_name.find(key); frames[k] < 0 && found != by_name.end()) frames[k] = found->second;
    }
  }
  *by_number = std::ranges::all_of(frames, [](int64_t frame) { return frame < 0; });
  for (size_t k = 0; *by_number && k < masks.size(); ++k) {
    const auto number = LastNumber(StemOf(NameOf(masks[k].image)));
    const auto found = number ? by_last_number.find(*number) : by_last_number.end();
    if (found != by_last_number.end()) frames[k] = found->second;
  }
  return frames;
}

bool AreBlackAndWhite(const std::vector<std::string>& paths) {
  size_t checked = 0;
  for (const std::string& path : paths) {
    if (path.empty() || checked == kCheckedMasks) continue;
    const absl::StatusOr<cv::Mat> labels = ReadLabels(path, cv::Size());
    if (!labels.ok()) continue;
    if (cv::countNonZero((*labels != 0) & (*labels != 255)) > 0) return false;
    ++checked;
  }
  return checked > 0;
}

}  // namespace

absl::Status JoinMasks(const std::string& path, const std::string& source, RecordingContents* contents) {
  std::error_code error;
  const std::string in_source = source + "/" + path;
  const bool exists = std::filesystem::exists(path, error);
  ROMAP_ASSIGN_OR_RETURN(const std::vector<NamedMasks> masks,
                         ReadMasks(!exists && std::filesystem::exists(in_source, error) ? in_source : path, *contents));
  bool by_number = false;
  const std::vector<int64_t> frames = MatchFrames(masks, *contents, &by_number);
  size_t joined = 0;
  for (size_t k = 0; k < masks.size(); ++k) {
    if (frames[k] < 0) continue;
    RecordedFrame& frame = contents->frames[static_cast<size_t>(frames[k])];
    frame.paths.mask = masks[k].path;
    frame.load_masks = masks[k].load;
    ++joined;
  }
  if (joined == 0) {
    return InvalidArgument(
        "{}: none of the {} masks has the name of a frame; a mask belongs to '{}', a frame is called '{}'", path,
        masks.size(), masks.empty() ? "" : masks.front().image, FrameName(contents->frames.front()));
  }
  contents->diagnostics.push_back(
      {.code = "masks_joined",
       .severity = Severity::kInfo,
       .count = joined,
       .text = fmt::format("{} has masks for {} of {} frames, by {}", path, joined, contents->frames.size(),
                           by_number ? "the numbers in their names" : "name")});
  return absl::OkStatus();
}

void ApplyIgnoreMasks(RecordingContents* contents) {
  const cv::Size size_px = SizeOf(*contents);
  size_t without = 0;
  for (RecordedFrame& frame : contents->frames) {
    if (frame.ignore_mask.empty()) continue;
    if (frame.paths.mask.empty()) {
      ++without;
      continue;
    }
    frame.load_masks = [load = std::move(frame.load_masks), path = frame.paths.mask, instances = frame.instances,
                        ignore = frame.ignore_mask, size_px]() -> absl::StatusOr<EncodedMasks> {
      ROMAP_ASSIGN_OR_RETURN(EncodedMasks masks, load ? load() : LoadLabelImage(path, instances, size_px));
      ROMAP_ASSIGN_OR_RETURN(cv::Mat labels, DecodeLabelPng(masks.label_png));
      ROMAP_ASSIGN_OR_RETURN(const cv::Mat kept, ReadLabels(ignore, size_px));
      labels.setTo(kIgnoreLabel, kept == 0);
      masks.label_png = EncodeLabelImage(labels);
      return masks;
    };
  }
  if (without > 0) {
    contents->diagnostics.push_back(
        {.code = "masks_ignore_only",
         .severity = Severity::kInfo,
         .count = without,
         .text = fmt::format("the masks of {} frames are black and white, where black means \"ignore\"; they name no "
                             "objects and are not used",
                             without),
         .advice = "give masks of the objects with --masks"});
  }
}

void SetMasks(const std::vector<std::string>& paths, RecordingContents* contents) {
  const bool ignore = AreBlackAndWhite(paths);
  for (size_t k = 0; k < paths.size(); ++k) {
    RecordedFrame& frame = contents->frames[k];
    (ignore ? frame.ignore_mask : frame.paths.mask) = paths[k];
  }
}

}  // namespace romap::importers
