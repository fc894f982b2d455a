#include "server/slam/features/corner_detector.h"

#include <algorithm>
#include <cmath>
#include <opencv2/features2d.hpp>

namespace romap::slam {
namespace {

// Each image cell of kCell_px keeps at least kMinPerCell corners, because in scenes with little structure the camera
// pose depends on corners in all parts of the image.
constexpr int kCell_px = 80;
constexpr int kMinPerCell = 8;
// More candidates allow a more even distribution, but they include weaker corners, which are matched less often.
constexpr double kCandidatesPerCorner = 3;
constexpr int kCircleRadius_px = 3;  // of FAST's test

bool IsStronger(const cv::KeyPoint& a, const cv::KeyPoint& b) { return a.response > b.response; }

// Divides a rectangle evenly into cells of about kCell_px.
class CellGrid {
 public:
  explicit CellGrid(const cv::Rect& part)
      : part_(part), columns_(std::max(1, part.width / kCell_px)), rows_(std::max(1, part.height / kCell_px)) {}

  size_t size() const { return static_cast<size_t>(columns_ * rows_); }
  size_t IndexOf(const cv::Point2f& pixel_px) const {
    const int column = std::clamp(static_cast<int>(pixel_px.x - part_.x) * columns_ / part_.width, 0, columns_ - 1);
    const int row = std::clamp((static_cast<int>(pixel_px.y) - part_.y) * rows_ / part_.height, 0, rows_ - 1);
    return static_cast<size_t>(row * columns_ + column);
  }
  cv::Rect Cell(size_t index) const {
    const int column = static_cast<int>(index) % columns_;
    const int row = static_cast<int>(index) / columns_;
    return {cv::Point(Edge(part_.x, part_.width, column, columns_), Edge(part_.y, part_.height, row, rows_)),
            cv::Point(Edge(part_.x, part_.width, column + 1, columns_), Edge(part_.y, part_.height, row + 1, rows_))};
  }

 private:
  // The first pixel p with (p - begin) * cells / length == `cell`.
  static int Edge(int begin, int length, int cell, int cells) { return begin + (cell * length + cells - 1) / cells; }

  cv::Rect part_;
  int columns_;
  int rows_;
};

// Keeps the `count` strongest corners of the image and the kMinPerCell strongest corners of each cell.
void KeepCandidates(Corners& corners, const cv::Size& image_size, size_t count) {
  std::stable_sort(corners.begin(), corners.end(), IsStronger);
  const CellGrid grid(cv::Rect(cv::Point(), image_size));
  std::vector<int> in_cell(grid.size(), 0);
  size_t kept = 0;
  for (size_t i = 0; i < corners.size(); ++i) {
    const size_t cell = grid.IndexOf(corners[i].pt);
    if (i < count || in_cell[cell] < kMinPerCell) corners[kept++] = corners[i];
    ++in_cell[cell];
  }
  corners.resize(kept);
}

// Selects corners in order and skips those closer than about `spacing_px` to a selected one: each selected corner
// covers a square of half side `spacing_px`, on a grid of cells of half that size. Stops after `limit` + 1 corners.
// Returns their indices.
std::vector<size_t> SelectWithSpacing(const Corners& corners, const cv::Size& image_size, float spacing_px,
                                      size_t limit) {
  constexpr int kHalfSide_cells = 2;
  const float cell_px = spacing_px / kHalfSide_cells;
  const int columns = static_cast<int>(static_cast<float>(image_size.width) / cell_px) + 1;
  const int rows = static_cast<int>(static_cast<float>(image_size.height) / cell_px) + 1;
  cv::Mat covered(rows + 2 * kHalfSide_cells, columns + 2 * kHalfSide_cells, CV_8UC1, cv::Scalar(0));
  std::vector<size_t> selected;
  for (size_t i = 0; i < corners.size() && selected.size() <= limit; ++i) {
    const int column = static_cast<int>(corners[i].pt.x / cell_px);
    const int row = static_cast<int>(corners[i].pt.y / cell_px);
    if (covered.at<uint8_t>(row + kHalfSide_cells, column + kHalfSide_cells) != 0) continue;
    selected.push_back(i);
    for (int y = row; y <= row + 2 * kHalfSide_cells; ++y) {
      std::fill_n(covered.ptr<uint8_t>(y) + column, 2 * kHalfSide_cells + 1, uint8_t{1});
    }
  }
  return selected;
}

}  // namespace

Corners DetectCorners(const cv::Mat& image, const cv::Rect& part, int threshold) {
  const cv::Rect searched = cv::Rect(part.x - kCircleRadius_px, part.y - kCircleRadius_px,
                                     part.width + 2 * kCircleRadius_px, part.height + 2 * kCircleRadius_px) &
                            cv::Rect(cv::Point(), image.size());
  Corners corners;
  if (std::min(searched.width, searched.height) <= 2 * kCircleRadius_px) return corners;
  cv::FAST(image(searched), corners, threshold, /*nonmaxSuppression=*/true, cv::FastFeatureDetector::TYPE_9_16);
  for (cv::KeyPoint& corner : corners) corner.pt += cv::Point2f(searched.tl());
  return corners;
}

Corners DetectCornersEverywhere(const cv::Mat& image, const cv::Rect& part, int threshold, int min_threshold) {
  Corners corners = DetectCorners(image, part, threshold);
  if (min_threshold >= threshold) return corners;
  const CellGrid grid(part);
  std::vector<int> in_cell(grid.size(), 0);
  for (const cv::KeyPoint& corner : corners) ++in_cell[grid.IndexOf(corner.pt)];
  for (size_t cell = 0; cell < grid.size(); ++cell) {
    if (in_cell[cell] >= kMinPerCell) continue;
    const Corners weak = DetectCorners(image, grid.Cell(cell), min_threshold);
    corners.insert(corners.end(), weak.begin(), weak.end());
  }
  return corners;
}

Corners SpreadEvenly(Corners corners, const cv::Size& image_size, size_t count) {
  if (corners.size() <= count) return corners;
  if (count == 0) return {};
  KeepCandidates(corners, image_size, static_cast<size_t>(kCandidatesPerCorner * static_cast<double>(count)));
  // Bisection: fewer than `count` corners fit at twice the spacing of a square lattice of `count` corners; all fit at
  // one pixel.
  float min_spacing_px = 1;
  float max_spacing_px = 2 * std::sqrt(static_cast<float>(image_size.area()) / static_cast<float>(count));
  std::vector<size_t> selected = SelectWithSpacing(corners, image_size, min_spacing_px, count);
  while (max_spacing_px - min_spacing_px > 0.25F) {
    const float spacing_px = 0.5F * (min_spacing_px + max_spacing_px);
    std::vector<size_t> fewer = SelectWithSpacing(corners, image_size, spacing_px, count);
    const bool enough = fewer.size() >= count;
    (enough ? min_spacing_px : max_spacing_px) = spacing_px;
    if (enough) selected = std::move(fewer);
  }
  selected.resize(std::min(selected.size(), count));
  Corners spread;
  spread.reserve(selected.size());
  for (const size_t i : selected) spread.push_back(corners[i]);
  return spread;
}

}  // namespace romap::slam
