// A client of an AR framework, which knows the pose of the camera and gravity: maps a recorded AR session.
//
//   ar_client HOST:PORT FOLDER FX FY CX CY WIDTH HEIGHT
//
// FOLDER/frames.txt has one line per frame: time [s], JPEG or PNG file, PNG file of the mask, and the pose as ARKit
// (ARCamera.transform) and ARCore (Camera.getPose()) give it: tx ty tz qx qy qz qw, camera to world, the camera with
// x right, y up, z backward, in a world whose y is up. See client/integration.md.

#include <fstream>
#include <iterator>
#include <sstream>

#include "feed.h"

namespace {

// Two rotations about x: of the world from y up to z up, and of the camera to y down, z forward.
romap::SE3<romap::World, romap::Camera> FromArPose(const Eigen::Quaterniond& rotation,
                                                   const Eigen::Vector3d& translation) {
  const Eigen::Quaterniond up(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX()));
  const Eigen::Quaterniond flip(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()));
  return {up * rotation * flip, up * translation};
}

// A direction in the AR camera, e.g. of the device's motion sensor, in the camera frame of romap.
Eigen::Vector3d FromArDirection(const Eigen::Vector3d& v) { return {v.x(), -v.y(), -v.z()}; }

std::string ReadFile(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream) Feed::Check(absl::NotFoundError("cannot read " + path));
  return std::string(std::istreambuf_iterator<char>(stream), {});
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 9) return std::fprintf(stderr, "ar_client HOST:PORT FOLDER FX FY CX CY WIDTH HEIGHT\n"), 2;
  const std::string folder = argv[2];
  romap::SessionOptions options;
  options.name = "ar";
  options.camera.fx_px = std::atof(argv[3]);
  options.camera.fy_px = std::atof(argv[4]);
  options.camera.cx_px = std::atof(argv[5]);
  options.camera.cy_px = std::atof(argv[6]);
  options.camera.width_px = std::atoi(argv[7]);
  options.camera.height_px = std::atoi(argv[8]);
  // The poses of AR frameworks are good, but not exact: options.pose_use = romap::PoseUse::kPrior lets the images
  // correct them. Exact ones, e.g. of a robot arm, are used as they are.

  const auto server = Feed::Check(romap::client::RemoteMappingService::Connect(argv[1]));
  Feed feed(*server, options, /*is_live=*/false);
  std::istringstream frames(ReadFile(folder + "/frames.txt"));
  double time_s = 0;
  std::string image, mask;
  Eigen::Vector3d t;
  Eigen::Quaterniond q;
  for (uint64_t id = 1;
       frames >> time_s >> image >> mask >> t.x() >> t.y() >> t.z() >> q.x() >> q.y() >> q.z() >> q.w(); ++id) {
    romap::FrameInput frame;
    frame.frame_id = id;
    frame.timestamp_ns = std::llround(time_s * 1e9);
    frame.image = ReadFile(folder + "/" + image);
    frame.image_encoding =
        frame.image.starts_with("\xff\xd8") ? romap::ImageEncoding::kJpeg : romap::ImageEncoding::kPng;
    frame.mask_encoding = romap::MaskEncoding::kLabelPng;
    frame.label_png = ReadFile(folder + "/" + mask);
    frame.T_world_camera = FromArPose(q, t);
    frame.gravity_camera = FromArDirection(q.conjugate() * Eigen::Vector3d(0, -1, 0));
    feed.Send(std::move(frame));
  }
  PrintObjects(feed.Finish());
}
