#include "server/texture/texture_mesh.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <utility>

#include "common/mesh_faces.h"
#include "common/statistics.h"
#include "common/status.h"
#include "server/texture/bake_texture.h"
#include "server/texture/simplify_mesh.h"

namespace romap::texture {
namespace {

// Without views, the texture is no sharper than the vertex colors.
constexpr int kAtlasWithoutViews_px = 256;
// Larger coordinates could overflow.
constexpr float kLargest_mu = 1e9f;

absl::Status ValidateMesh(const Mesh& mesh) {
  if (mesh.triangles.empty()) return InvalidArgument("the mesh has no triangles, must have at least one");
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (!(mesh.vertices[i].lpNorm<Eigen::Infinity>() <= kLargest_mu) || !mesh.vertices[i].allFinite()) {
      return InvalidArgument("vertex {} of the mesh is at ({}, {}, {}), must be finite and within {} of the origin", i,
                             mesh.vertices[i].x(), mesh.vertices[i].y(), mesh.vertices[i].z(), kLargest_mu);
    }
  }
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    for (const uint32_t vertex : mesh.triangles[i]) {
      if (vertex >= mesh.vertices.size()) {
        return InvalidArgument("triangle {} of the mesh has vertex {}, must be below {}", i, vertex,
                               mesh.vertices.size());
      }
    }
  }
  const auto check = [&](const char* name, size_t count) {
    if (count == 0 || count == mesh.vertices.size()) return absl::OkStatus();
    return InvalidArgument("the mesh has {} {}, must have none or one for each of the {} vertices", count, name,
                           mesh.vertices.size());
  };
  ROMAP_RETURN_IF_ERROR(check("colors", mesh.colors.size()));
  return check("confidences", mesh.confidence.size());
}

absl::Status ValidateTextureOptions(const TextureOptions& options) {
  if (!(options.max_error_share >= 0)) {
    return InvalidArgument("max_error_share is {}, must be at least 0", options.max_error_share);
  }
  if (!(options.texels_per_pixel > 0)) {
    return InvalidArgument("texels_per_pixel is {}, must be above 0", options.texels_per_pixel);
  }
  if (options.jpeg_quality < 1 || options.jpeg_quality > 100) {
    return InvalidArgument("jpeg_quality is {}, must be 1..100", options.jpeg_quality);
  }
  return absl::OkStatus();
}

// Pixels per map unit that three quarters of the views have at most; 0: no view shows the center.
float ResolutionOfViews(std::span<const TrainingCamera> views, const Eigen::Vector3f& center) {
  std::vector<double> resolutions = ResolutionsAt(views, center);
  return resolutions.empty() ? 0.0f : static_cast<float>(NearestQuantile(std::move(resolutions), 0.75));
}

absl::Status EncodeImage(const cv::Mat& image_bgr, const TextureOptions& options, TexturedObject& object) {
  MeshTexture& texture = object.texture;
  texture.media_type = options.use_png ? "image/png" : "image/jpeg";
  std::vector<uint8_t> bytes;
  const std::vector<int> parameters =
      options.use_png ? std::vector<int>{} : std::vector<int>{cv::IMWRITE_JPEG_QUALITY, options.jpeg_quality};
  if (!cv::imencode(options.use_png ? ".png" : ".jpg", image_bgr, bytes, parameters)) {
    return Internal("a texture of {} x {} px cannot be encoded as {}", image_bgr.cols, image_bgr.rows,
                    texture.media_type);
  }
  texture.image.assign(bytes.begin(), bytes.end());
  return absl::OkStatus();
}

double ShareSeen(const TexturedMesh& textured, const cv::Mat& seen) {
  double area = 0, seen_area = 0;
  for (const auto& [a, b, c] : textured.mesh.triangles) {
    const Eigen::Vector2f u = textured.mesh.uv[b] - textured.mesh.uv[a], v = textured.mesh.uv[c] - textured.mesh.uv[a];
    const double face_area = std::abs(u.x() * v.y() - u.y() * v.x());
    const Eigen::Vector2f at =
        (textured.mesh.uv[a] + textured.mesh.uv[b] + textured.mesh.uv[c]) / 3 * static_cast<float>(seen.cols);
    area += face_area;
    if (seen.at<uint8_t>(std::min(static_cast<int>(at.y()), seen.rows - 1),
                         std::min(static_cast<int>(at.x()), seen.cols - 1)) != 0) {
      seen_area += face_area;
    }
  }
  return area > 0 ? seen_area / area : 0;
}

class Stopwatch {
 public:
  // Seconds since the last call.
  double Lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - start_).count();
    start_ = now;
    return seconds;
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

absl::StatusOr<TexturedObject> TextureValidMesh(const Mesh& mesh, std::span<const TrainingCamera> views,
                                                const TextureOptions& options) {
  TexturedObject object;
  Stopwatch stopwatch;
  const Eigen::AlignedBox3f bounds = BoundsOf(mesh);
  const float max_error_mu = options.max_error_share * bounds.diagonal().norm();
  const Simplified simplified =
      SimplifyMesh(mesh, {.max_triangles = options.max_triangles, .max_error_mu = max_error_mu});
  object.error_mu = simplified.error_mu;
  object.times.simplify_s = stopwatch.Lap();

  const float resolution = ResolutionOfViews(views, bounds.center());
  const UnwrapOptions unwrap = {
      .max_atlas_px = resolution > 0 ? options.max_atlas_px : std::min(options.max_atlas_px, kAtlasWithoutViews_px),
      .texels_per_mu = resolution * options.texels_per_pixel};
  ROMAP_ASSIGN_OR_RETURN(object.textured, UnwrapMesh(simplified.mesh, unwrap));
  object.times.unwrap_s = stopwatch.Lap();

  const BakedTexture baked = BakeTexture(object.textured, views, {});
  object.seen_share = ShareSeen(object.textured, baked.seen);
  object.times.bake_s = stopwatch.Lap();

  ROMAP_RETURN_IF_ERROR(EncodeImage(baked.color_bgr, options, object));
  object.times.encode_s = stopwatch.Lap();
  return object;
}

}  // namespace

absl::StatusOr<TexturedObject> TextureMesh(const Mesh& mesh, std::span<const TrainingCamera> views,
                                           const TextureOptions& options) {
  ROMAP_RETURN_IF_ERROR(ValidateMesh(mesh));
  for (size_t i = 0; i < views.size(); ++i) {
    if (const absl::Status status = ValidateTextureView(views[i]); !status.ok()) {
      return InvalidArgument("view {}: {}", i, Message(status));
    }
  }
  ROMAP_RETURN_IF_ERROR(ValidateTextureOptions(options));
  try {
    return TextureValidMesh(mesh, views, options);
  } catch (const cv::Exception& error) {
    return Internal("the texture of a mesh with {} triangles and {} views failed: {}", mesh.triangles.size(),
                    views.size(), error.what());
  }
}

}  // namespace romap::texture
