#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <utility>
#include <vector>

#include "server/objects/cuboid_fitter.h"
#include "server/objects/detections.h"
#include "server/objects/silhouette.h"
#include "server/objects/silhouette_hull.h"
#include "tests/support/synthetic_world.h"

namespace romap::objects {

// A synthetic object as the input of a cuboid fit.
struct ObservedObject {
  Cuboid truth;
  std::vector<Silhouette> silhouettes;
  CuboidEvidence evidence;  // the axes of the grid are those of the world
  double pixel_mu = 0;      // size of a pixel at the object
};

// Modifies the labels of frame `index`, in which the object has `label`.
using MaskCorruption = std::function<void(int index, uint16_t label, cv::Mat* labels)>;

// A single object in the middle of the table, observed in all frames with exact masks that `corrupt` may modify.
inline ObservedObject ObserveObject(SyntheticShape shape, const Eigen::Vector3d& half_extents, double yaw_rad,
                                    SyntheticWorldOptions options, const MaskCorruption& corrupt = {}) {
  constexpr double kSizeSlack = 1.1;
  constexpr int kHullCells = 28;
  options.permute_labels = false;
  options.objects = {{"object", shape, {0, 0, half_extents.z()}, half_extents, yaw_rad}};
  const SyntheticWorld world(options);
  ObservedObject observed;
  observed.truth = world.TrueCuboid(0);
  observed.pixel_mu = options.orbit_radius_mu / options.focal_px;
  for (int i = 0; i < options.frames; ++i) {
    KeyframeView view = world.MakeKeyframe(i, world.MakeFrame(i));
    Frame frame = *view.frame;
    frame.labels = frame.labels.clone();
    if (corrupt) corrupt(i, 1, &frame.labels);
    const std::vector<Detection> detections = ExtractDetections(frame, {});
    view.frame = std::make_shared<const Frame>(std::move(frame));
    const auto masks = SubsampleMasks(view.frame->labels, detections, {1});
    observed.silhouettes.push_back(MakeSilhouette(view, masks, detections.front(), 0));
  }
  CuboidEvidence& evidence = observed.evidence;
  evidence.object_size_mu = kSizeSlack * 2 * half_extents.norm();
  // The center of the grid and the estimated center are not exact.
  const Eigen::Vector3d off = 0.05 * evidence.object_size_mu * Eigen::Vector3d(1, -1, 0.5);
  evidence.region.center_world = observed.truth.T_world_object.translation() + off;
  evidence.region.half_extents.setConstant(0.85 * evidence.object_size_mu);
  evidence.center = -0.5 * off;
  SilhouetteHull hull;
  hull.Reset(evidence.region, kHullCells);
  for (const Silhouette& silhouette : observed.silhouettes) hull.Add(silhouette);
  evidence.hull_cells = hull.Cells({.min_background = 1 + options.frames / 20, .min_object = options.frames / 3});
  evidence.cell_size = hull.CellSize();
  for (const Eigen::Vector3d& p : world.SurfacePoints(0, 200)) evidence.points.push_back(evidence.region.ToGrid(p));
  for (int x = -5; x <= 5; ++x) {
    for (int y = -5; y <= 5; ++y) evidence.background.push_back(evidence.region.ToGrid({0.05 * x, 0.05 * y, 0}));
  }
  return observed;
}

// Largest distance of a face from the true one, in map units, for cuboids of the same yaw.
inline double LargestFaceError(const Cuboid& cuboid, const Cuboid& truth) {
  const Eigen::Vector3d shift = truth.T_world_object.Inverse() * cuboid.T_world_object.translation();
  const Eigen::Vector3d growth = cuboid.half_extents - truth.half_extents;
  return ((shift + growth).cwiseAbs().cwiseMax((shift - growth).cwiseAbs())).maxCoeff();
}

}  // namespace romap::objects
