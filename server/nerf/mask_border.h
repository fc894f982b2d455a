#pragma once

#include <opencv2/core/mat.hpp>
#include <span>

#include "common/stage_messages.h"
#include "server/nerf/model/field_model.h"
#include "server/nerf/model/render_space.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/ray_set.h"

namespace romap::nerf {

// 255 at the object's pixels and within `border_px` of them, otherwise 0. CV_8UC1, size of the view's crop.
cv::Mat PossibleObject(const ObjectView& view, int border_px);

// How imprecise the borders of an object's masks are: the spread of the distances [px] from points on the borders,
// between object and background, to the silhouettes of the field in the same views. It includes errors of the poses.
struct MaskNoise {
  int points = 0;        // border points near which the field has a silhouette
  double spread_px = 0;  // robust standard deviation
};

// `rays` must have been built on the views; views with weight 0 are not used.
MaskNoise MeasureMaskNoise(std::span<const ObjectView> views, std::span<const float> weights, const RaySet& rays,
                           const FieldModel& model, const NerfConfig& config, const RenderSpace& space);

// The width of the border that is uncertain with such noise, see InputQuality: this many standard deviations. 0: the
// masks are precise, or there are too few points to know.
int UncertainBorder_px(const MaskNoise& noise, double spreads);

}  // namespace romap::nerf
