#include "client/render/mesh_view.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "common/parallel_for.h"

namespace romap::render {
namespace {

constexpr int kSamplesAcross = 2;

// All meshes merged into one set of arrays, with attributes per vertex. The origin of the World frame is moved to the
// camera, because single precision is too coarse far from the origin.
struct MergedMeshes {
  std::vector<Eigen::Vector3f> positions_world;
  std::vector<Eigen::Vector3f> normals;     // zero: use the triangle normal
  std::vector<Eigen::Vector3f> colors_bgr;  // 0..255; negative: no color
  std::vector<std::array<uint32_t, 3>> triangles;
  std::vector<uint16_t> ids;             // per triangle
  std::vector<Eigen::Vector2f> uv;       // of textured meshes; otherwise zero
  std::vector<const cv::Mat*> textures;  // per triangle, CV_8UC3; null: vertex colors
};

// The color of a texture between the centers of its texels.
Eigen::Vector3f SampleTexture(const cv::Mat& texture_bgr, const Eigen::Vector2f& uv) {
  const float x =
      std::clamp(uv.x() * static_cast<float>(texture_bgr.cols) - 0.5f, 0.0f, static_cast<float>(texture_bgr.cols - 1));
  const float y =
      std::clamp(uv.y() * static_cast<float>(texture_bgr.rows) - 0.5f, 0.0f, static_cast<float>(texture_bgr.rows - 1));
  const int left = static_cast<int>(x), top = static_cast<int>(y);
  const int right = std::min(left + 1, texture_bgr.cols - 1), bottom = std::min(top + 1, texture_bgr.rows - 1);
  const auto at = [&](int row, int col) {
    const auto& bgr = texture_bgr.at<cv::Vec3b>(row, col);
    return Eigen::Vector3f(bgr[0], bgr[1], bgr[2]);
  };
  const float along_x = x - static_cast<float>(left), along_y = y - static_cast<float>(top);
  return (1 - along_y) * ((1 - along_x) * at(top, left) + along_x * at(top, right)) +
         along_y * ((1 - along_x) * at(bottom, left) + along_x * at(bottom, right));
}

MergedMeshes Merge(std::span<const MeshInstance> meshes, const Eigen::Vector3d& origin_world) {
  MergedMeshes merged;
  for (const MeshInstance& instance : meshes) {
    const Mesh& mesh = *instance.mesh;
    const Eigen::Matrix3f R_world_mesh = instance.S_world_mesh.rotation().toRotationMatrix().cast<float>();
    const auto base = static_cast<uint32_t>(merged.positions_world.size());
    const bool has_normals = mesh.normals.size() == mesh.vertices.size();
    const bool has_colors = mesh.colors.size() == mesh.vertices.size();
    const bool has_texture = !instance.texture_bgr.empty() && mesh.uv.size() == mesh.vertices.size();
    for (size_t i = 0; i < mesh.vertices.size(); ++i) {
      const Eigen::Vector3d p_world = instance.S_world_mesh * mesh.vertices[i].cast<double>();
      merged.positions_world.emplace_back((p_world - origin_world).cast<float>());
      merged.normals.push_back(has_normals ? Eigen::Vector3f(R_world_mesh * mesh.normals[i])
                                           : Eigen::Vector3f(Eigen::Vector3f::Zero()));
      merged.colors_bgr.push_back(has_colors ? Eigen::Vector3f(mesh.colors[i][2], mesh.colors[i][1], mesh.colors[i][0])
                                             : Eigen::Vector3f(Eigen::Vector3f::Constant(-1)));
      merged.uv.push_back(has_texture ? mesh.uv[i] : Eigen::Vector2f(Eigen::Vector2f::Zero()));
    }
    for (const auto& [a, b, c] : mesh.triangles) {
      if (std::max({a, b, c}) >= mesh.vertices.size()) continue;
      merged.triangles.push_back({base + a, base + b, base + c});
      merged.ids.push_back(instance.id);
      merged.textures.push_back(has_texture ? &instance.texture_bgr : nullptr);
    }
  }
  return merged;
}

// Relative to the distance of the farthest vertex, because the map unit may be a kilometer.
double NearPlane(const std::vector<Eigen::Vector3f>& from_camera) {
  constexpr double kShare = 1e-4;
  float farthest_mu = 0;
  for (const Eigen::Vector3f& position : from_camera) farthest_mu = std::max(farthest_mu, position.norm());
  return farthest_mu > 0 ? kShare * farthest_mu : kShare;
}

// The color of triangle `triangle` at its intersection with the ray. The light is above and left of the camera: a light
// at the camera would make surfaces that face it look flat.
Eigen::Vector3f ShadeBgr(const MergedMeshes& merged, int32_t triangle, const SE3<World, Camera>& T_world_camera,
                         const Eigen::Vector3d& ray_world, MeshPaint paint) {
  const auto& [a, b, c] = merged.triangles[triangle];
  const std::array<Eigen::Vector3f, 3> corners = {merged.positions_world[a], merged.positions_world[b],
                                                  merged.positions_world[c]};
  const Eigen::Vector3f weights = Barycentrics(corners, T_world_camera.translation(), ray_world);
  if (paint == MeshPaint::kColored && merged.textures[triangle] != nullptr) {
    return SampleTexture(*merged.textures[triangle],
                         weights.x() * merged.uv[a] + weights.y() * merged.uv[b] + weights.z() * merged.uv[c]);
  }
  const Eigen::Vector3f color =
      weights.x() * merged.colors_bgr[a] + weights.y() * merged.colors_bgr[b] + weights.z() * merged.colors_bgr[c];
  if (paint == MeshPaint::kColored && merged.colors_bgr[a].x() >= 0) return color;

  Eigen::Vector3f normal =
      weights.x() * merged.normals[a] + weights.y() * merged.normals[b] + weights.z() * merged.normals[c];
  if (normal.squaredNorm() < 1e-12F) {
    normal = (corners[1] - corners[0]).normalized().cross((corners[2] - corners[0]).normalized());
  }
  normal.normalize();
  static const Eigen::Vector3d kToLightCamera = Eigen::Vector3d(-0.35, -0.6, -0.72).normalized();
  const Eigen::Vector3f to_light = (T_world_camera.rotation() * kToLightCamera).cast<float>();
  const bool faces_away = normal.cast<double>().dot(ray_world) > 0;
  const float cosine = std::max(0.0F, (faces_away ? -1.0F : 1.0F) * normal.dot(to_light));
  return Eigen::Vector3f::Constant(60.0F + 175.0F * cosine);
}

}  // namespace

RenderedView RenderMeshes(std::span<const MeshInstance> meshes, const CameraModel& camera,
                          const SE3<World, Camera>& T_given_camera, MeshPaint paint, const cv::Scalar& background_bgr) {
  const MergedMeshes merged = Merge(meshes, T_given_camera.translation());
  const SE3<World, Camera> T_world_camera(T_given_camera.rotation(), Eigen::Vector3d::Zero());
  const TriangleSoup soup{merged.positions_world, merged.triangles};
  const RasterOptions options{.near_mu = NearPlane(merged.positions_world)};
  const VisibilityImage centers = Rasterize(camera, T_world_camera, soup, options);
  const CameraModel fine_camera = Supersampled(camera, kSamplesAcross);
  const VisibilityImage fine = Rasterize(fine_camera, T_world_camera, soup, options);

  RenderedView view;
  view.color_bgr.create(camera.height_px, camera.width_px, CV_8UC3);
  view.depth_mu.create(camera.height_px, camera.width_px, CV_32FC1);
  view.ids.create(camera.height_px, camera.width_px, CV_16UC1);
  const Eigen::Vector3f background(static_cast<float>(background_bgr[0]), static_cast<float>(background_bgr[1]),
                                   static_cast<float>(background_bgr[2]));
  ParallelFor(camera.height_px, [&](int v) {
    for (int u = 0; u < camera.width_px; ++u) {
      const int32_t triangle = centers.triangle[centers.Index(u, v)];
      view.depth_mu.at<float>(v, u) = centers.Depth(u, v);
      view.ids.at<uint16_t>(v, u) = triangle == VisibilityImage::kNothing ? uint16_t{0} : merged.ids[triangle];
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      for (int j = 0; j < kSamplesAcross; ++j) {
        for (int i = 0; i < kSamplesAcross; ++i) {
          const int fine_u = u * kSamplesAcross + i;
          const int fine_v = v * kSamplesAcross + j;
          const int32_t hit = fine.triangle[fine.Index(fine_u, fine_v)];
          const Eigen::Vector3d ray_world = T_world_camera.rotation() * fine_camera.Unproject(fine_u, fine_v);
          sum +=
              hit == VisibilityImage::kNothing ? background : ShadeBgr(merged, hit, T_world_camera, ray_world, paint);
        }
      }
      for (int k = 0; k < 3; ++k) {
        view.color_bgr.at<cv::Vec3b>(v, u)[k] =
            cv::saturate_cast<uint8_t>(sum[k] / static_cast<float>(kSamplesAcross * kSamplesAcross));
      }
    }
  });
  return view;
}

}  // namespace romap::render
