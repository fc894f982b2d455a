#include "client/bench/convergence_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace romap::bench {
namespace {

constexpr int kPanelWidth_px = 640, kPanelHeight_px = 520;
constexpr int kLeft_px = 80, kRight_px = 20, kTop_px = 50, kBottom_px = 70;
constexpr int kLegendHeight_px = 130;
constexpr double kPaper_s = 2;  // "On average, each object takes about 2 seconds"
// The rows of the paper's Table 1 that are marked, and their labels.
constexpr std::pair<const char*, const char*> kPublishedMarks[] = {
    {"paper", "RO-MAP"}, {"offline", "[33]*"}, {"offline-depth", "[33]* depth"}};

const cv::Scalar kWhite(255, 255, 255), kInk(40, 40, 40), kGrid(225, 225, 225);

// Colors (B, G, R) that are distinguishable with color vision deficiencies (Okabe and Ito, 2008).
const cv::Scalar kColors[] = {{178, 114, 0}, {0, 94, 213}, {115, 158, 0},  {167, 121, 204},
                              {0, 159, 230}, {60, 60, 60}, {233, 180, 86}, {66, 180, 200}};

cv::Scalar ColorOf(size_t line) { return kColors[line % std::size(kColors)]; }

void Write(cv::Mat& image, const std::string& text, cv::Point at, double scale = 0.5, const cv::Scalar& color = kInk) {
  cv::putText(image, text, at, cv::FONT_HERSHEY_SIMPLEX, scale, color, 1, cv::LINE_AA);
}

void WriteCentered(cv::Mat& image, const std::string& text, cv::Point middle, double scale = 0.5) {
  int baseline = 0;
  const cv::Size size = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, scale, 1, &baseline);
  Write(image, text, {middle.x - size.width / 2, middle.y + size.height / 2}, scale);
}

// A logarithmic axis over a range of pixels; from_px may be larger than to_px.
struct LogAxis {
  double low, high;
  int from_px, to_px;

  int Pixel(double value) const {
    const double fraction = std::log(std::clamp(value, low, high) / low) / std::log(high / low);
    return from_px + static_cast<int>(std::lround(fraction * (to_px - from_px)));
  }
  // The products of `digits` and powers of ten within the axis.
  std::vector<double> Ticks(std::initializer_list<int> digits) const {
    std::vector<double> ticks;
    for (int power = -6; power <= 6; ++power) {
      for (const int digit : digits) {
        const double tick = digit * std::pow(10.0, power);
        if (tick >= low * 0.999 && tick <= high * 1.001) ticks.push_back(tick);
      }
    }
    return ticks;
  }
};

// An axis over the range of the values, with a margin.
LogAxis AxisOver(const std::vector<double>& values, int from_px, int to_px) {
  double low = 1e300, high = 0;
  for (const double value : values) {
    if (!(value > 0)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  if (!(high > 0)) low = high = 1;
  return {low / 1.25, high * 1.25, from_px, to_px};
}

using Lines = std::map<std::string, std::vector<CurvePoint>>;

struct PanelContent {
  std::string title;
  double CurvePoint::*figure;
  double PublishedQuality::*published;
};

void DrawAxes(cv::Mat& panel, const PanelContent& content, const LogAxis& x, const LogAxis& y) {
  for (const double tick : x.Ticks({1, 2, 5})) {
    cv::line(panel, {x.Pixel(tick), y.from_px}, {x.Pixel(tick), y.to_px}, kGrid);
    WriteCentered(panel, fmt::format("{:g}", tick), {x.Pixel(tick), y.from_px + 18}, 0.42);
  }
  for (const double tick : y.Ticks({1, 2, 3, 4, 5, 7})) {
    cv::line(panel, {x.from_px, y.Pixel(tick)}, {x.to_px, y.Pixel(tick)}, kGrid);
    WriteCentered(panel, fmt::format("{:g}", tick), {x.from_px - 28, y.Pixel(tick)}, 0.42);
  }
  cv::rectangle(panel, {x.from_px, y.to_px}, {x.to_px, y.from_px}, kInk);
  WriteCentered(panel, content.title, {(x.from_px + x.to_px) / 2, kTop_px / 2}, 0.6);
  WriteCentered(panel, "training per object [s]", {(x.from_px + x.to_px) / 2, y.from_px + 46});
}

void DrawPanel(cv::Mat& panel, const PanelContent& content, const Lines& lines, const std::vector<std::string>& order) {
  std::vector<double> times, values;
  for (const auto& [method, points] : lines) {
    for (const CurvePoint& p : points) {
      times.push_back(p.train_s);
      values.push_back(p.*content.figure);
    }
  }
  for (const auto& [id, name] : kPublishedMarks) {
    times.push_back(kPaper_s);
    values.push_back((*PublishedTable1(id)).*content.published);
  }
  const LogAxis x = AxisOver(times, kLeft_px, kPanelWidth_px - kRight_px);
  const LogAxis y = AxisOver(values, kPanelHeight_px - kBottom_px, kTop_px);
  DrawAxes(panel, content, x, y);
  for (size_t i = 0; i < order.size(); ++i) {
    const std::vector<CurvePoint>& points = lines.at(order[i]);
    for (size_t k = 0; k < points.size(); ++k) {
      const cv::Point at(x.Pixel(points[k].train_s), y.Pixel(points[k].*content.figure));
      if (k > 0) {
        const cv::Point before(x.Pixel(points[k - 1].train_s), y.Pixel(points[k - 1].*content.figure));
        cv::line(panel, before, at, ColorOf(i), 2, cv::LINE_AA);
      }
      cv::circle(panel, at, 4, ColorOf(i), cv::FILLED, cv::LINE_AA);
    }
  }
  for (const auto& [id, name] : kPublishedMarks) {
    const cv::Point at(x.Pixel(kPaper_s), y.Pixel((*PublishedTable1(id)).*content.published));
    cv::drawMarker(panel, at, kInk, cv::MARKER_TILTED_CROSS, 10, 2, cv::LINE_AA);
    Write(panel, name, at + cv::Point(10, 4), 0.4);
  }
}

std::string TitleOf(const PaperResults& results, const std::string& id) {
  for (const BenchTable& table : results.tables) {
    const auto found = std::ranges::find(table.methods, id, &BenchMethod::id);
    if (found != table.methods.end()) return found->title;
  }
  return id;
}

}  // namespace

cv::Mat DrawConvergence(const PaperResults& results) {
  Lines lines;
  std::vector<std::string> order;
  for (const CurvePoint& p : results.curves) {
    if (!lines.contains(p.method)) order.push_back(p.method);
    lines[p.method].push_back(p);
  }
  cv::Mat picture(kPanelHeight_px + kLegendHeight_px, 2 * kPanelWidth_px, CV_8UC3, kWhite);
  const PanelContent contents[] = {{"accuracy [cm]", &CurvePoint::accuracy_cm, &PublishedQuality::accuracy_cm},
                                   {"completion [cm]", &CurvePoint::completion_cm, &PublishedQuality::completion_cm}};
  for (int i = 0; i < 2; ++i) {
    cv::Mat panel = picture(cv::Rect(i * kPanelWidth_px, 0, kPanelWidth_px, kPanelHeight_px));
    DrawPanel(panel, contents[i], lines, order);
  }
  constexpr int kColumns = 3, kLineHeight_px = 26;
  for (size_t i = 0; i < order.size(); ++i) {
    const cv::Point at(kLeft_px + static_cast<int>(i % kColumns) * 400,
                       kPanelHeight_px + 14 + static_cast<int>(i / kColumns) * kLineHeight_px);
    cv::line(picture, at, at + cv::Point(30, 0), ColorOf(i), 3, cv::LINE_AA);
    Write(picture, TitleOf(results, order[i]), at + cv::Point(40, 5));
  }
  Write(picture, "x: results of the paper on an RTX 4090, plotted at the 2 s per object that it reports",
        {kLeft_px, kPanelHeight_px + kLegendHeight_px - 14}, 0.45);
  return picture;
}

}  // namespace romap::bench
