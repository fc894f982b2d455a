// Vase with flowers, potted plant, apple.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/synth/solids.h"

namespace romap::synth {
namespace {

Material Greenery(Random& random, float scale_m) {
  Material leaf = RandomMaterial(Pattern::kLeaf, scale_m, random);
  const double hue = random.Uniform(0.24, 0.38);
  leaf.colors = {FromHsv(hue, 0.65, 0.55), FromHsv(hue + 0.04, 0.7, 0.35), FromHsv(hue - 0.06, 0.45, 0.75)};
  return leaf;
}

// A leaf along an arc that starts at `foot` in the direction `heading_rad` and bends down.
Mesh LeafBlade(const Point& foot, float heading_rad, float length_m, float width_m, float rise) {
  const Point out(std::cos(heading_rad), std::sin(heading_rad), 0);
  const std::vector<Point> path = Smooth(std::vector<Point>{
      foot, foot + length_m * (0.3F * out + Point(0, 0, 0.45F * rise)),
      foot + length_m * (0.62F * out + Point(0, 0, 0.62F * rise)), foot + length_m * (out + Point(0, 0, 0.4F * rise))});
  std::vector<float> width(path.size()), thickness(path.size());
  for (size_t i = 0; i < path.size(); ++i) {
    const float t = static_cast<float>(i) / static_cast<float>(path.size() - 1);
    width[i] = 0.0012F + width_m * std::sin(std::numbers::pi_v<float> * std::pow(t, 0.8F)) * (1 - 0.3F * t);
    thickness[i] = 0.0012F;
  }
  return Sweep(path, width, thickness);
}

void AddFlower(Solid& solid, Random& random, const Point& root, const Material& green) {
  const float lean = random.UniformFloat(0, 2 * std::numbers::pi_v<float>);
  const float reach_m = random.UniformFloat(0.01, 0.035);
  const float height_m = random.UniformFloat(0.1, 0.14);
  const Point head = root + Point(reach_m * std::cos(lean), reach_m * std::sin(lean), height_m);
  const Point middle = root + Point(0.2F * reach_m * std::cos(lean), 0.2F * reach_m * std::sin(lean), 0.5F * height_m);
  solid.parts.push_back({Tube(Smooth(std::vector<Point>{root - Point(0, 0, 0.05F), middle, head}), 0.0022F), green});
  Material petal = RandomMaterial(Pattern::kSpeckle, 0.012F, random);
  const int petals = 5 + random.Below(3);
  const float radius_m = random.UniformFloat(0.014, 0.02);
  for (int i = 0; i < petals; ++i) {
    const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(petals);
    const Eigen::Quaternionf turn = Turn(angle, Point::UnitZ()) * Turn(-0.35F, Point::UnitY());
    const Mesh blade = Ellipsoid(Point(radius_m, 0, 0), Point(radius_m, 0.55F * radius_m, 0.0025F));
    solid.parts.push_back({Moved(blade, turn, head), petal});
  }
  Material heart;
  heart.colors[0] = FromHsv(random.Uniform(0.08, 0.16), 0.85, 0.85);
  heart.grain = 0.5F;
  solid.parts.push_back({Ellipsoid(head + Point(0, 0, 0.002F), Point(0.007F, 0.007F, 0.005F)), heart});
}

}  // namespace

Solid MakeVase(Random& random) {
  const float radius_m = random.UniformFloat(0.034, 0.044);
  const float height_m = random.UniformFloat(0.12, 0.16);
  const float wall_m = 0.0035F;
  const Profile outside = Smooth(Profile{{0.6F * radius_m, 0},
                                         {0.66F * radius_m, 0.004F},
                                         {radius_m, 0.35F * height_m},
                                         {0.72F * radius_m, 0.68F * height_m},
                                         {0.42F * radius_m, 0.86F * height_m},
                                         {0.55F * radius_m, height_m}});
  Profile profile = outside;
  for (size_t i = outside.size(); i-- > 0;) {
    if (outside[i].y() > 0.4F * height_m) profile.emplace_back(outside[i].x() - wall_m, outside[i].y());
  }
  constexpr Pattern kPatterns[] = {Pattern::kMarble, Pattern::kStripes, Pattern::kSpeckle, Pattern::kChecks};
  Solid solid{
      "vase",
      {{Revolve(profile), RandomMaterial(kPatterns[random.Below(4)], random.UniformFloat(0.012, 0.02), random)}}};
  const Material green = Greenery(random, 0.01F);
  const int flowers = 2 + random.Below(2);
  for (int i = 0; i < flowers; ++i) {
    const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(flowers);
    const Point root(0.2F * radius_m * std::cos(angle), 0.2F * radius_m * std::sin(angle), 0.95F * height_m);
    AddFlower(solid, random, root, green);
  }
  return solid;
}

Solid MakePottedPlant(Random& random) {
  const float radius_m = random.UniformFloat(0.042, 0.055);
  const float height_m = radius_m * random.UniformFloat(1.4, 1.8);
  const Profile pot = {{0.68F * radius_m, 0},
                       {0.7F * radius_m, 0.002F},
                       {0.94F * radius_m, 0.78F * height_m},
                       {1.06F * radius_m, 0.79F * height_m},
                       {1.08F * radius_m, height_m},
                       {0.96F * radius_m, height_m},
                       {0.9F * radius_m, 0.86F * height_m}};
  Material clay = RandomMaterial(random.Chance(0.6) ? Pattern::kSpeckle : Pattern::kStripes, 0.016F, random);
  Material soil;
  soil.pattern = Pattern::kSpeckle;
  soil.colors = {FromHsv(0.07, 0.5, 0.25), FromHsv(0.07, 0.5, 0.15), FromHsv(0.09, 0.3, 0.5)};
  soil.grain = 0.6F;
  const Profile bed = {
      {0.93F * radius_m, 0.82F * height_m}, {0.92F * radius_m, 0.88F * height_m}, {0.3F * radius_m, 0.91F * height_m}};
  Solid solid{"potted plant", {{Revolve(pot), clay}, {Revolve(bed), soil}}};
  const Material green = Greenery(random, 0.012F);
  const int leaves = 9 + random.Below(5);
  for (int i = 0; i < leaves; ++i) {
    const float heading =
        2.4F * static_cast<float>(i) + random.UniformFloat(-0.2, 0.2);  // the golden angle, as in plants
    const float t = static_cast<float>(i) / static_cast<float>(leaves);
    const Point foot(0.2F * radius_m * std::cos(heading), 0.2F * radius_m * std::sin(heading), 0.87F * height_m);
    solid.parts.push_back({LeafBlade(foot, heading, random.UniformFloat(0.07, 0.095) * (1 - 0.35F * t),
                                     random.UniformFloat(0.012, 0.017), 1.1F + 1.5F * t),
                           green});
  }
  return solid;
}

Solid MakeApple(Random& random) {
  const float radius_m = random.UniformFloat(0.034, 0.042);
  const Profile body = Smooth(Profile{{0.05F * radius_m, 0.14F * radius_m},
                                      {0.3F * radius_m, 0.01F * radius_m},
                                      {0.72F * radius_m, 0.35F * radius_m},
                                      {1.0F * radius_m, 1.0F * radius_m},
                                      {0.82F * radius_m, 1.6F * radius_m},
                                      {0.4F * radius_m, 1.78F * radius_m},
                                      {0.05F * radius_m, 1.58F * radius_m}});
  Material skin = RandomMaterial(Pattern::kSpeckle, 0.05F, random);
  const double hue = random.Uniform(-0.03, 0.3);
  skin.colors = {FromHsv(hue + 1, 0.8, 0.75), FromHsv(hue + 1.08, 0.7, 0.8), FromHsv(hue + 1.05, 0.4, 0.85)};
  Material stem;
  stem.colors[0] = FromHsv(0.08, 0.5, 0.3);
  const std::vector<Point> path = Smooth(std::vector<Point>{
      {0, 0, 1.5F * radius_m}, {0.05F * radius_m, 0, 1.8F * radius_m}, {0.2F * radius_m, 0, 2.15F * radius_m}});
  return {
      "apple",
      {{Revolve(body), skin},
       {Tube(path, 0.002F), stem},
       {LeafBlade(Point(0.08F * radius_m, 0, 1.85F * radius_m), 1.0F, 0.03F, 0.008F, 0.5F), Greenery(random, 0.01F)}}};
}

}  // namespace romap::synth
