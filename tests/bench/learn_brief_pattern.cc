// Selects the 256 binary tests of server/slam/features/brief_pattern.cc and prints them as the rows of its table. Runs
// for about half a minute.
//
//   learn_brief_pattern
//
// Evaluates random tests on corners of generated images (dead leaves: Lee, Mumford and Huang, IJCV 2001). Each corner
// has two views; the second has different noise and a small random warp. Ranks first the tests whose results differ
// often between corners and rarely between the two views of a corner. Then takes tests from the top of the list that
// are not correlated with a test already selected (the greedy search of Rublee et al., ICCV 2011).

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "server/slam/features/corner_detector.h"
#include "server/slam/features/image_pyramid.h"
#include "server/slam/features/steered_brief.h"

namespace romap::measure {
namespace {

constexpr int kImages = 60;
constexpr int kLeaves = 700;
constexpr int kCornersPerOctave = 60;
constexpr size_t kCandidates = 20000;
constexpr double kNoise = 4;               // gray levels
constexpr double kWarp = 0.12;             // of the second view's affine map, standard deviation
constexpr double kShift_px = 0.7;          // of the second view's corner
constexpr double kMaxImbalance = 0.1;      // maximum deviation of a test's share of ones from one half
constexpr double kFirstCorrelation = 0.1;  // maximum between two tests; raised until enough tests are found
constexpr double kCorrelationStep = 0.02;

// Uniform in [0, 1), the same with every standard library.
double Uniform(std::mt19937& random) { return random() / 4294967296.0; }

double Normal(std::mt19937& random) {
  const double radius = std::sqrt(-2 * std::log(1 - Uniform(random)));
  return radius * std::cos(2 * std::numbers::pi * Uniform(random));
}

// Random ellipses and rectangles that occlude each other, many small and few large, each with one gray level.
cv::Mat DeadLeaves(std::mt19937& random) {
  cv::Mat image(480, 640, CV_8UC1, cv::Scalar(128));
  for (int i = 0; i < kLeaves; ++i) {
    const double size_px = 6 / std::sqrt(1 - Uniform(random) * (1 - std::pow(6.0 / 200, 2)));
    const cv::RotatedRect leaf(
        cv::Point2f(static_cast<float>(640 * Uniform(random)), static_cast<float>(480 * Uniform(random))),
        cv::Size2f(static_cast<float>(2 * size_px), static_cast<float>(2 * size_px * (0.3 + 0.7 * Uniform(random)))),
        static_cast<float>(360 * Uniform(random)));
    const cv::Scalar gray(255 * Uniform(random));
    if (Uniform(random) < 0.4) {
      cv::ellipse(image, leaf, gray, cv::FILLED, cv::LINE_AA);
    } else {
      std::array<cv::Point2f, 4> corners;
      leaf.points(corners.data());
      std::array<cv::Point, 4> pixels;
      std::copy(corners.begin(), corners.end(), pixels.begin());
      cv::fillConvexPoly(image, pixels, gray, cv::LINE_AA);
    }
  }
  cv::GaussianBlur(image, image, {0, 0}, 0.8);
  return image;
}

cv::Mat WithNoise(const cv::Mat& image, uint64_t seed) {
  cv::Mat grain(image.size(), CV_16SC1), noisy;
  cv::RNG(seed).fill(grain, cv::RNG::NORMAL, 0, kNoise);
  cv::add(image, grain, noisy, cv::noArray(), CV_8U);
  return noisy;
}

// The gray values around a corner, rotated upright.
constexpr int kSide_px = 2 * slam::kPatchRadius_px + 1;
using Patch = std::array<uint8_t, kSide_px * kSide_px>;

Patch CutPatch(const cv::Mat& smooth, int x_px, int y_px, const slam::PatchDirection& direction,
               const cv::Matx22d& warp) {
  const cv::Matx22d turn(direction.cosine, -direction.sine, direction.sine, direction.cosine);
  const cv::Matx22d to_image = warp * turn;
  Patch patch;
  for (int y = -slam::kPatchRadius_px; y <= slam::kPatchRadius_px; ++y) {
    for (int x = -slam::kPatchRadius_px; x <= slam::kPatchRadius_px; ++x) {
      const cv::Vec2d at = to_image * cv::Vec2d(x, y);
      const int u = std::clamp(x_px + static_cast<int>(std::lround(at[0])), 0, smooth.cols - 1);
      const int v = std::clamp(y_px + static_cast<int>(std::lround(at[1])), 0, smooth.rows - 1);
      patch[static_cast<size_t>((y + slam::kPatchRadius_px) * kSide_px + x + slam::kPatchRadius_px)] =
          smooth.at<uint8_t>(v, u);
    }
  }
  return patch;
}

struct Views {
  std::vector<Patch> first;
  std::vector<Patch> second;
};

void AddViews(const cv::Mat& image, uint64_t seed, std::mt19937& random, Views& views) {
  constexpr int kMargin_px = slam::kPatchBorder_px + 4;  // for the second view's shift
  slam::ImagePyramid one, other;
  const cv::Mat one_gray = WithNoise(image, 2 * seed), other_gray = WithNoise(image, 2 * seed + 1);
  one.Build(one_gray, 64);
  other.Build(other_gray, 64);
  for (int octave = 0; octave < one.octaves(); ++octave) {
    const cv::Mat& image = one.sharp(octave);
    const cv::Rect part(kMargin_px, kMargin_px, image.cols - 2 * kMargin_px, image.rows - 2 * kMargin_px);
    for (const cv::KeyPoint& corner :
         slam::SpreadEvenly(slam::DetectCorners(image, part, 15), image.size(), kCornersPerOctave)) {
      const auto x_px = static_cast<int>(corner.pt.x), y_px = static_cast<int>(corner.pt.y);
      const auto shift = [&] { return std::clamp(static_cast<int>(std::lround(kShift_px * Normal(random))), -3, 3); };
      const int other_x_px = x_px + shift(), other_y_px = y_px + shift();
      const cv::Matx22d warp(1 + kWarp * Normal(random), kWarp * Normal(random), kWarp * Normal(random),
                             1 + kWarp * Normal(random));
      views.first.push_back(
          CutPatch(one.smooth(octave), x_px, y_px, slam::IntensityCentroid(image, x_px, y_px), cv::Matx22d::eye()));
      views.second.push_back(CutPatch(other.smooth(octave), other_x_px, other_y_px,
                                      slam::IntensityCentroid(other.sharp(octave), other_x_px, other_y_px), warp));
    }
  }
}

// Draws a test with two different points of the circle.
slam::BriefTest DrawTest(std::mt19937& random) {
  const auto draw = [&](int8_t& x_px, int8_t& y_px) {
    do {
      x_px = static_cast<int8_t>(std::lround((2 * Uniform(random) - 1) * slam::kPatchRadius_px));
      y_px = static_cast<int8_t>(std::lround((2 * Uniform(random) - 1) * slam::kPatchRadius_px));
    } while (x_px * x_px + y_px * y_px > (slam::kPatchRadius_px - 0.5) * (slam::kPatchRadius_px - 0.5));
  };
  slam::BriefTest test;
  do {
    draw(test.first_x_px, test.first_y_px);
    draw(test.second_x_px, test.second_y_px);
  } while (test.first_x_px == test.second_x_px && test.first_y_px == test.second_y_px);
  return test;
}

// A test's outcomes on all corners, one bit each.
using Bits = std::vector<uint64_t>;

Bits Outcomes(const slam::BriefTest& test, const std::vector<Patch>& patches) {
  const auto index = [](int x_px, int y_px) {
    return static_cast<size_t>((y_px + slam::kPatchRadius_px) * kSide_px + x_px + slam::kPatchRadius_px);
  };
  const size_t first = index(test.first_x_px, test.first_y_px), second = index(test.second_x_px, test.second_y_px);
  Bits bits((patches.size() + 63) / 64, 0);
  for (size_t i = 0; i < patches.size(); ++i) {
    bits[i / 64] |= static_cast<uint64_t>(patches[i][first] < patches[i][second]) << (i % 64);
  }
  return bits;
}

double ShareDiffering(const Bits& a, const Bits& b, size_t count) {
  size_t differing = 0;
  for (size_t i = 0; i < a.size(); ++i) differing += static_cast<size_t>(std::popcount(a[i] ^ b[i]));
  return static_cast<double>(differing) / static_cast<double>(count);
}

struct Candidate {
  slam::BriefTest test;
  Bits bits;
  double separation = 0;
};

// Sorted by how well the test alone distinguishes different corners from views of the same corner: distance of the
// means of the two outcomes, in standard deviations.
std::vector<Candidate> RankCandidates(const Views& views, std::mt19937& random) {
  const size_t count = views.first.size();
  const Bits zeros((count + 63) / 64, 0);
  std::vector<Candidate> candidates;
  while (candidates.size() < kCandidates) {
    Candidate candidate{.test = DrawTest(random), .bits = {}};
    candidate.bits = Outcomes(candidate.test, views.first);
    const double ones = ShareDiffering(candidate.bits, zeros, count);
    if (std::abs(ones - 0.5) > kMaxImbalance) continue;
    const double flips = ShareDiffering(candidate.bits, Outcomes(candidate.test, views.second), count);
    const double differs = 2 * ones * (1 - ones);
    candidate.separation = (differs - flips) / std::sqrt(differs * (1 - differs) + flips * (1 - flips));
    candidates.push_back(std::move(candidate));
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.separation > b.separation; });
  return candidates;
}

std::vector<slam::BriefTest> SelectUncorrelated(const std::vector<Candidate>& candidates, size_t corners) {
  std::vector<const Candidate*> selected;
  for (double limit = kFirstCorrelation; selected.size() < slam::BriefTests().size(); limit += kCorrelationStep) {
    selected.clear();
    for (const Candidate& candidate : candidates) {
      const bool is_new = std::none_of(selected.begin(), selected.end(), [&](const Candidate* other) {
        return std::abs(1 - 2 * ShareDiffering(candidate.bits, other->bits, corners)) > limit;
      });
      if (is_new) selected.push_back(&candidate);
      if (selected.size() == slam::BriefTests().size()) break;
    }
    std::fprintf(stderr, "correlation up to %.2f: %zu tests\n", limit, selected.size());
  }
  std::vector<slam::BriefTest> tests;
  for (const Candidate* candidate : selected) tests.push_back(candidate->test);
  return tests;
}

void PrintTable(const std::vector<slam::BriefTest>& tests) {
  for (size_t i = 0; i < tests.size(); ++i) {
    const slam::BriefTest& t = tests[i];
    std::printf("%s{%d, %d, %d, %d},%s", i % 6 == 0 ? "    " : "", t.first_x_px, t.first_y_px, t.second_x_px,
                t.second_y_px, i % 6 == 5 || i + 1 == tests.size() ? "\n" : " ");
  }
}

int Main() {
  std::mt19937 random(1);
  Views views;
  for (uint64_t i = 0; i < kImages; ++i) AddViews(DeadLeaves(random), i, random, views);
  std::fprintf(stderr, "%zu corners\n", views.first.size());
  PrintTable(SelectUncorrelated(RankCandidates(views, random), views.first.size()));
  return 0;
}

}  // namespace
}  // namespace romap::measure

int main() { return romap::measure::Main(); }
