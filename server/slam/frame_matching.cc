#include "server/slam/frame_matching.h"

#include <algorithm>

#include "server/slam/descriptor_matching.h"

namespace romap::slam {
namespace {

std::vector<Descriptor> EveryDescriptor(const FrameFeatures& frame, size_t step) {
  std::vector<Descriptor> descriptors;
  descriptors.reserve(frame.size() / step + 1);
  for (size_t i = 0; i < frame.size(); i += step) descriptors.push_back(frame.features[i].descriptor);
  return descriptors;
}

}  // namespace

TwoViewMatch MakeTwoViewMatch(const Feature& first, const Feature& second, double pixel_sigma_px) {
  return {first.pixel_px.cast<double>(), second.pixel_px.cast<double>(),
          pixel_sigma_px * std::max(first.octave_scale, second.octave_scale)};
}

std::vector<TwoViewMatch> MatchFrames(const FrameFeatures& first, const FrameFeatures& second,
                                      const FrameMatching& options, double pixel_sigma_px) {
  const size_t step = options.max_first == SIZE_MAX ? 1 : 1 + first.size() / (options.max_first + 1);
  std::vector<TwoViewMatch> matches;
  for (const DescriptorMatch& match : MatchDescriptors(EveryDescriptor(first, step), EveryDescriptor(second, 1),
                                                       options.max_distance_bits, options.max_ratio)) {
    matches.push_back(MakeTwoViewMatch(first.features[step * static_cast<size_t>(match.first)],
                                       second.features[static_cast<size_t>(match.second)], pixel_sigma_px));
  }
  return matches;
}

}  // namespace romap::slam
