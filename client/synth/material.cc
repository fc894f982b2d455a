#include "client/synth/material.h"

#include <algorithm>
#include <cmath>

#include "client/synth/noise.h"

namespace romap::synth {
namespace {

// A surface point to evaluate, and the side of a pixel there.
struct Spot {
  Eigen::Vector3f p_m;
  Eigen::Vector3f normal;
  float footprint_m;
};

float SmoothStep(float low, float high, float x) {
  const float t = std::clamp((x - low) / (high - low), 0.0F, 1.0F);
  return t * t * (3 - 2 * t);
}

Rgb Mix(const Rgb& a, const Rgb& b, float share_of_b) { return a + share_of_b * (b - a); }

// A square wave of period 1 with values 0 and 1, and transitions of width `blur`. Tends to 0.5 when the bands are not
// resolved.
float Bands(float x, float blur) {
  const float width = std::clamp(blur, 1e-4F, 1.0F);
  const float triangle = 2 * std::abs(x - std::floor(x) - 0.5F) - 0.5F;  // -0.5..0.5, sign flips between bands
  const float sharp = std::clamp(0.5F - triangle / (2 * width), 0.0F, 1.0F);
  return std::lerp(sharp, 0.5F, SmoothStep(0.4F, 1.0F, width));
}

Rgb Speckle(const Material& m, const Spot& s) {
  const float clouds = FractalNoise(s.p_m, m.scale_m, 4, 0.6F, s.footprint_m, m.seed);
  const float specks = FractalNoise(s.p_m, 0.16F * m.scale_m, 2, 0.5F, s.footprint_m, m.seed + 31);
  const Rgb base = Mix(m.colors[0], m.colors[1], SmoothStep(-0.1F, 0.35F, clouds));
  return Mix(base, m.colors[2], SmoothStep(0.25F, 0.4F, specks));
}

Rgb Stripes(const Material& m, const Spot& s) {
  const float wave = 0.25F * FractalNoise(s.p_m, 3 * m.scale_m, 2, 0.5F, s.footprint_m, m.seed);
  const float x = s.p_m.z() / m.scale_m + wave;
  const auto band = static_cast<int32_t>(std::floor(x));
  const float share = Bands(x, s.footprint_m / m.scale_m);
  // Bands of the second color may have the third color instead.
  const Rgb& second = CellUniform(band, 0, 0, m.seed) < 0.4F ? m.colors[2] : m.colors[1];
  return Mix(m.colors[0], second, share);
}

Rgb Checks(const Material& m, const Spot& s) {
  const float blur = s.footprint_m / m.scale_m;
  // The offset keeps faces at round coordinates away from the border of two layers.
  const Eigen::Vector3f q = s.p_m / (2 * m.scale_m) + Eigen::Vector3f(0.13F, 0.17F, 0.11F);
  float product = 1;
  for (int k = 0; k < 3; ++k) {
    if (std::abs(s.normal[k]) < 0.8F) product *= 2 * Bands(q[k], blur) - 1;
  }
  return Mix(m.colors[0], m.colors[1], 0.5F + 0.5F * product);
}

Rgb Dots(const Material& m, const Spot& s) {
  const Eigen::Vector3f q = s.p_m / m.scale_m;
  const Eigen::Vector3f cell(std::floor(q.x()), std::floor(q.y()), std::floor(q.z()));
  const auto x = static_cast<int32_t>(cell.x());
  const auto y = static_cast<int32_t>(cell.y());
  const auto z = static_cast<int32_t>(cell.z());
  const float radius = 0.3F + 0.15F * CellUniform(x, y, z, m.seed);
  const float distance = (q - cell - Eigen::Vector3f::Constant(0.5F)).norm();
  const float blur = std::max(0.04F, s.footprint_m / m.scale_m);
  const float inside = std::clamp(0.5F + (radius - distance) / blur, 0.0F, 1.0F);
  const Rgb& dot = CellUniform(x, y, z, m.seed + 7) < 0.5F ? m.colors[1] : m.colors[2];
  return Mix(m.colors[0], dot, inside);
}

Rgb Wood(const Material& m, const Spot& s) {
  const Eigen::Vector3f stretched(0.12F * s.p_m.x(), s.p_m.y(), s.p_m.z());
  const float bend = FractalNoise(stretched, 5 * m.scale_m, 3, 0.5F, s.footprint_m, m.seed);
  const float radius_m = std::hypot(s.p_m.y() + 0.11F, s.p_m.z() + 0.05F) + 1.6F * m.scale_m * bend;
  const float phase = radius_m / m.scale_m;
  const float ring = phase - std::floor(phase);
  const float dark = Resolved(m.scale_m, s.footprint_m) * (SmoothStep(0.2F, 0.85F, ring) - SmoothStep(0.9F, 1, ring));
  const Eigen::Vector3f fiber(0.06F * s.p_m.x(), s.p_m.y(), s.p_m.z());
  const float pores = FractalNoise(fiber, 0.18F * m.scale_m, 2, 0.7F, s.footprint_m, m.seed + 3);
  const Rgb base = Mix(m.colors[0], m.colors[1], 0.7F * dark);
  return Mix(base, m.colors[2], 0.5F * SmoothStep(0.15F, 0.6F, pores));
}

Rgb Marble(const Material& m, const Spot& s) {
  const float warp = FractalNoise(s.p_m, 2 * m.scale_m, 4, 0.55F, s.footprint_m, m.seed);
  const float wave =
      std::sin(6.2832F * (s.p_m.dot(Eigen::Vector3f(0.5F, 0.62F, 0.6F)) / (3 * m.scale_m) + 1.3F * warp));
  const float vein = SmoothStep(0.82F, 1.0F, wave);
  const float clouds = FractalNoise(s.p_m, m.scale_m, 4, 0.6F, s.footprint_m, m.seed + 11);
  return Mix(Mix(m.colors[0], m.colors[1], SmoothStep(-0.3F, 0.6F, clouds)), m.colors[2], 0.85F * vein);
}

Rgb Fabric(const Material& m, const Spot& s) {
  const float thread_m = 0.1F * m.scale_m;
  const float weave =
      (Bands(s.p_m.x() / thread_m, s.footprint_m / thread_m) + Bands(s.p_m.y() / thread_m, s.footprint_m / thread_m) +
       Bands(s.p_m.z() / thread_m, s.footprint_m / thread_m)) /
      3;
  const float dye = FractalNoise(s.p_m, m.scale_m, 5, 0.65F, s.footprint_m, m.seed);
  const Rgb base = Mix(m.colors[0], m.colors[1], SmoothStep(-0.35F, 0.4F, dye));
  return Mix(base, m.colors[2], 0.5F * weave);
}

// Coordinates on a printed sheet [m], and the index of the sheet.
struct SheetPoint {
  float s_m, t_m;
  int32_t sheet;
};

SheetPoint OnSheet(const Material& m, const Spot& s) {
  if (m.wrapping == Wrapping::kCylinder && std::abs(s.normal.z()) < 0.8F) {
    const float radius_m = std::hypot(s.p_m.x(), s.p_m.y());
    return {std::atan2(s.p_m.y(), s.p_m.x()) * radius_m, s.p_m.z(), 0};
  }
  int axis = 0;
  s.normal.cwiseAbs().maxCoeff(&axis);
  const int32_t sheet = 2 * axis + (s.normal[axis] > 0 ? 1 : 0);
  if (axis == 2) return {s.p_m.x(), s.p_m.y(), sheet};
  return {axis == 0 ? s.p_m.y() : s.p_m.x(), s.p_m.z(), sheet};
}

// 1 on ink and 0 on paper, for a line of random glyphs. `t` in 0..1 is the position across the line, `s_m` along it.
float WordInk(float s_m, float t, float line_m, int32_t line, float footprint_m, uint32_t seed) {
  const float letter_m = 0.55F * line_m;
  const auto letter = static_cast<int32_t>(std::floor(s_m / letter_m));
  const bool gap = CellUniform(letter, line, 1, seed) < 0.18F;
  if (gap || t < 0.25F || t > 0.85F) return 0;
  // A letter is a small grid of strokes.
  const auto stroke_s = static_cast<int32_t>(std::floor(3.0F * s_m / letter_m));
  const auto stroke_t = static_cast<int32_t>(std::floor((t - 0.25F) / 0.2F));
  const float stroke = CellUniform(stroke_s, stroke_t, line, seed + 5) < 0.62F ? 1.0F : 0.0F;
  const float sharp = Resolved(0.5F * letter_m, footprint_m);
  return sharp * stroke + (1 - sharp) * 0.55F;
}

// A sheet consists of blocks: paragraphs, headings, images and plain areas.
Rgb Print(const Material& m, const Spot& s) {
  const SheetPoint q = OnSheet(m, s);
  const uint32_t seed = m.seed + 101U * static_cast<uint32_t>(q.sheet);
  const float block_m = m.scale_m;
  const auto row = static_cast<int32_t>(std::floor(q.t_m / block_m));
  const float width_m = block_m * (1.2F + 1.5F * CellUniform(row, 3, 0, seed));
  const float shift_m = width_m * CellUniform(row, 4, 0, seed);
  const auto column = static_cast<int32_t>(std::floor((q.s_m + shift_m) / width_m));
  const float s_in = (q.s_m + shift_m) / width_m - static_cast<float>(column);
  const float t_in = q.t_m / block_m - static_cast<float>(row);
  const float kind = CellUniform(column, row, 5, seed);
  const bool margin = s_in < 0.06F || s_in > 0.94F || t_in < 0.06F || t_in > 0.94F;
  const Rgb& paper = m.colors[0];
  if (margin) return paper;
  if (kind < 0.3F) {  // image
    const uint32_t picture = seed + CellHash(column, row, 6, seed);
    const float tone = FractalNoise(s.p_m, 0.6F * block_m, 5, 0.65F, s.footprint_m, picture);
    const Rgb tint = FromHsv(CellUniform(column, row, 7, seed), 0.45, 0.7);
    return Mix(Mix(m.colors[1], tint, SmoothStep(-0.4F, 0.1F, tone)), Rgb::Constant(0.85F),
               SmoothStep(0.1F, 0.6F, tone));
  }
  if (kind < 0.42F) return Mix(paper, m.colors[2], 0.8F);
  const float lines = kind < 0.62F ? 2.0F : 5.0F;  // heading or paragraph
  const auto line = static_cast<int32_t>(std::floor(t_in * lines));
  const float ink = WordInk(q.s_m, t_in * lines - static_cast<float>(line), block_m / lines, 8 * row + line,
                            s.footprint_m, seed + static_cast<uint32_t>(column));
  return Mix(paper, kind < 0.62F ? m.colors[2] : m.colors[1], ink);
}

Rgb Pages(const Material& m, const Spot& s) {
  const Eigen::Vector3f flat(0.02F * s.p_m.x(), 0.02F * s.p_m.y(), s.p_m.z());
  const float line = FractalNoise(flat, m.scale_m, 2, 0.8F, s.footprint_m, m.seed);
  return Mix(m.colors[0], m.colors[1], SmoothStep(-0.1F, 0.6F, line));
}

Rgb Tiles(const Material& m, const Spot& s) {
  const SheetPoint q = OnSheet(m, s);
  const auto column = static_cast<int32_t>(std::floor(q.s_m / m.scale_m));
  const auto row = static_cast<int32_t>(std::floor(q.t_m / m.scale_m));
  const float s_in = q.s_m / m.scale_m - static_cast<float>(column);
  const float t_in = q.t_m / m.scale_m - static_cast<float>(row);
  const float joint = std::min({s_in, 1 - s_in, t_in, 1 - t_in}) * m.scale_m;
  const float half_joint_m = 0.012F * m.scale_m;
  const float blur_m = std::max(0.002F * m.scale_m, s.footprint_m);
  const float in_joint = std::clamp(0.5F + (half_joint_m - joint) / blur_m, 0.0F, 1.0F);
  const float veins =
      FractalNoise(s.p_m, 0.4F * m.scale_m, 5, 0.65F, s.footprint_m, m.seed + CellHash(column, row, 0, 9));
  const Rgb tile = Mix(m.colors[0], m.colors[1], 0.75F * CellUniform(column, row, q.sheet, m.seed) + 0.45F * veins);
  return Mix(tile, m.colors[2], in_joint);
}

Rgb Leaf(const Material& m, const Spot& s) {
  const float mottle = FractalNoise(s.p_m, m.scale_m, 4, 0.6F, s.footprint_m, m.seed);
  const float veins = FractalNoise(s.p_m, 0.3F * m.scale_m, 2, 0.5F, s.footprint_m, m.seed + 5);
  const Rgb base = Mix(m.colors[0], m.colors[1], SmoothStep(-0.4F, 0.5F, mottle));
  return Mix(base, m.colors[2], 0.7F * (1 - SmoothStep(0.0F, 0.12F, std::abs(veins))));
}

Rgb PatternColor(const Material& m, const Spot& s) {
  switch (m.pattern) {
    case Pattern::kPlain:
      return m.colors[0];
    case Pattern::kSpeckle:
      return Speckle(m, s);
    case Pattern::kStripes:
      return Stripes(m, s);
    case Pattern::kChecks:
      return Checks(m, s);
    case Pattern::kDots:
      return Dots(m, s);
    case Pattern::kWood:
      return Wood(m, s);
    case Pattern::kMarble:
      return Marble(m, s);
    case Pattern::kFabric:
      return Fabric(m, s);
    case Pattern::kPrint:
      return Print(m, s);
    case Pattern::kPages:
      return Pages(m, s);
    case Pattern::kTiles:
      return Tiles(m, s);
    case Pattern::kLeaf:
      return Leaf(m, s);
  }
  return m.colors[0];
}

// The equivalent point in the first period of the texture.
Eigen::Vector3f InFirstPeriod(const Material& m, Eigen::Vector3f p_m) {
  for (int k = 0; k < 2; ++k) {
    if (m.period_m[k] > 0) p_m[k] -= m.period_m[k] * std::floor(p_m[k] / m.period_m[k]);
  }
  return p_m;
}

}  // namespace

Rgb Albedo(const Material& material, const Eigen::Vector3f& p_local_m, const Eigen::Vector3f& n_local,
           float footprint_m) {
  const Spot spot{InFirstPeriod(material, p_local_m), n_local, footprint_m};
  Rgb color = PatternColor(material, spot);
  if (material.grain > 0) {
    const float grain = FractalNoise(spot.p_m, 0.012F, 3, 0.75F, footprint_m, material.seed + 77);
    color *= 1 + material.grain * grain;
  }
  return color.cwiseMax(0.01F).cwiseMin(0.95F);
}

Rgb FromHsv(double hue, double saturation, double value) {
  Rgb rgb;
  for (int k = 0; k < 3; ++k) {
    const double offset = hue * 6 + (k == 0 ? 5 : k == 1 ? 3 : 1);
    const double t = std::fmod(offset, 6.0);
    const double srgb = value * (1 - saturation * std::clamp(std::min(t, 4 - t), 0.0, 1.0));
    rgb[k] = static_cast<float>(std::pow(srgb, 2.2));
  }
  return rgb;
}

Material RandomMaterial(Pattern pattern, float scale_m, Random& random) {
  Material material;
  material.pattern = pattern;
  material.scale_m = scale_m;
  material.seed = static_cast<uint32_t>(random.Bits());
  const double hue = random.Uniform();
  material.colors[0] = FromHsv(hue, random.Uniform(0.1, 0.65), random.Uniform(0.55, 0.92));
  material.colors[1] = FromHsv(hue + random.Uniform(0.3, 0.7), random.Uniform(0.2, 0.7), random.Uniform(0.2, 0.55));
  material.colors[2] = FromHsv(hue + random.Uniform(0.05, 0.25), random.Uniform(0.2, 0.6), random.Uniform(0.15, 0.9));
  return material;
}

}  // namespace romap::synth
