#include "client/cli/texture_fidelity.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>

#include "client/cli/frame_image.h"
#include "client/cli/mesh_instance.h"
#include "client/render/mesh_view.h"

namespace romap::cli {
namespace {

// Masks and outlines of meshes are inexact by about this distance.
constexpr int kBorder_px = 3;

struct SquaredErrors {
  double sum = 0;  // over all channels
  size_t pixels = 0;
  size_t frames = 0;
};

// The label of most pixels in `covered`; 0: most have none.
uint16_t MostFrequentLabel(const cv::Mat& labels, const cv::Mat& covered) {
  std::map<uint16_t, size_t> counts;
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      if (covered.at<uint8_t>(y, x) != 0) ++counts[labels.at<uint16_t>(y, x)];
    }
  }
  const auto most =
      std::max_element(counts.begin(), counts.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == counts.end() ? 0 : most->first;
}

// The pixels of one object to compare, CV_8UC1.
cv::Mat ComparedPixels(const cv::Mat& ids, int id, const cv::Mat& labels) {
  cv::Mat compared = ids == id;
  if (!labels.empty()) {
    const uint16_t label = MostFrequentLabel(labels, compared);
    if (label == 0) return {};
    compared &= labels == label;
  }
  cv::erode(compared, compared, cv::getStructuringElement(cv::MORPH_RECT, {2 * kBorder_px + 1, 2 * kBorder_px + 1}));
  return compared;
}

}  // namespace

std::vector<TextureFidelity> MeasureTextures(const std::vector<MapObject>& objects, const files::Sequence& sequence,
                                             std::span<const size_t> frames) {
  std::vector<render::MeshInstance> meshes;
  for (size_t k = 0; k < objects.size(); ++k) {
    meshes.push_back(InstanceOf(objects[k]));
    meshes.back().id = static_cast<uint16_t>(k + 1);
  }
  std::vector<SquaredErrors> errors(objects.size());
  for (const size_t index : frames) {
    const auto frame = sequence.Load(index);
    const auto image = LoadFrameImage(sequence, index);
    if (!frame.ok() || !frame->T_world_camera || !image.ok()) continue;
    const render::RenderedView view =
        render::RenderMeshes(meshes, sequence.camera().Pinhole(), *frame->T_world_camera, render::MeshPaint::kColored);
    for (size_t k = 0; k < objects.size(); ++k) {
      const cv::Mat compared = ComparedPixels(view.ids, static_cast<int>(k + 1), image->labels);
      const int pixels = compared.empty() ? 0 : cv::countNonZero(compared);
      if (pixels == 0) continue;
      errors[k].sum += std::pow(cv::norm(view.color_bgr, image->color_bgr, cv::NORM_L2, compared), 2);
      errors[k].pixels += static_cast<size_t>(pixels);
      ++errors[k].frames;
    }
  }
  std::vector<TextureFidelity> textures;
  for (size_t k = 0; k < objects.size(); ++k) {
    if (errors[k].pixels == 0) continue;
    const double mean_square = std::max(errors[k].sum / (3.0 * static_cast<double>(errors[k].pixels)), 1e-3);
    textures.push_back({.object = objects[k].file_stem,
                        .psnr_db = 10 * std::log10(255.0 * 255.0 / mean_square),
                        .frames = errors[k].frames,
                        .pixels = errors[k].pixels});
  }
  return textures;
}

std::optional<double> MeanPsnr_db(std::span<const TextureFidelity> textures) {
  if (textures.empty()) return std::nullopt;
  double sum_db = 0;
  for (const TextureFidelity& texture : textures) sum_db += texture.psnr_db;
  return sum_db / static_cast<double>(textures.size());
}

}  // namespace romap::cli
