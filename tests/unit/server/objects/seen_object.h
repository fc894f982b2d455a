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

// A synthetic object as the cuboid fit gets to know it.
struct SeenObject {
  Cuboid truth;
  std::vector<Silhouette> silhouettes;
  CuboidEvidence evidence;  // the grid is that of the world, moved
  double pixel_mu = 0;      // what a pixel is at the object
};

// May spoil the labels of frame `index`, which show the object as `label`.
using MaskDamager = std::function<void(int index, uint16_t label, cv::Mat* labels)>;

// One object that stands by itself in the middle of the table, with exact masks, before damage, from `frames` sides.
inline SeenObject SeeObject(SyntheticShape shape, const Eigen::Vector3d& half_extents, double yaw_rad,
                            SyntheticWorldOptions options, const MaskDamager& damage = {}) {
  constexpr double kSizeSlack = 1.1;
  constexpr int kHullCells = 28;
  options.permute_labels = false;
  options.objects = {{"thing", shape, {0, 0, half_extents.z()}, half_extents, yaw_rad}};
  const SyntheticWorld world(options);
  SeenObject seen;
  seen.truth = world.TrueCuboid(0);
  seen.pixel_mu = options.orbit_radius_mu / options.focal_px;
  for (int i = 0; i < options.frames; ++i) {
    KeyframeView view = world.MakeKeyframe(i, world.MakeFrame(i));
    Frame frame = *view.frame;
    frame.labels = frame.labels.clone();
    if (damage) damage(i, 1, &frame.labels);
    const std::vector<Detection> detections = ExtractDetections(frame, {});
    view.frame = std::make_shared<const Frame>(std::move(frame));
    const auto masks = ThinMasks(view.frame->labels, detections, {1});
    seen.silhouettes.push_back(MakeSilhouette(view, masks, detections.front(), 0));
  }
  CuboidEvidence& evidence = seen.evidence;
  evidence.object_size_mu = kSizeSlack * 2 * half_extents.norm();
  const Eigen::Vector3d off = 0.05 * evidence.object_size_mu * Eigen::Vector3d(1, -1, 0.5);
  evidence.region.center_world = seen.truth.T_world_object.translation() + off;
  evidence.region.half_extents.setConstant(0.85 * evidence.object_size_mu);
  evidence.center = -0.5 * off;
  SilhouetteHull hull;
  hull.Reset(evidence.region, kHullCells);
  for (const Silhouette& silhouette : seen.silhouettes) hull.Add(silhouette);
  evidence.hull_cells = hull.Cells({.max_outside = options.frames / 20, .min_inside = options.frames / 3});
  evidence.cell_size = hull.CellSize();
  for (const Eigen::Vector3d& p : world.SurfacePoints(0, 200)) evidence.points.push_back(evidence.region.ToGrid(p));
  for (int x = -5; x <= 5; ++x) {
    for (int y = -5; y <= 5; ++y) evidence.background.push_back(evidence.region.ToGrid({0.05 * x, 0.05 * y, 0}));
  }
  return seen;
}

// The six faces of a box of the same yaw: the largest distance to the true ones, map units.
inline double LargestFaceError(const Cuboid& cuboid, const Cuboid& truth) {
  const Eigen::Vector3d shift = truth.T_world_object.Inverse() * cuboid.T_world_object.translation();
  const Eigen::Vector3d growth = cuboid.half_extents - truth.half_extents;
  return ((shift + growth).cwiseAbs().cwiseMax((shift - growth).cwiseAbs())).maxCoeff();
}

}  // namespace romap::objects
