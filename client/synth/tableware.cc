// Mug, bottle, bowl, teapot, wine glass: surfaces of revolution with thick walls, handles and spouts.

#include <algorithm>
#include <cmath>

#include "client/synth/solids.h"

namespace romap::synth {
namespace {

// The profile of a hollow vessel: the outside up to the rim, then the inside, offset by the wall thickness, down to
// `floor_m` above the table.
Profile Hollow(const Profile& outside, float wall_m, float floor_m) {
  Profile profile = outside;
  const Eigen::Vector2f rim = outside.back();
  profile.emplace_back(rim.x() - 0.3F * wall_m, rim.y() + 0.35F * wall_m);
  profile.emplace_back(rim.x() - 0.7F * wall_m, rim.y() + 0.35F * wall_m);
  for (size_t i = outside.size(); i-- > 0;) {
    const float radius_m = outside[i].x() - wall_m;
    if (outside[i].y() > floor_m && radius_m > 0.003F) profile.emplace_back(radius_m, outside[i].y());
  }
  profile.emplace_back(std::max(0.003F, profile.back().x() - 0.002F), floor_m);
  return profile;
}

// A handle in the x-z plane from `top` to `bottom`, extending outward by `reach_m`.
Mesh Handle(const Point& top, const Point& bottom, float reach_m, float thickness_m) {
  const float height_m = top.z() - bottom.z();
  const std::vector<Point> path = Smooth(std::vector<Point>{
      top, top + Point(0.55F * reach_m, 0, 0.04F * height_m), top + Point(0.95F * reach_m, 0, -0.2F * height_m),
      bottom + Point(0.9F * reach_m, 0, 0.3F * height_m), bottom + Point(0.45F * reach_m, 0, 0), bottom});
  const std::vector<float> wide(path.size(), thickness_m);
  const std::vector<float> thin(path.size(), 0.7F * thickness_m);
  return Sweep(path, wide, thin);
}

}  // namespace

Solid MakeMug(Random& random) {
  const float radius_m = random.UniformFloat(0.036, 0.046);
  const float height_m = random.UniformFloat(0.08, 0.115);
  const float waist = random.UniformFloat(-0.1, 0.06);
  const float wall_m = 0.004F;
  const Profile outside = Smooth(Profile{{0.8F * radius_m, 0},
                                         {0.93F * radius_m, 0.004F},
                                         {radius_m * (1 + 0.5F * waist), 0.25F * height_m},
                                         {radius_m * (1 + waist), 0.55F * height_m},
                                         {radius_m, height_m}});
  constexpr Pattern kPatterns[] = {Pattern::kSpeckle, Pattern::kStripes, Pattern::kDots, Pattern::kPrint};
  Material glaze = RandomMaterial(kPatterns[random.Below(4)], random.UniformFloat(0.014, 0.022), random);
  glaze.wrapping = Wrapping::kCylinder;
  Material handle_glaze = glaze;
  handle_glaze.pattern = Pattern::kSpeckle;
  const float start_m = radius_m * (1 + std::min(waist, 0.0F)) - 0.5F * wall_m;
  return {"cup",
          {{Revolve(Hollow(outside, wall_m, 0.006F)), glaze},
           {Handle({start_m, 0, 0.82F * height_m}, {start_m, 0, 0.25F * height_m}, random.UniformFloat(0.03, 0.036),
                   0.0055F),
            handle_glaze}}};
}

Solid MakeBottle(Random& random) {
  const float radius_m = random.UniformFloat(0.03, 0.04);
  const float height_m = random.UniformFloat(0.2, 0.28);
  const float shoulder = random.UniformFloat(0.55, 0.68);
  const float neck_m = random.UniformFloat(0.011, 0.014);
  const Profile body = Smooth(Profile{{0.85F * radius_m, 0},
                                      {radius_m, 0.006F},
                                      {radius_m, 0.3F * height_m},
                                      {radius_m, shoulder * height_m},
                                      {0.75F * radius_m, (shoulder + 0.1F) * height_m},
                                      {neck_m, (shoulder + 0.19F) * height_m},
                                      {neck_m, 0.93F * height_m}});
  const Profile label = {{radius_m + 0.0004F, 0.16F * height_m},
                         {radius_m + 0.0008F, 0.17F * height_m},
                         {radius_m + 0.0008F, (shoulder - 0.08F) * height_m},
                         {radius_m + 0.0004F, (shoulder - 0.07F) * height_m}};
  const Profile cap = {{neck_m + 0.002F, 0.91F * height_m},
                       {neck_m + 0.0025F, 0.92F * height_m},
                       {neck_m + 0.0025F, 0.995F * height_m},
                       {neck_m + 0.001F, height_m}};
  Material paper = RandomMaterial(Pattern::kPrint, random.UniformFloat(0.024, 0.032), random);
  paper.wrapping = Wrapping::kCylinder;
  paper.colors[0] = FromHsv(random.Uniform(), 0.12, 0.92);
  return {"bottle",
          {{Revolve(body), RandomMaterial(Pattern::kSpeckle, 0.03F, random)},
           {Revolve(label), paper},
           {Revolve(cap), RandomMaterial(Pattern::kPlain, 0.01F, random)}}};
}

Solid MakeBowl(Random& random) {
  const float radius_m = random.UniformFloat(0.065, 0.095);
  const float height_m = radius_m * random.UniformFloat(0.55, 0.8);
  const Profile outside = Smooth(Profile{{0.42F * radius_m, 0},
                                         {0.44F * radius_m, 0.006F},
                                         {0.72F * radius_m, 0.3F * height_m},
                                         {0.92F * radius_m, 0.65F * height_m},
                                         {radius_m, height_m}});
  constexpr Pattern kPatterns[] = {Pattern::kMarble, Pattern::kDots, Pattern::kWood, Pattern::kStripes};
  Material glaze = RandomMaterial(kPatterns[random.Below(4)], random.UniformFloat(0.014, 0.024), random);
  return {"bowl", {{Revolve(Hollow(outside, 0.005F, 0.009F)), glaze}}};
}

Solid MakeTeapot(Random& random) {
  const float radius_m = random.UniformFloat(0.055, 0.07);
  const float height_m = radius_m * random.UniformFloat(1.35, 1.7);
  const Profile body = Smooth(Profile{{0.6F * radius_m, 0},
                                      {0.68F * radius_m, 0.006F},
                                      {0.97F * radius_m, 0.3F * height_m},
                                      {0.98F * radius_m, 0.55F * height_m},
                                      {0.72F * radius_m, 0.88F * height_m},
                                      {0.5F * radius_m, 0.98F * height_m}});
  const Profile lid = Smooth(Profile{{0.54F * radius_m, 0.96F * height_m},
                                     {0.53F * radius_m, 1.0F * height_m},
                                     {0.3F * radius_m, 1.1F * height_m},
                                     {0.1F * radius_m, 1.15F * height_m},
                                     {0.14F * radius_m, 1.24F * height_m},
                                     {0.07F * radius_m, 1.29F * height_m}});
  const std::vector<Point> spout = Smooth(std::vector<Point>{{-0.85F * radius_m, 0, 0.3F * height_m},
                                                             {-1.25F * radius_m, 0, 0.45F * height_m},
                                                             {-1.45F * radius_m, 0, 0.75F * height_m},
                                                             {-1.75F * radius_m, 0, 0.95F * height_m}});
  std::vector<float> spout_radius_m(spout.size());
  for (size_t i = 0; i < spout.size(); ++i) {
    const float share = static_cast<float>(i) / static_cast<float>(spout.size() - 1);
    spout_radius_m[i] = radius_m * (0.28F - 0.17F * std::sqrt(share));
  }
  Material glaze = RandomMaterial(random.Chance(0.5) ? Pattern::kSpeckle : Pattern::kMarble,
                                  random.UniformFloat(0.02, 0.035), random);
  return {"teapot",
          {{Revolve(body), glaze},
           {Revolve(lid), glaze},
           {Sweep(spout, spout_radius_m, spout_radius_m), glaze},
           {Handle({0.75F * radius_m, 0, 0.8F * height_m}, {0.9F * radius_m, 0, 0.25F * height_m}, 0.75F * radius_m,
                   0.006F),
            RandomMaterial(Pattern::kWood, 0.006F, random)}}};
}

Solid MakeWineGlass(Random& random) {
  const float radius_m = random.UniformFloat(0.033, 0.042);
  const float height_m = random.UniformFloat(0.15, 0.19);
  const float bowl_m = 0.52F * height_m;  // height at which the stem meets the bowl
  Profile outside = {{0.95F * radius_m, 0}, {0.95F * radius_m, 0.002F}, {0.5F * radius_m, 0.005F}};
  const Profile stem_and_bowl = Smooth(Profile{{0.0052F, 0.014F},
                                               {0.0038F, 0.25F * height_m},
                                               {0.005F, 0.97F * bowl_m},
                                               {0.7F * radius_m, bowl_m + 0.1F * height_m},
                                               {radius_m, bowl_m + 0.26F * height_m},
                                               {0.82F * radius_m, height_m}});
  outside.insert(outside.end(), stem_and_bowl.begin(), stem_and_bowl.end());
  constexpr Pattern kPatterns[] = {Pattern::kStripes, Pattern::kSpeckle, Pattern::kDots};
  Material glass = RandomMaterial(kPatterns[random.Below(3)], random.UniformFloat(0.01, 0.016), random);
  return {"wine glass", {{Revolve(Hollow(outside, 0.0025F, bowl_m + 0.01F)), glass}}};
}

}  // namespace romap::synth
