#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "common/stage_messages.h"
#include "server/nerf/input_quality.h"
#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// Another object pixel of the same view, close to the first one.
struct PartnerPixel {
  int8_t du_px = 0, dv_px = 0;  // offset from the first pixel; both 0: no partner
  std::array<uint8_t, 3> rgb = {};
  float z_mu = 0;  // see TrainingPixel
};

// A pixel through which a training ray can pass.
struct TrainingPixel {
  uint16_t view;        // index of its view
  uint16_t u_px, v_px;  // in the full image
  std::array<uint8_t, 3> rgb;
  float z_mu;  // z depth, map units; <= 0: unknown
  PartnerPixel partner = {};

  TrainingPixel Partner() const {
    return {view, static_cast<uint16_t>(u_px + partner.du_px), static_cast<uint16_t>(v_px + partner.dv_px), partner.rgb,
            partner.z_mu};
  }
};

// Chooses the pixels of every step: background pixels in a band around the masks, where they constrain the shape most;
// pixels with a map point; and object pixels. If the contrast loss has a weight, object pixels come in pairs: the rays
// 2 k and 2 k + 1 of a step. Occluder pixels are never chosen.
//
// The pixels of one kind share the interval [0, 1], tile by tile and view by view, with lengths in proportion to the
// weights of the views. Every ray of a step owns an equal part of the interval, and moves through it from step to step
// by the golden ratio (a Kronecker sequence). Hence every step samples all views in proportion, and all pixels are
// chosen before any is chosen much more often than the others.
class PixelSampler {
 public:
  // The object pixels of a view are divided into the tiles of a regular grid over the bounding box of the mask, row by
  // row, and one more tile for the pixels at the border of the mask.
  static constexpr int kTilesPerSide = 5;
  static constexpr int kBorderTile = kTilesPerSide * kTilesPerSide;
  static constexpr int kTiles = kBorderTile + 1;

  struct Choice {
    TrainingPixel pixel;
    bool is_object;
    int partner = 0;  // see RayTarget
  };

  PixelSampler(const NerfConfig& config, uint64_t seed);

  // Replaces all pixels; all views weigh 1. Object pixels get the dense depth if it is consistent. The band of
  // background pixels includes the uncertain border of the mask, because the hull does not exclude it. Keeps no
  // reference to the views.
  void Build(std::span<const ObjectView> views, const InputQuality& quality = {});
  // Sets how often the pixels of each view are chosen relative to those of the others: one weight >= 0 per view. If all
  // weights are 0, all views weigh 1.
  void Weigh(std::span<const float> views);
  // True if there is no object pixel.
  bool empty() const { return object_.pixels.empty(); }

  // The pixel of ray `index` (0 .. rays_per_step - 1) of `step`. Requires !empty(). Thread-safe.
  Choice At(uint64_t step, int index) const;

  // At most `count` pixels, evenly spaced over a tile or the background band. The same until Build().
  std::vector<const TrainingPixel*> TilePixels(size_t view, int tile, size_t count) const {
    return object_.EvenlySpaced(view * kTiles + static_cast<size_t>(tile), count);
  }
  std::vector<const TrainingPixel*> BackgroundPixels(size_t view, size_t count) const {
    return background_.EvenlySpaced(view, count);
  }

 private:
  // All pixels of one kind, in groups: tiles or views.
  struct PixelKind {
    // The part of the interval [0, 1] that belongs to one group.
    struct Part {
      double from, until;
      double pixels_per_length;
      uint32_t first, last;  // pixels of the group
    };
    // The position of one ray of every step.
    struct Slot {
      uint64_t phase;  // within the slot at step 0, in units of 2^-64
      uint32_t part;   // at the beginning of the slot
    };
    std::vector<TrainingPixel> pixels;
    std::vector<uint32_t> first_of_group;  // one entry per group, then the number of pixels
    std::vector<Part> parts;               // of the groups with a positive length, in order
    std::vector<Slot> slots;
    uint64_t salt = 0;

    int rays() const { return static_cast<int>(slots.size()); }
    void CloseGroup() { first_of_group.push_back(static_cast<uint32_t>(pixels.size())); }
    void SetRays(int rays, uint64_t seed);
    void SetWeights(std::span<const float> group_weights);
    const TrainingPixel& At(uint64_t step, int index) const;
    std::vector<const TrainingPixel*> EvenlySpaced(size_t group, size_t count) const;
  };

  void CollectPixels(const ObjectView& view, uint16_t view_index, double keep_share, const InputQuality& quality);
  PartnerPixel FindPartner(const ObjectView& view, const cv::Mat& is_object, cv::Point at, double distance_px,
                           uint64_t key, bool use_depth) const;
  void CollectMapPoints(const ObjectView& view, uint16_t view_index);

  NerfConfig config_;
  uint64_t seed_;
  int rays_per_slot_;  // of object pixels: 2 if they come in pairs
  PixelKind object_, background_, sparse_;
};

}  // namespace romap::nerf
