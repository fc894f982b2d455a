#include "client/importers/png_masks.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <opencv2/core.hpp>

#include "client/files/image_file.h"
#include "client/importers/folder.h"
#include "common/image_bytes.h"

namespace romap::importers {
namespace {

constexpr const char* kUnknownClass = "object";

// "cup" of "cup_3", "cup-3" or "cup"; "object" of "3" or "mask_3".
std::string ClassOfStem(std::string stem) {
  while (!stem.empty() && (std::isdigit(static_cast<unsigned char>(stem.back())) || stem.back() == '_' ||
                           stem.back() == '-' || stem.back() == ' ')) {
    stem.pop_back();
  }
  return stem.empty() || stem == "mask" || stem == "instance" || stem == "obj" ? kUnknownClass : stem;
}

// The frame of "FRAME_ID".
std::optional<std::string> FrameOfInstance(const std::string& stem, const std::set<std::string>& frame_names) {
  const size_t last = stem.find_last_of('_');
  if (last == std::string::npos || last + 1 == stem.size()) return std::nullopt;
  if (!std::ranges::all_of(stem.substr(last + 1), [](unsigned char c) { return std::isdigit(c); })) return std::nullopt;
  std::string frame = stem.substr(0, last);
  return frame_names.contains(frame) ? std::optional(std::move(frame)) : std::nullopt;
}

NamedMasks InstancesOf(const std::string& frame, std::vector<InstancePng> instances, cv::Size size_px) {
  const std::string path = instances.front().path;
  return {frame, path, [instances = std::move(instances), size_px] { return LoadInstancePngs(instances, size_px); }};
}

}  // namespace

absl::StatusOr<EncodedMasks> LoadInstancePngs(const std::vector<InstancePng>& instances, cv::Size size_px) {
  std::vector<MaskLayer> layers;
  for (const InstancePng& instance : instances) {
    ROMAP_ASSIGN_OR_RETURN(const cv::Mat labels, ReadLabels(instance.path, size_px));
    if (cv::countNonZero(labels) > 0) layers.push_back({labels != 0, instance.class_name});
  }
  return EncodeLayers(layers, size_px);
}

absl::StatusOr<EncodedMasks> LoadLabelImage(const std::string& path, const std::vector<Instance>& instances,
                                            cv::Size size_px) {
  EncodedMasks masks{
      .mask_encoding = MaskEncoding::kLabelPng, .label_png = {}, .label_runs = {}, .instances = instances};
  ROMAP_ASSIGN_OR_RETURN(files::ImageFile file, files::ReadImageFile(path));
  const auto header = PngHeader(file.bytes);
  if (header && header->channels == 1 && header->width_px == size_px.width && header->height_px == size_px.height) {
    masks.label_png = std::move(file.bytes);
    return masks;
  }
  ROMAP_ASSIGN_OR_RETURN(const cv::Mat labels, ReadLabels(path, size_px));
  masks.label_png = EncodeLabelImage(labels);
  return masks;
}

std::vector<NamedMasks> ReadPngMasks(const std::string& folder, const std::set<std::string>& frame_names,
                                     cv::Size size_px) {
  std::vector<NamedMasks> all;
  for (const std::string& frame : FolderNames(folder)) {
    std::vector<InstancePng> instances;
    for (const std::string& name : FileNames(folder + "/" + frame, ".png")) {
      instances.push_back({folder + "/" + frame + "/" + name, ClassOfStem(StemOf(name))});
    }
    if (!instances.empty()) all.push_back(InstancesOf(frame, std::move(instances), size_px));
  }
  std::map<std::string, std::vector<InstancePng>> by_frame;
  for (const std::string& name : FileNames(folder, ".png")) {
    const std::string path = folder + "/" + name;
    const std::string stem = StemOf(name);
    const std::optional<std::string> frame =
        frame_names.contains(stem) ? std::nullopt : FrameOfInstance(stem, frame_names);
    if (frame) {
      by_frame[*frame].push_back({path, kUnknownClass});
    } else {
      all.push_back({stem, path, [path, size_px] { return LoadLabelImage(path, {}, size_px); }});
    }
  }
  for (auto& [frame, instances] : by_frame) all.push_back(InstancesOf(frame, std::move(instances), size_px));
  return all;
}

}  // namespace romap::importers
