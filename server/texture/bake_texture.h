#pragma once

#include <opencv2/core/mat.hpp>
#include <span>

#include "server/texture/texture_view.h"
#include "server/texture/unwrap_mesh.h"

namespace romap::texture {

struct BakeOptions {
  // The larger it is, the fewer views contribute to the details of a texel: with 3, a view with 0.8 times the weight of
  // the best one counts half. >= 0. Fewer views give more contrast, more views less noise and aliasing.
  float best_view_power = 3;
};

struct BakedTexture {
  cv::Mat color_bgr;  // CV_8UC3, atlas_px x atlas_px; texels as TexturedMesh::uv describes
  cv::Mat seen;       // CV_8UC1; 255 = a view shows this part of the surface, 0 = filled, or not part of the surface
};

// Colors the texture of an object from its views. The color of a texel comes from the views that show its point of the
// surface (PreparedView), after their exposure is compensated (EstimateViewGains), by BlendSamples. Both sides of the
// border of a chart show the same points, so they get the same colors. Unseen texels are filled (FillUnseen).
//
// Views that are not valid (ValidateTextureView) are ignored. Without valid views, the texture shows the vertex colors.
// Uses the threads of oneTBB; the result does not depend on their number.
BakedTexture BakeTexture(const TexturedMesh& textured, std::span<const TrainingCamera> views,
                         const BakeOptions& options);

}  // namespace romap::texture
