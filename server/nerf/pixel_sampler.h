#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "common/stage_messages.h"
#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// An object pixel near another one of the same view.
struct PartnerPixel {
  int8_t du_px = 0, dv_px = 0;  // from the other pixel; both 0: there is none
  std::array<uint8_t, 3> rgb = {};
  float z_mu = 0;  // as TrainingPixel's
};

// A pixel that a ray can be sent through.
struct TrainingPixel {
  uint16_t view;        // index of the view it belongs to
  uint16_t u_px, v_px;  // in the full image
  std::array<uint8_t, 3> rgb;
  float z_mu;  // z depth, map units; <= 0: unknown
  PartnerPixel partner = {};

  TrainingPixel Partner() const {
    return {view, static_cast<uint16_t>(u_px + partner.du_px), static_cast<uint16_t>(v_px + partner.dv_px), partner.rgb,
            partner.z_mu};
  }
};

// Chooses the pixels of every step: background pixels of a band around the masks, where they say most about the shape,
// pixels with a map point, and object pixels, these in pairs where contrast has a weight: the rays 2 k and 2 k + 1 of a
// step. Pixels of occluders are never chosen.
//
// The pixels of a kind lie tile after tile and view after view on a line on which each takes up room by its tile's
// weight. Every ray of a step owns an equal part of that line and goes through it from step to step by the golden ratio
// (a Kronecker sequence), so each step sees all views in proportion, and all pixels come by before one comes again too
// often.
class PixelSampler {
 public:
  // A view's object pixels by tiles of the mask's bounding box, row by row, and those next to the mask's border apart.
  static constexpr int kTilesPerSide = 5;
  static constexpr int kBorderTile = kTilesPerSide * kTilesPerSide;
  static constexpr int kTiles = kBorderTile + 1;

  struct Choice {
    TrainingPixel pixel;
    bool is_object;
    int partner = 0;  // see nerf::RayTarget
  };

  PixelSampler(const NerfConfig& config, uint64_t seed);

  // Replaces all pixels; everything weighs 1. `use_depth`: object pixels get the dense depth. Keeps no reference to the
  // views.
  void Build(std::span<const ObjectView> views, bool use_depth = true);
  // Sets how often the pixels of each view are chosen relative to those of the others: one weight >= 0 per view. If all
  // weights are 0, all views weigh 1.
  void Weigh(std::span<const float> views);
  // There is no object pixel.
  bool empty() const { return object_.pixels.empty(); }

  // The pixel of ray `index` (0 .. rays_per_step - 1) of `step`. Not to be called while empty(). Thread-safe.
  Choice At(uint64_t step, int index) const;

  // Pixels spread evenly over a tile, always the same until Build(): at most `most`.
  std::vector<const TrainingPixel*> OfTile(size_t view, int tile, size_t most) const {
    return object_.Spread(view * kTiles + static_cast<size_t>(tile), most);
  }
  std::vector<const TrainingPixel*> OfBackground(size_t view, size_t most) const {
    return background_.Spread(view, most);
  }

 private:
  // All pixels of one kind in groups: tiles or views.
  struct Line {
    // What a group has of the line, 0..1, and of the pixels.
    struct Piece {
      double from, until;
      double pixels_per_room;
      uint32_t first, last;
    };
    // Where a ray of every step is on the line.
    struct Slot {
      uint64_t phase;  // of its part, at step 0, in 2^-64
      uint32_t piece;  // at the beginning of its part
    };
    std::vector<TrainingPixel> pixels;
    std::vector<uint32_t> first_of_group;  // and one more: the number of pixels
    std::vector<Piece> pieces;             // of the groups that have room on the line, in order
    std::vector<Slot> slots;
    uint64_t salt = 0;

    int rays() const { return static_cast<int>(slots.size()); }
    void CloseGroup() { first_of_group.push_back(static_cast<uint32_t>(pixels.size())); }
    void SetRays(int rays, uint64_t seed);
    void Divide(std::span<const float> group_weights);
    const TrainingPixel& At(uint64_t step, int index) const;
    std::vector<const TrainingPixel*> Spread(size_t group, size_t most) const;
  };

  void CollectPixels(const ObjectView& view, uint16_t view_index, double keep_share, bool use_depth);
  PartnerPixel FindPartner(const ObjectView& view, const cv::Mat& is_object, cv::Point at, double apart_px,
                           uint64_t key, bool use_depth) const;
  void CollectMapPoints(const ObjectView& view, uint16_t view_index);

  NerfConfig config_;
  uint64_t seed_;
  int rays_per_slot_;  // of object pixels: 2 where they come in pairs
  Line object_, background_, sparse_;
};

}  // namespace romap::nerf
