// Every loss term of a ray: its gradient compared with finite differences, and its value.
#include "server/nerf/math/losses.h"

#include <gtest/gtest.h>

#include <array>
#include <string>

#include "server/nerf/math/activation.h"
#include "server/nerf/math/composite.h"
#include "server/nerf/math/random.h"
#include "tests/unit/server/nerf/math/gradient_check.h"

namespace romap::nerf::losses_test {

constexpr int kSamples = 9;

struct LossCase {
  std::string name = {};
  LossWeights weights = {};
  bool is_object = true;
  float depth = -1;
  bool has_partner = false;
};

const RayTarget kTarget{.rgb = {0.9f, 0.2f, 0.4f}, .background = {0.1f, 0.7f, 0.3f}};
constexpr float kPartnerError[3] = {0.2f, -0.3f, 0.1f};

RayTarget TargetOf(const LossCase& c) {
  RayTarget target = kTarget;
  target.is_object = c.is_object;
  target.depth = c.depth;
  return target;
}

// One ray of kSamples samples with random raw outputs.
struct TestRay {
  std::array<float, kSamples> t = {}, length = {}, alpha = {}, density = {}, weight = {}, behind = {};
  std::array<std::array<float, kSamples>, 3> rgb = {};
  std::array<float, kSamples* kOutputs> raw = {};

  TestRay() {
    for (size_t i = 0; i < kSamples; ++i) {
      t[i] = 2.0f + 0.1f * static_cast<float>(i);
      length[i] = 0.1f;
    }
    for (size_t i = 0; i < raw.size(); ++i) raw[i] = 2.0f * RandomUniform(11, 4, i) - 1.0f;
  }
  RaySamples Samples() const {
    return {kSamples,     t.data(),       length.data(),
            alpha.data(), density.data(), {rgb[0].data(), rgb[1].data(), rgb[2].data()}};
  }
  RayResult Render(float target_depth) {
    for (size_t i = 0; i < kSamples; ++i) {
      for (size_t c = 0; c < 3; ++c) rgb[c][i] = plain::Sigmoid(raw[kOutputs * i + c]);
      density[i] = plain::Density(raw[kOutputs * i + 3]);
      alpha[i] = plain::StepOpacity(density[i], length[i]);
    }
    return plain::CompositeForward(Samples(), target_depth, weight.data(), behind.data());
  }
};

RayLoss LossOf(const RayResult& result, const LossCase& c) {
  return plain::LossOfRay(result, TargetOf(c), c.weights, c.has_partner, kPartnerError);
}

class LossGradientTest : public ::testing::TestWithParam<LossCase> {};

TEST_P(LossGradientTest, MatchesFiniteDifferences) {
  const LossCase& c = GetParam();
  TestRay ray;
  // The loss of a pair consists of the contrast of both rays; the error of the partner is constant here, and its own
  // half of the contrast is the same as that of this ray.
  const auto loss = [&] {
    const RayLoss own = LossOf(ray.Render(c.depth), c);
    LossCase alone = c;
    alone.has_partner = false;
    const float rest = LossOf(ray.Render(c.depth), alone).value;
    return static_cast<double>(rest) + 2.0 * static_cast<double>(own.value - rest);
  };
  const RayLoss own = LossOf(ray.Render(c.depth), c);
  std::array<float, kSamples* kOutputs> d_raw = {};
  plain::CompositeBackward(ray.Samples(), c.depth, own, ray.weight.data(), ray.behind.data(), d_raw.data());
  testing_support::ExpectGradient(loss, ray.raw.data(), d_raw.data(), d_raw.size(), d_raw.size(), 1e-2f, 5e-3);
}

INSTANTIATE_TEST_SUITE_P(
    Terms, LossGradientTest,
    ::testing::Values(LossCase{.name = "Color", .weights = {}},
                      LossCase{.name = "ColorOverRandomBackground", .weights = {.random_background = true}},
                      LossCase{.name = "BackgroundColor", .weights = {.random_background = true}, .is_object = false},
                      LossCase{.name = "Contrast", .weights = {.contrast = 3}, .has_partner = true},
                      LossCase{.name = "ContrastOverRandomBackground",
                               .weights = {.contrast = 3, .random_background = true},
                               .has_partner = true},
                      LossCase{.name = "ObjectOpacity", .weights = {.opacity_object = 5}},
                      LossCase{.name = "BackgroundOpacity", .weights = {.opacity_background = 5}, .is_object = false},
                      LossCase{.name = "Density", .weights = {.density = 5}, .is_object = false},
                      LossCase{.name = "Depth", .weights = {.depth = 5, .depth_limit = 10}, .depth = 2.2f},
                      LossCase{.name = "AllOnAnObject",
                               .weights = {.opacity_object = 0.5f, .density = 0.01f, .depth = 0.5f, .depth_limit = 10},
                               .depth = 2.2f},
                      LossCase{.name = "AllOnBackground",
                               .weights = {.opacity_background = 0.5f, .density = 0.01f, .random_background = true},
                               .is_object = false}),
    [](const auto& info) { return info.param.name; });

TEST(LossOfRayTest, IsTheSumOfItsTerms) {
  const LossWeights weights{
      .opacity_object = 2, .opacity_background = 3, .density = 0.5f, .depth = 4, .contrast = 3, .depth_limit = 0.2f};
  RayResult ray{};
  ray.rgb[0] = 0.5f;
  ray.opacity = 0.75f;
  ray.depth_error = -0.1f;
  ray.density_sum = 6;
  RayTarget target;
  target.rgb[0] = 0.25f;
  target.depth = 1;
  const float partner_error[3] = {0.05f, 0, 0};
  const float color = 0.25f * 0.25f, contrast = 3 * 0.2f * 0.2f;
  EXPECT_FLOAT_EQ(plain::LossOfRay(ray, target, weights, false, nullptr).color, color);
  EXPECT_FLOAT_EQ(plain::LossOfRay(ray, target, weights, false, nullptr).value, color + 2 * 0.25f + 4 * 0.1f);
  EXPECT_FLOAT_EQ(plain::LossOfRay(ray, target, weights, true, partner_error).value,
                  color + 2 * 0.25f + 4 * 0.1f + 0.5f * contrast)
      << "half of the contrast belongs to the partner";
  target.is_object = false;
  EXPECT_FLOAT_EQ(plain::LossOfRay(ray, target, weights, false, nullptr).value, 3 * 0.75f + 0.5f * 6)
      << "background rays have no color without a random background";
}

TEST(LossOfRayTest, OutlierDepthsHaveAConstantLoss) {
  const LossWeights weights{.depth = 1, .depth_limit = 0.2f};
  RayTarget target;
  target.depth = 1;
  RayResult ray{};
  ray.depth_error = 0.1f;
  EXPECT_EQ(plain::LossOfRay(ray, target, weights, false, nullptr).d_depth_error, 1);
  ray.depth_error = 0.9f;
  const RayLoss outlier = plain::LossOfRay(ray, target, weights, false, nullptr);
  EXPECT_EQ(outlier.d_depth_error, 0);
  EXPECT_FLOAT_EQ(outlier.value, 0.2f);
}

}  // namespace romap::nerf::losses_test
