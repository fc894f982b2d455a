#include "server/nerf/model/field_model.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "server/nerf/math/random.h"

namespace romap::nerf {

namespace {

// Number of MLP inputs that are not padding.
int UsedInputs(const GridLayout& layout) {
  return layout.octaves > 0 ? 6 * layout.octaves + kFrequencyExtras : kFeaturesPerLevel * layout.levels;
}

GridLayout MakeFrequencyLayout(const NerfConfig& config) {
  GridLayout layout;
  layout.octaves = config.levels;
  layout.features = (UsedInputs(layout) + 15) / 16 * 16;
  return layout;
}

}  // namespace

GridLayout MakeGridLayout(const NerfConfig& config) {
  if (config.encoding == "frequency") return MakeFrequencyLayout(config);
  GridLayout layout;
  layout.levels = config.levels;
  layout.features = (kFeaturesPerLevel * config.levels + 15) / 16 * 16;
  const double ratio = static_cast<double>(config.finest_resolution) / config.base_resolution;
  const double growth = config.levels > 1 ? std::pow(ratio, 1.0 / (config.levels - 1)) : 1.0;
  const uint64_t table_entries = uint64_t{1} << config.log2_table_entries;
  for (int l = 0; l < config.levels; ++l) {
    const double scale = config.base_resolution * std::pow(growth, l) - 1.0;
    const uint64_t side = static_cast<uint64_t>(std::ceil(scale)) + 2;  // corners that a shifted lattice can reach
    layout.scale[l] = static_cast<float>(scale);
    layout.offset[l] = layout.entries;
    uint64_t count = table_entries;
    if (side * side * side <= table_entries) {
      // The window is wider than the first box needs, so that the box can grow.
      const auto widest = static_cast<uint64_t>(std::cbrt(static_cast<double>(table_entries)));
      const uint64_t window = std::max(side, std::min(widest, side + side / 2));
      count = std::bit_ceil(window * window * window);
      layout.stride_y[l] = static_cast<uint32_t>(window);
      layout.stride_z[l] = static_cast<uint32_t>(window * window);
    } else {
      layout.stride_y[l] = 2654435761u;  // large odd numbers spread rows over the table
      layout.stride_z[l] = 805459861u;
    }
    layout.mask[l] = static_cast<uint32_t>(count - 1);
    // One more entry for the pair at the end; the next level starts at a new cache line.
    layout.entries += static_cast<uint32_t>((count + 1 + 7) / 8 * 8);
  }
  return layout;
}

MlpWeights::MlpWeights(int inputs_, int hidden_, int layers_)
    : inputs(inputs_),
      hidden(hidden_),
      layers(layers_),
      parameters(static_cast<size_t>((inputs_ + (layers_ - 1) * hidden_ + kOutputs) * hidden_)),
      in_transposed(static_cast<size_t>(inputs_ * hidden_)),
      hidden_transposed(static_cast<size_t>((layers_ - 1) * hidden_ * hidden_)),
      out_transposed(static_cast<size_t>(kOutputs * hidden_)) {}

void MlpWeights::UpdateTransposed() {
  for (int i = 0; i < inputs; ++i) {
    for (int h = 0; h < hidden; ++h) in_transposed[h * inputs + i] = in_weights()[i * hidden + h];
  }
  for (int layer = 1; layer < layers; ++layer) {
    const float* weights = hidden_weights(layer);
    float* transposed = hidden_transposed.data() + (layer - 1) * hidden * hidden;
    for (int i = 0; i < hidden; ++i) {
      for (int h = 0; h < hidden; ++h) transposed[h * hidden + i] = weights[i * hidden + h];
    }
  }
  for (int o = 0; o < kOutputs; ++o) {
    for (int h = 0; h < hidden; ++h) out_transposed[h * kOutputs + o] = out_weights()[o * hidden + h];
  }
}

MlpWeights MlpWeights::Clone() const {
  MlpWeights copy(inputs, hidden, layers);
  copy.parameters = parameters.Clone();
  copy.UpdateTransposed();
  return copy;
}

FieldModel::FieldModel(const NerfConfig& config, uint64_t seed)
    : layout(MakeGridLayout(config)),
      table(static_cast<size_t>(layout.entries) * kFeaturesPerLevel),
      mlp(layout.features, config.hidden_width, config.hidden_layers),
      density_bias(config.field == "density" ? static_cast<float>(config.density_bias) : 0.0f),
      sharpness(config.field == "sdf" ? static_cast<float>(config.initial_sharpness) : 0.0f) {
  for (size_t i = 0; i < table.size(); ++i) table[i] = 1e-4f * (2.0f * RandomUniform(seed, 0, i) - 1.0f);
  const int used_inputs = UsedInputs(layout);
  const float in_bound = std::sqrt(6.0f / static_cast<float>(used_inputs + mlp.hidden));
  const float hidden_bound = std::sqrt(6.0f / static_cast<float>(mlp.hidden));
  const float out_bound = std::sqrt(6.0f / static_cast<float>(mlp.hidden + kOutputs));
  const size_t in_used = static_cast<size_t>(used_inputs * mlp.hidden);
  const size_t in_end = static_cast<size_t>(mlp.inputs * mlp.hidden), out_begin = static_cast<size_t>(mlp.OutOffset());
  for (size_t i = 0; i < mlp.parameters.size(); ++i) {
    const float bound = i < in_used ? in_bound : i < in_end ? 0.0f : i < out_begin ? hidden_bound : out_bound;
    mlp.parameters[i] = bound * (2.0f * RandomUniform(seed, 1, i) - 1.0f);
  }
  mlp.UpdateTransposed();
}

FieldModel FieldModel::Clone() const {
  FieldModel copy;
  copy.layout = layout;
  copy.table = table.Clone();
  copy.mlp = mlp.Clone();
  copy.density_bias = density_bias;
  copy.sharpness = sharpness;
  return copy;
}

bool FieldModel::IsFinite() const {
  const auto finite = [](float x) { return std::isfinite(x); };
  return std::ranges::all_of(table.span(), finite) && std::ranges::all_of(mlp.parameters.span(), finite);
}

}  // namespace romap::nerf
