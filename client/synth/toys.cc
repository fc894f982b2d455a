// Chair, bear, duck and car, in the size of toys.

#include <array>
#include <cmath>
#include <numbers>

#include "client/synth/solids.h"

namespace romap::synth {
namespace {}  // namespace

Solid MakeChair(Random& random) {
  const float half_m = random.UniformFloat(0.045, 0.055);
  const float seat_m = random.UniformFloat(0.09, 0.11);
  const float back_m = seat_m + random.UniformFloat(0.1, 0.13);
  const float leg_m = random.UniformFloat(0.005, 0.0065);
  const Material wood = RandomMaterial(Pattern::kWood, 0.009F, random);
  const Material cushion = RandomMaterial(Pattern::kChecks, random.UniformFloat(0.01, 0.014), random);
  Solid solid{"chair", {}};
  const auto add = [&](const Point& low, const Point& high, const Material& material, float edge_m) {
    solid.parts.push_back({RoundedBox(0.5F * (low + high), 0.5F * (high - low), edge_m), material});
  };
  add({-half_m, -half_m, seat_m}, {half_m, half_m, seat_m + 0.01F}, wood, 0.003F);
  add({-0.85F * half_m, -0.9F * half_m, seat_m + 0.008F}, {0.85F * half_m, 0.7F * half_m, seat_m + 0.018F}, cushion,
      0.006F);
  for (const float x : {-half_m + leg_m, half_m - leg_m}) {
    add({x - leg_m, -half_m, 0}, {x + leg_m, -half_m + 2 * leg_m, seat_m + 0.004F}, wood, 0.002F);
    add({x - leg_m, half_m - 2 * leg_m, 0}, {x + leg_m, half_m, back_m}, wood, 0.002F);
    add({x - 0.6F * leg_m, -half_m + leg_m, 0.4F * seat_m},
        {x + 0.6F * leg_m, half_m - leg_m, 0.4F * seat_m + 1.2F * leg_m}, wood, 0.001F);
  }
  for (const float share : {0.35F, 0.65F, 0.95F}) {
    const float z = seat_m + share * (back_m - seat_m);
    add({-half_m + leg_m, half_m - 1.6F * leg_m, z - 0.012F}, {half_m - leg_m, half_m - 0.5F * leg_m, z}, wood, 0.001F);
  }
  return solid;
}

Solid MakeBear(Random& random) {
  const float size_m = random.UniformFloat(0.055, 0.075);  // half height of the body
  Material fur = RandomMaterial(Pattern::kFabric, 0.02F, random);
  fur.grain = 0.5F;
  Material pads = fur;
  pads.colors[0] = fur.colors[0] * 0.5F + Rgb::Constant(0.35F);
  pads.colors[1] = pads.colors[0] * 0.8F;
  Material dark;
  dark.colors[0] = Rgb(0.015F, 0.012F, 0.01F);
  Solid solid{"teddy bear", {}};
  const auto add = [&](const Point& center, const Point& half_axes, const Material& material) {
    solid.parts.push_back({Ellipsoid(size_m * center, size_m * half_axes), material});
  };
  add({0, 0, 0.85F}, {0.72F, 0.62F, 0.85F}, fur);
  add({0, -0.5F, 0.8F}, {0.42F, 0.2F, 0.52F}, pads);
  add({0, -0.08F, 2.1F}, {0.62F, 0.56F, 0.56F}, fur);
  add({0, -0.58F, 1.97F}, {0.28F, 0.24F, 0.22F}, pads);
  add({0, -0.8F, 2.05F}, {0.09F, 0.06F, 0.06F}, dark);
  for (const float side : {-1.0F, 1.0F}) {
    add({side * 0.5F, 0, 2.58F}, {0.24F, 0.12F, 0.24F}, fur);
    add({side * 0.22F, -0.56F, 2.26F}, {0.07F, 0.05F, 0.08F}, dark);
    add({side * 0.85F, -0.25F, 1.15F}, {0.22F, 0.5F, 0.24F}, fur);
    add({side * 0.5F, -0.75F, 0.28F}, {0.28F, 0.62F, 0.28F}, fur);
    add({side * 0.5F, -1.3F, 0.36F}, {0.26F, 0.14F, 0.34F}, pads);
  }
  return solid;
}

Solid MakeDuck(Random& random) {
  const float size_m = random.UniformFloat(0.04, 0.055);
  Material body = RandomMaterial(Pattern::kPlain, 0.02F, random);
  body.colors[0] = FromHsv(random.Uniform(0.08, 0.17), 0.8, 0.95);
  body.grain = 0.05F;
  Material beak;
  beak.colors[0] = FromHsv(0.04, 0.9, 0.9);
  Material dark;
  dark.colors[0] = Rgb(0.015F, 0.012F, 0.01F);
  const Material wing = RandomMaterial(Pattern::kStripes, 0.008F, random);
  Solid solid{"bird", {}};
  const auto add = [&](const Point& center, const Point& half_axes, const Material& material) {
    solid.parts.push_back({Ellipsoid(size_m * center, size_m * half_axes), material});
  };
  add({0, 0, 0.62F}, {1.15F, 0.78F, 0.62F}, body);
  add({0.55F, 0, 1.55F}, {0.55F, 0.52F, 0.52F}, body);
  add({0.3F, 0, 1.05F}, {0.5F, 0.42F, 0.5F}, body);
  add({1.1F, 0, 1.48F}, {0.3F, 0.22F, 0.09F}, beak);
  const std::vector<Point> tail = {size_m * Point(-0.8F, 0, 0.75F), size_m * Point(-1.15F, 0, 1.0F),
                                   size_m * Point(-1.4F, 0, 1.35F)};
  solid.parts.push_back({Sweep(tail, std::vector<float>{0.4F * size_m, 0.3F * size_m, 0.08F * size_m},
                               std::vector<float>{0.25F * size_m, 0.15F * size_m, 0.04F * size_m}),
                         body});
  for (const float side : {-1.0F, 1.0F}) {
    add({0.85F, side * 0.34F, 1.7F}, {0.09F, 0.08F, 0.1F}, dark);
    add({-0.2F, side * 0.74F, 0.78F}, {0.55F, 0.12F, 0.3F}, wing);
  }
  return solid;
}

Solid MakeCar(Random& random) {
  const float half_x = random.UniformFloat(0.07, 0.09);  // half length
  const float half_y = 0.42F * half_x;
  const float wheel_m = 0.2F * half_x;
  Material paint = RandomMaterial(random.Chance(0.5) ? Pattern::kPlain : Pattern::kStripes, 0.02F, random);
  paint.grain = 0.05F;
  Material glass = RandomMaterial(Pattern::kPrint, 0.02F, random);
  Material tire;
  tire.colors[0] = Rgb::Constant(0.03F);
  tire.grain = 0.4F;
  const Material hub = RandomMaterial(Pattern::kDots, 0.006F, random);
  const float floor_m = 0.7F * wheel_m;
  Solid solid{"car", {}};
  solid.parts.push_back(
      {RoundedBox(Point(0, 0, floor_m + 0.17F * half_x), Point(half_x, half_y, 0.17F * half_x), 0.012F), paint});
  // The cabin: a loft that narrows towards the roof.
  std::vector<Ring> rings;
  const float deck_m = floor_m + 0.33F * half_x;
  for (const auto& [height, front, back, side] :
       {std::array{0.0F, 0.45F, -0.75F, 0.92F}, std::array{0.22F, 0.2F, -0.62F, 0.82F},
        std::array{0.3F, 0.1F, -0.5F, 0.7F}}) {
    Ring ring;
    const int around = 48;
    for (int j = 0; j < around; ++j) {
      const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(j) / around;
      // A superellipse: a rectangle with rounded corners.
      const float c = std::cos(angle), s = std::sin(angle);
      const float x = std::copysign(std::sqrt(std::abs(c)), c), y = std::copysign(std::sqrt(std::abs(s)), s);
      const float middle = 0.5F * (front + back), half = 0.5F * (front - back);
      ring.emplace_back(half_x * (middle + half * x), half_y * side * y, deck_m + height * half_x);
    }
    rings.push_back(std::move(ring));
  }
  const float cabin_x = -0.15F * half_x;
  solid.parts.push_back({Loft(rings, Point(cabin_x, 0, deck_m), Point(cabin_x, 0, deck_m + 0.3F * half_x)), glass});
  const Profile wheel = {{0.9F * wheel_m, -0.4F * wheel_m},
                         {wheel_m, -0.3F * wheel_m},
                         {wheel_m, 0.3F * wheel_m},
                         {0.9F * wheel_m, 0.4F * wheel_m}};
  const Profile cap = {{0.5F * wheel_m, -0.46F * wheel_m}, {0.5F * wheel_m, 0.46F * wheel_m}};
  for (const float x : {-0.6F, 0.58F}) {
    for (const float side : {-1.0F, 1.0F}) {
      const Point center(x * half_x, side * (half_y - 0.05F * wheel_m), wheel_m);
      solid.parts.push_back(
          {Moved(Revolve(wheel), Turn(0.5F * std::numbers::pi_v<float>, Point::UnitX()), center), tire});
      solid.parts.push_back({Moved(Revolve(cap), Turn(0.5F * std::numbers::pi_v<float>, Point::UnitX()), center), hub});
    }
  }
  return solid;
}

}  // namespace romap::synth
