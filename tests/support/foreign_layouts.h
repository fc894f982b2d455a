#pragma once

// Writes recordings in the layouts of other projects, by the rules that these projects publish, with formulas of its
// own: it uses nothing of client/importers, so that a wrong convention there is not repeated here.

#include <string>

#include "tests/support/sample_recording.h"

namespace romap::testing_support {

// rgb.txt, depth.txt and groundtruth.txt of the TUM RGB-D benchmark. Depth images are 8 ms later than color images,
// poses 3 ms earlier and later.
void WriteTumLayout(const SampleRecording& sample, const std::string& dir);

// frame-000000.color.png, .depth.png and .pose.txt; unknown depth is 65535.
void WriteSevenScenesLayout(const SampleRecording& sample, const std::string& dir);

// results/frame000000.jpg and depth000000.png, traj.txt; cam_params.json in the folder above.
void WriteReplicaLayout(const SampleRecording& sample, const std::string& dir);

// rgb/rgb_0.png, depth/depth_0.png, semantic_instance/semantic_instance_0.png, traj_w_c.txt.
void WriteVmapLayout(const SampleRecording& sample, const std::string& dir);

struct TransformsStyle {
  bool instant_ngp = false;       // depth_path and integer_depth_scale, file_path without extension
  bool shuffled = true;           // frames in another order than their names
  bool per_frame_camera = false;  // intrinsics in every frame
  double focal_change_px = 0;     // fl_x of the last frame differs by this
};
// transforms.json and images/. Masks are label images in mask_path.
void WriteTransformsLayout(const SampleRecording& sample, const std::string& dir, const TransformsStyle& style = {});

// sparse/0 and images/, with image ids in another order than the names.
void WriteColmapLayout(const SampleRecording& sample, const std::string& dir, bool binary);

// A scene of the BOP challenge, with lengths in mm. Objects have the ids of their labels.
void WriteBopLayout(const SampleRecording& sample, const std::string& dir);

// color/0.jpg, depth/0.png (half the resolution, with intrinsics of its own), pose/0.txt, instance-filt/0.png,
// intrinsic/ and scene.aggregation.json.
void WriteScanNetLayout(const SampleRecording& sample, const std::string& dir);

// mav0/cam0 and mav0/state_groundtruth_estimate0, with gray images.
void WriteEurocLayout(const SampleRecording& sample, const std::string& dir);

// lowres_wide/, lowres_wide_intrinsics/ (1 ms later), lowres_depth/, confidence/ and lowres_wide.traj.
void WriteArkitScenesLayout(const SampleRecording& sample, const std::string& dir);

// keyframes/corrected_cameras and corrected_images, or cameras and images; depth of half the resolution.
void WritePolycamLayout(const SampleRecording& sample, const std::string& dir, bool corrected);

// Masks by the names of the frames (FRAME = "000000", "000001", ...) of WriteImageFolder().
enum class MaskLayout { kLabelPng, kInstanceFiles, kInstanceFolders, kCocoPolygons, kCocoRuns, kCocoCompressed, kYolo };
void WriteMasks(const SampleRecording& sample, const std::string& path, MaskLayout layout);

// images/000000.png and so on.
void WriteImageFolder(const SampleRecording& sample, const std::string& dir);

}  // namespace romap::testing_support
