#include "server/nerf/pixel_sampler.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <opencv2/core.hpp>
#include <tuple>
#include <utility>

#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::pixel_sampler_test {

using testing_support::BallScene;

class PixelSamplerTest : public ::testing::Test {
 protected:
  PixelSamplerTest() {
    scene_.views = 4;
    config_.rays_per_step = 200;
    views_ = scene_.Views();
  }

  PixelSampler Build() const {
    PixelSampler sampler(config_, 5);
    sampler.Build(views_);
    return sampler;
  }
  // Returns the number of object pixels chosen in `steps` steps, by view.
  std::vector<int> ObjectRaysOfViews(const PixelSampler& sampler, int steps) const {
    std::vector<int> counts(views_.size());
    for (int step = 0; step < steps; ++step) {
      for (int i = 0; i < config_.rays_per_step; ++i) {
        const PixelSampler::Choice choice = sampler.At(static_cast<uint64_t>(step), i);
        if (choice.is_object) ++counts[choice.pixel.view];
      }
    }
    return counts;
  }
  uint8_t KindAt(const TrainingPixel& pixel) const {
    const ObjectView& view = views_[pixel.view];
    return view.ray_kind.at<uint8_t>(pixel.v_px - view.roi_px.y, pixel.u_px - view.roi_px.x);
  }

  BallScene scene_;
  NerfConfig config_;
  std::vector<ObjectView> views_;
};

TEST_F(PixelSamplerTest, ChoosesObjectPixelsAndABandOfBackgroundButNoOccluders) {
  for (ObjectView& view : views_) {
    cv::Mat right = view.ray_kind.colRange(scene_.size_px / 2, scene_.size_px);
    right.setTo(static_cast<int>(RayKind::kOccluder), right == static_cast<int>(RayKind::kBackground));
  }
  const PixelSampler sampler = Build();
  int object = 0;
  for (int step = 0; step < 50; ++step) {
    for (int i = 0; i < config_.rays_per_step; ++i) {
      const auto [pixel, is_object, partner] = sampler.At(static_cast<uint64_t>(step), i);
      object += is_object ? 1 : 0;
      EXPECT_EQ(KindAt(pixel), static_cast<uint8_t>(is_object ? RayKind::kObject : RayKind::kBackground));
      const cv::Vec3b& bgr = views_[pixel.view].color_bgr.at<cv::Vec3b>(pixel.v_px, pixel.u_px);
      EXPECT_EQ(pixel.rgb, (std::array<uint8_t, 3>{bgr[2], bgr[1], bgr[0]}));
      if (is_object) continue;
      const cv::Mat is_mask = views_[pixel.view].ray_kind == static_cast<int>(RayKind::kObject);
      constexpr int reach = 6;
      const cv::Rect around(pixel.u_px - reach, pixel.v_px - reach, 2 * reach + 1, 2 * reach + 1);
      EXPECT_GT(cv::countNonZero(is_mask(around & cv::Rect({0, 0}, is_mask.size()))), 0);
    }
  }
  EXPECT_EQ(object, 50 * 140);
}

TEST_F(PixelSamplerTest, EveryStepSamplesAllViewsInProportionAndAllPixelsAreChosen) {
  config_.contrast_weight = 0;  // without partners, which are chosen in addition
  const PixelSampler sampler = Build();
  std::vector<int> pixels;
  int all_pixels = 0;
  for (const ObjectView& view : views_) {
    pixels.push_back(cv::countNonZero(view.ray_kind == static_cast<int>(RayKind::kObject)));
    all_pixels += pixels.back();
  }
  const std::vector<int> of_one_step = ObjectRaysOfViews(sampler, 1);
  for (size_t v = 0; v < views_.size(); ++v) EXPECT_NEAR(of_one_step[v], 140.0 * pixels[v] / all_pixels, 1.5) << v;

  // After as many draws as there are pixels, most pixels were chosen. Random draws would miss 37 %.
  std::map<std::tuple<int, int, int>, int> times;
  const int steps = all_pixels / 140 + 1;
  for (int step = 0; step < steps; ++step) {
    for (int i = 0; i < config_.rays_per_step; ++i) {
      const auto [pixel, is_object, partner] = sampler.At(static_cast<uint64_t>(step), i);
      if (is_object) ++times[{pixel.view, pixel.u_px, pixel.v_px}];
    }
  }
  EXPECT_GT(static_cast<double>(times.size()), 0.8 * all_pixels);
  for (const auto& [pixel, count] : times) EXPECT_LE(count, 3);
}

TEST_F(PixelSamplerTest, WeightsSetHowOftenAViewIsChosen) {
  PixelSampler sampler = Build();
  const std::vector<int> even = ObjectRaysOfViews(sampler, 100);
  sampler.Weigh(std::vector<float>{1, 0, 3, 1});
  const std::vector<int> weighed = ObjectRaysOfViews(sampler, 100);
  EXPECT_EQ(weighed[1], 0);
  const auto ratio = [&](size_t v) { return static_cast<double>(weighed[v]) / even[v]; };
  EXPECT_NEAR(ratio(2) / ratio(0), 3, 0.05);
  EXPECT_NEAR(ratio(3) / ratio(0), 1, 0.05);
  sampler.Weigh(std::vector<float>(4, 0.0f));
  EXPECT_EQ(ObjectRaysOfViews(sampler, 100), even) << "if all weights are 0, all views weigh the same";
}

TEST_F(PixelSamplerTest, DependsOnlyOnTheSeed) {
  const PixelSampler a = Build(), b = Build();
  PixelSampler other(config_, 6);
  other.Build(views_);
  int differ = 0;
  for (int i = 0; i < config_.rays_per_step; ++i) {
    const auto pixel_of = [&](const PixelSampler& sampler) {
      const TrainingPixel pixel = sampler.At(3, i).pixel;
      return std::tuple(pixel.view, pixel.u_px, pixel.v_px);
    };
    EXPECT_EQ(pixel_of(a), pixel_of(b));
    differ += pixel_of(a) != pixel_of(other) ? 1 : 0;
  }
  EXPECT_GT(differ, config_.rays_per_step / 2);
}

TEST_F(PixelSamplerTest, InvalidDepthIsUnknown) {
  const float inf = std::numeric_limits<float>::infinity();
  for (ObjectView& view : views_) {
    view.depth_mu = cv::Mat(view.roi_px.size(), CV_32FC1, cv::Scalar(2));
    for (int x = 0; x < view.depth_mu.cols; ++x) {
      view.depth_mu.col(x).setTo(x % 4 == 0 ? NAN : x % 4 == 1 ? inf : x % 4 == 2 ? -1.0f : 2.0f);
    }
  }
  const PixelSampler sampler = Build();
  PixelSampler without(config_, 5);
  without.Build(views_, {.depth_is_consistent = false});
  for (int i = 0; i < config_.rays_per_step; ++i) {
    const auto [pixel, is_object, partner] = sampler.At(0, i);
    EXPECT_LE(without.At(0, i).pixel.z_mu, 0);
    if (is_object && pixel.u_px % 4 == 3) {
      EXPECT_EQ(pixel.z_mu, 2);
    } else {
      EXPECT_LE(pixel.z_mu, 0);
    }
  }
}

TEST_F(PixelSamplerTest, MapPointsGetRaysUnlessThereAreFew) {
  for (int i = 0; i < 200; ++i) {
    const float shift = static_cast<float>(i % 10);
    views_[0].sparse_depth.emplace_back(30 + shift, 31 + shift, 1.5f);
    views_[0].sparse_depth.emplace_back(30 + shift, 31 + shift, NAN);
    views_[0].sparse_depth.emplace_back(0.0f, 0.0f, 1.5f);  // not on the object
  }
  const PixelSampler sampler = Build();
  int with_depth = 0;
  for (int i = 0; i < config_.rays_per_step; ++i) with_depth += sampler.At(0, i).pixel.z_mu == 1.5f ? 1 : 0;
  EXPECT_EQ(with_depth, static_cast<int>(config_.rays_per_step * config_.sparse_depth_share));
  views_[0].sparse_depth.resize(12);  // 4 of them on the object
  EXPECT_EQ(Build().At(0, config_.rays_per_step - 1).pixel.z_mu, 0);
}

TEST_F(PixelSamplerTest, PairedObjectPixelsAreOfOneViewAtTheConfiguredDistance) {
  for (ObjectView& view : views_) view.depth_mu = cv::Mat(view.roi_px.size(), CV_32FC1, cv::Scalar(2));
  const PixelSampler sampler = Build();
  int paired = 0, object = 0;
  for (int i = 0; i < config_.rays_per_step; ++i) {
    const auto [pixel, is_object, partner] = sampler.At(7, i);
    EXPECT_TRUE(is_object || partner == 0);
    object += is_object ? 1 : 0;
    if (partner == 0) continue;
    ++paired;
    EXPECT_EQ(partner, i % 2 == 0 ? 1 : -1);
    const PixelSampler::Choice other = sampler.At(7, i + partner);
    EXPECT_EQ(other.partner, -partner);
    EXPECT_EQ(other.pixel.view, pixel.view);
    const double distance_px = std::hypot(pixel.u_px - other.pixel.u_px, pixel.v_px - other.pixel.v_px);
    const int mask_px = cv::countNonZero(views_[pixel.view].ray_kind == static_cast<int>(RayKind::kObject));
    const double wanted_px = 0.1 * std::sqrt(mask_px);
    EXPECT_GE(distance_px, 0.5 * wanted_px - 1);
    EXPECT_LE(distance_px, 1.5 * wanted_px + 1);
    EXPECT_EQ(KindAt(pixel), static_cast<uint8_t>(RayKind::kObject));
    const cv::Vec3b& bgr = views_[pixel.view].color_bgr.at<cv::Vec3b>(pixel.v_px, pixel.u_px);
    EXPECT_EQ(pixel.rgb, (std::array<uint8_t, 3>{bgr[2], bgr[1], bgr[0]}));
    EXPECT_EQ(pixel.z_mu, 2);
  }
  EXPECT_GT(paired, 0.9 * object);
  config_.contrast_weight = 0;
  const PixelSampler single = Build();
  for (int i = 0; i < config_.rays_per_step; ++i) EXPECT_EQ(single.At(7, i).partner, 0);
}

}  // namespace romap::nerf::pixel_sampler_test
