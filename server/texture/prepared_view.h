#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "common/mesh.h"
#include "server/texture/texture_view.h"

namespace romap::texture {

// A point of the surface in a view.
struct ViewedPoint {
  // cos(angle between normal and viewing direction)^2 * resolution * feather; 0 if the view does not show the point.
  // `feather` decreases toward the border of the visible region. The other values are set only if the weight is not 0.
  float weight = 0;
  float u_px = 0, v_px = 0;  // in the crop
  float resolution = 0;      // pixels per map unit
};

// What a view shows at a point. Gray levels.
struct ViewSample {
  float weight = 0;
  Eigen::Array3f color_bgr;
  Eigen::Array3f low_bgr;  // of the surroundings: low frequencies of the image within the mask
};

// A view with what is needed to look up points of a mesh: a depth buffer of the mesh, the region where the object is
// visible, and the image without its high frequencies.
class PreparedView {
 public:
  // The view must be valid (ValidateTextureView). It may share its pixels.
  PreparedView(const TrainingCamera& view, const Mesh& mesh);

  // The point and its normal (unit length) are in the Object frame. Points that are hidden, less than two pixels inside
  // the object's mask, beside an edge of a surface in front of another one, or viewed at more than 77 degrees have no
  // weight.
  ViewedPoint Find(const Eigen::Vector3f& position, const Eigen::Vector3f& normal) const;

  // The color at a position without the low frequencies of the image, in gray levels; regardless of what hides the
  // position. nullopt: outside the image or the mask of the object.
  std::optional<Eigen::Array3f> DetailAt(const Eigen::Vector3f& position) const;

  // For points with weight.
  ViewSample Sample(const ViewedPoint& point) const;
  // Variance of the Laplacian around the point, times the square of its resolution: compares the sharpness of views of
  // the same surface (see common/image_sharpness.h). For points with weight.
  float SharpnessAt(const ViewedPoint& point) const;

 private:
  // Pixel in the crop, and depth.
  Eigen::Vector3f Project(const Eigen::Vector3f& position) const;
  void RenderDepth(const Mesh& mesh);
  void FindVisibleRegion(const cv::Mat& ray_kind);
  void FilterImage();
  // Bilinear interpolation of an image with fewer pixels than the crop; c channels of float.
  template <int c>
  Eigen::Array<float, c, 1> LookUpLow(const cv::Mat& low, const ViewedPoint& point) const;

  Eigen::Matrix3f R_camera_object_;
  Eigen::Vector3f t_camera_object_;
  Eigen::Vector3f center_;  // of the camera, Object frame
  Eigen::Vector2f focal_px_, principal_px_;
  cv::Mat color_bgr_;
  cv::Mat inside_;                // CV_8UC1, 255 = at least two pixels inside the mask
  cv::Mat feather_;               // CV_8UC1, 0 = not visible
  cv::Mat inverse_depth_;         // CV_32FC1, 0 = no surface
  cv::Mat nearest_depth_mu_;      // CV_32FC1, the smallest depth in 3 x 3 pixels
  cv::Mat low_bgr_, low_energy_;  // CV_32FC3 and CV_32FC1, low resolution
};

}  // namespace romap::texture
