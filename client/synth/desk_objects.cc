// Book, box, laptop, lamp, clock, pen holder.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/synth/solids.h"

namespace romap::synth {
namespace {

// Adds a closed book lying flat with its bottom at `bottom_m`: two covers, a spine, and pages that are inset on three
// sides.
void AddBook(Solid& solid, Random& random, float half_x_m, float half_y_m, float thickness_m, float bottom_m,
             float turn_rad) {
  constexpr float kCover_m = 0.0025F;
  Material cover = RandomMaterial(Pattern::kPrint, random.UniformFloat(0.03, 0.045), random);
  cover.colors[0] = FromHsv(random.Uniform(), random.Uniform(0.2, 0.75), random.Uniform(0.35, 0.8));
  cover.colors[1] = FromHsv(random.Uniform(), 0.2, random.Chance(0.5) ? 0.95 : 0.12);
  Material pages;
  pages.pattern = Pattern::kPages;
  pages.colors = {FromHsv(0.12, 0.12, 0.92), FromHsv(0.1, 0.25, 0.6), FromHsv(0.1, 0.2, 0.5)};
  pages.scale_m = 0.0022F;
  pages.seed = static_cast<uint32_t>(random.Bits());
  const Eigen::Quaternionf turn = Turn(turn_rad, Point::UnitZ());
  const auto add = [&](const Point& center, const Point& half, float edge_m, const Material& material) {
    solid.parts.push_back({Moved(RoundedBox(center, half, edge_m), turn, Point(0, 0, bottom_m)), material});
  };
  const float inner_m = thickness_m - 2 * kCover_m;
  add({0, 0, 0.5F * kCover_m}, {half_x_m, half_y_m, 0.5F * kCover_m}, 0.002F, cover);
  add({0, 0, thickness_m - 0.5F * kCover_m}, {half_x_m, half_y_m, 0.5F * kCover_m}, 0.002F, cover);
  add({-half_x_m + 0.5F * kCover_m, 0, 0.5F * thickness_m}, {0.5F * kCover_m, half_y_m, 0.5F * thickness_m - 0.0004F},
      0.002F, cover);
  add({-0.002F, 0, 0.5F * thickness_m}, {half_x_m - 0.004F, half_y_m - 0.005F, 0.5F * inner_m + 0.0004F}, 0.001F,
      pages);
}

// A curved tube through the given points, e.g. the stem of a lamp.
Mesh Arm(const std::vector<Point>& corners, float radius_m) { return Tube(Smooth(corners, 8), radius_m); }

}  // namespace

Solid MakeBook(Random& random) {
  Solid solid{"book", {}};
  const int books = 1 + random.Below(3);
  float bottom_m = 0;
  float half_x_m = random.UniformFloat(0.065, 0.085);
  for (int i = 0; i < books; ++i) {
    const float thickness_m = random.UniformFloat(0.018, 0.036);
    AddBook(solid, random, half_x_m, half_x_m * random.UniformFloat(1.3, 1.5), thickness_m, bottom_m,
            i == 0 ? 0.0F : random.UniformFloat(-0.25, 0.25));
    bottom_m += thickness_m;
    half_x_m *= random.UniformFloat(0.82, 0.97);
  }
  return solid;
}

Solid MakeBox(Random& random) {
  const Point half(random.UniformFloat(0.03, 0.06), random.UniformFloat(0.045, 0.075), random.UniformFloat(0.04, 0.1));
  Material print = RandomMaterial(Pattern::kPrint, random.UniformFloat(0.028, 0.04), random);
  return {"box", {{RoundedBox(Point(0, 0, half.z()), half, 0.003F), print}}};
}

Solid MakeLaptop(Random& random) {
  const Point half(random.UniformFloat(0.1, 0.125), random.UniformFloat(0.075, 0.088), 0.007F);
  const float tilt_rad = random.UniformFloat(0.15, 0.45);
  Material shell = RandomMaterial(Pattern::kPlain, 0.02F, random);
  shell.colors[0] = FromHsv(random.Uniform(), 0.06, random.Uniform(0.45, 0.75));
  Material keys = RandomMaterial(Pattern::kTiles, 0.014F, random);
  keys.colors = {FromHsv(0.6, 0.05, 0.2), FromHsv(0.6, 0.05, 0.28), FromHsv(0.6, 0.03, 0.55)};
  const Material screen = RandomMaterial(Pattern::kPrint, 0.035F, random);
  // The lid rises from the back edge and leans backward (+y).
  const Eigen::Quaternionf lean = Turn(0.5F * std::numbers::pi_v<float> - tilt_rad, Point::UnitX());
  const Point hinge(0, half.y() - 0.004F, 2 * half.z());
  return {
      "laptop",
      {{RoundedBox(Point(0, 0, half.z()), half, 0.006F), shell},
       {RoundedBox(Point(0, 0.25F * half.y(), 2 * half.z()), Point(0.9F * half.x(), 0.55F * half.y(), 0.0012F), 0.002F),
        keys},
       {Moved(RoundedBox(Point(0, half.y(), 0), Point(half.x(), half.y(), 0.004F), 0.006F), lean, hinge), shell},
       {Moved(RoundedBox(Point(0, half.y(), 0.004F), Point(0.92F * half.x(), 0.88F * half.y(), 0.0008F), 0.002F), lean,
              hinge),
        screen}}};
}

Solid MakeLamp(Random& random) {
  const float height_m = random.UniformFloat(0.22, 0.29);
  const float reach_m = random.UniformFloat(0.05, 0.08);
  const float shade_m = random.UniformFloat(0.045, 0.058);
  const Profile base =
      Smooth(Profile{{0.055F, 0}, {0.056F, 0.006F}, {0.045F, 0.013F}, {0.012F, 0.018F}, {0.006F, 0.026F}});
  // A cone that is open at the bottom, with an inner and an outer side.
  const float top_m = 0.055F;
  const Profile shade = {{0.003F, top_m - 0.006F},
                         {0.013F, top_m - 0.006F},
                         {shade_m - 0.003F, 0.001F},
                         {shade_m - 0.002F, 0},
                         {shade_m, 0},
                         {shade_m, 0.002F},
                         {0.016F, top_m - 0.004F},
                         {0.016F, top_m + 0.012F},
                         {0.012F, top_m + 0.015F}};
  const Material metal = RandomMaterial(Pattern::kPlain, 0.02F, random);
  const Material cloth = RandomMaterial(random.Chance(0.5) ? Pattern::kStripes : Pattern::kChecks, 0.012F, random);
  const std::vector<Point> arm = {{0, 0, 0.02F},
                                  {-0.25F * reach_m, 0, 0.35F * height_m},
                                  {-0.3F * reach_m, 0, 0.7F * height_m},
                                  {0.3F * reach_m, 0, 0.97F * height_m},
                                  {reach_m, 0, height_m},
                                  {reach_m + 0.012F, 0, height_m - 0.02F}};
  return {"lamp",
          {{Revolve(base), metal},
           {Arm(arm, 0.0035F), metal},
           {Moved(Revolve(shade), Turn(-0.45F, Point::UnitY()), Point(reach_m + 0.03F, 0, height_m - top_m - 0.028F)),
            cloth}}};
}

Solid MakeClock(Random& random) {
  const float radius_m = random.UniformFloat(0.045, 0.062);
  const float half_depth_m = random.UniformFloat(0.014, 0.02);
  const Profile drum = {{0.9F * radius_m, -half_depth_m}, {radius_m, -0.8F * half_depth_m},
                        {radius_m, 0.85F * half_depth_m}, {0.97F * radius_m, half_depth_m},
                        {0.9F * radius_m, half_depth_m},  {0.88F * radius_m, 0.7F * half_depth_m}};
  const Eigen::Quaternionf upright = Turn(0.5F * std::numbers::pi_v<float>, Point::UnitX());
  const Point center(0, 0, radius_m + 0.012F);
  const float face_m = -0.7F * half_depth_m;  // the face points to -y after the rotation
  Solid solid{"clock", {{Moved(Revolve(drum), upright, center), RandomMaterial(Pattern::kSpeckle, 0.02F, random)}}};
  const Material marks = RandomMaterial(Pattern::kPlain, 0.01F, random);
  for (int hour = 0; hour < 12; ++hour) {
    const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(hour) / 12;
    const Point p(0.72F * radius_m * std::sin(angle), face_m, 0.72F * radius_m * std::cos(angle));
    solid.parts.push_back({Moved(RoundedBox(Point::Zero(), Point(0.0022F, 0.0015F, 0.006F), 0.0008F),
                                 Turn(angle, Point::UnitY()), center + p),
                           marks});
  }
  for (const auto& [angle, length] :
       {std::pair{random.UniformFloat(0, 6.28), 0.3F}, std::pair{random.UniformFloat(0, 6.28), 0.55F}}) {
    const Point along(std::sin(angle), 0, std::cos(angle));
    solid.parts.push_back(
        {Moved(RoundedBox(Point::Zero(), Point(0.0018F, 0.0018F, 0.5F * length * radius_m), 0.0008F),
               Turn(angle, Point::UnitY()), center + Point(0, face_m, 0) + 0.45F * length * radius_m * along),
         marks});
  }
  for (const float side : {-1.0F, 1.0F}) {
    solid.parts.push_back(
        {Tube({Point(side * 0.75F * radius_m, 0, 0), Point(side * 0.45F * radius_m, 0, 0.35F * radius_m)}, 0.005F),
         marks});
  }
  return solid;
}

Solid MakePenHolder(Random& random) {
  const float radius_m = random.UniformFloat(0.034, 0.042);
  const float height_m = random.UniformFloat(0.085, 0.105);
  const Profile holder = {
      {radius_m, 0}, {radius_m, height_m}, {radius_m - 0.003F, height_m}, {radius_m - 0.003F, 0.004F}};
  Solid solid{"pen holder",
              {{Revolve(holder), RandomMaterial(random.Chance(0.5) ? Pattern::kChecks : Pattern::kWood,
                                                random.UniformFloat(0.008, 0.014), random)}}};
  const int pens = 3 + random.Below(3);
  for (int i = 0; i < pens; ++i) {
    const float angle = 2 * std::numbers::pi_v<float> * (static_cast<float>(i) + random.UniformFloat(0, 0.5)) /
                        static_cast<float>(pens);
    const Point across(std::cos(angle), std::sin(angle), 0);
    const float length_m = random.UniformFloat(0.14, 0.18);
    const Point foot = -0.45F * radius_m * across + Point(0, 0, 0.005F);
    const Point tip = 0.8F * radius_m * across + Point(0, 0, 0.005F + length_m);
    const Point along = tip - foot;
    const std::vector<Point> path = {foot, foot + 0.9F * along, foot + 0.92F * along, tip};
    const std::vector<float> radius = {0.004F, 0.004F, 0.0036F, 0.0012F};
    solid.parts.push_back(
        {Sweep(path, radius, radius), RandomMaterial(Pattern::kStripes, random.UniformFloat(0.01, 0.03), random)});
  }
  return solid;
}

}  // namespace romap::synth
