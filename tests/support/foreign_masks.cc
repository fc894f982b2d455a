// The masks of tests/support/foreign_layouts.h.

#include <opencv2/imgproc.hpp>

#include "tests/support/foreign_layouts.h"

namespace romap::testing_support {
namespace {

std::string MaskFrameName(size_t index) { return fmt::format("{:06}", index); }

// The smallest rectangle around an object. The objects of a sample are rectangles.
cv::Rect BoxOf(const cv::Mat& labels, int label) { return cv::boundingRect(labels == label); }

// Run lengths by columns, from top to bottom; the first one counts pixels outside.
std::vector<int64_t> ColumnRuns(const cv::Mat& mask) {
  std::vector<int64_t> runs = {0};
  bool inside = false;
  for (int x = 0; x < mask.cols; ++x) {
    for (int y = 0; y < mask.rows; ++y) {
      if ((mask.at<uint8_t>(y, x) != 0) != inside) {
        inside = !inside;
        runs.push_back(0);
      }
      ++runs.back();
    }
  }
  return runs;
}

// Groups of 5 bits, the lowest first, with 32 added if more follow and 48 added to each; numbers are signed, and from
// the fourth on the differences to the number before the last.
std::string CompressRuns(const std::vector<int64_t>& runs) {
  std::string text;
  for (size_t k = 0; k < runs.size(); ++k) {
    int64_t value = k > 2 ? runs[k] - runs[k - 2] : runs[k];
    for (bool more = true; more;) {
      int64_t bits = value & 31;
      value >>= 5;
      more = (bits & 16) != 0 ? value != -1 : value != 0;
      text += static_cast<char>(48 + bits + (more ? 32 : 0));
    }
  }
  return text;
}

std::string CocoSegmentation(const cv::Mat& labels, int label, MaskLayout layout) {
  if (layout == MaskLayout::kCocoPolygons) {
    const cv::Rect box = BoxOf(labels, label);
    return fmt::format("[[{0}, {1}, {2}, {1}, {2}, {3}, {0}, {3}]]", box.x, box.y, box.x + box.width,
                       box.y + box.height);
  }
  const std::vector<int64_t> runs = ColumnRuns(labels == label);
  const std::string counts = layout == MaskLayout::kCocoCompressed ? fmt::format("\"{}\"", CompressRuns(runs))
                                                                   : fmt::format("[{}]", fmt::join(runs, ", "));
  // The only character that JSON must escape here is the backslash.
  std::string escaped;
  for (const char c : counts) escaped += c == '\\' ? std::string("\\\\") : std::string(1, c);
  return fmt::format("{{\"size\": [{}, {}], \"counts\": {}}}", labels.rows, labels.cols, escaped);
}

void WriteCoco(const SampleRecording& sample, const std::string& path, MaskLayout layout) {
  std::string images, annotations, categories;
  int annotation = 0;
  for (size_t k = 0; k < sample.frames.size(); ++k) {
    const cv::Mat& labels = sample.frames[k].labels;
    images += fmt::format(R"({}{{"id": {}, "file_name": "{}.png", "width": {}, "height": {}}})", k == 0 ? "" : ",\n",
                          1000 + k, MaskFrameName(k), labels.cols, labels.rows);
    for (const auto& [label, name] : sample.classes) {
      annotations += fmt::format(R"({}{{"id": {}, "image_id": {}, "category_id": {}, "segmentation": {}}})",
                                 annotation == 0 ? "" : ",\n", annotation, 1000 + k, 40 + label,
                                 CocoSegmentation(labels, label, layout));
      ++annotation;
    }
  }
  for (const auto& [label, name] : sample.classes) {
    categories += fmt::format(R"({}{{"id": {}, "name": "{}"}})", categories.empty() ? "" : ", ", 40 + label, name);
  }
  WriteText(path, fmt::format("{{\"images\": [{}],\n\"annotations\": [{}],\n\"categories\": [{}]}}", images,
                              annotations, categories));
}

void WriteYolo(const SampleRecording& sample, const std::string& path) {
  std::string names;
  for (const auto& [label, name] : sample.classes) names += fmt::format("  {}: {}\n", label, name);
  WriteText(path + "/data.yaml", "path: .\nnames:\n" + names);
  for (size_t k = 0; k < sample.frames.size(); ++k) {
    const cv::Mat& labels = sample.frames[k].labels;
    std::string lines;
    for (const auto& [label, name] : sample.classes) {
      const cv::Rect box = BoxOf(labels, label);
      const double left = static_cast<double>(box.x) / labels.cols, top = static_cast<double>(box.y) / labels.rows;
      const double right = static_cast<double>(box.x + box.width) / labels.cols;
      const double bottom = static_cast<double>(box.y + box.height) / labels.rows;
      lines += fmt::format("{0} {1:.6f} {2:.6f} {3:.6f} {2:.6f} {3:.6f} {4:.6f} {1:.6f} {4:.6f}\n", label, left, top,
                           right, bottom);
    }
    WriteText(path + "/labels/" + MaskFrameName(k) + ".txt", lines);
  }
}

}  // namespace

void WriteMasks(const SampleRecording& sample, const std::string& path, MaskLayout layout) {
  if (layout == MaskLayout::kYolo) return WriteYolo(sample, path);
  if (layout == MaskLayout::kCocoPolygons || layout == MaskLayout::kCocoRuns || layout == MaskLayout::kCocoCompressed) {
    return WriteCoco(sample, path, layout);
  }
  for (size_t k = 0; k < sample.frames.size(); ++k) {
    const cv::Mat& labels = sample.frames[k].labels;
    const std::string frame = path + "/" + MaskFrameName(k);
    if (layout == MaskLayout::kLabelPng) WriteImage(frame + ".png", labels);
    for (const auto& [label, name] : sample.classes) {
      const std::string id = std::to_string(label);
      if (layout == MaskLayout::kInstanceFiles) WriteImage(frame + "_" + id + ".png", labels == label);
      if (layout == MaskLayout::kInstanceFolders) WriteImage(frame + "/" + name + "_" + id + ".png", labels == label);
    }
  }
}

void WriteImageFolder(const SampleRecording& sample, const std::string& dir) {
  for (size_t k = 0; k < sample.frames.size(); ++k) {
    WriteImage(dir + "/images/" + MaskFrameName(k) + ".png", sample.frames[k].color);
  }
}

}  // namespace romap::testing_support
