#include "tests/support/foreign_layouts.h"

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <bit>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace romap::testing_support {
namespace {

Eigen::Matrix4d InverseOf(const Eigen::Matrix4d& T) { return T.inverse(); }

// Columns 2 and 3 change sign: the y and z axes of the camera point the other way.
Eigen::Matrix4d InOpenGlAxes(Eigen::Matrix4d T) {
  T.col(1) *= -1;
  T.col(2) *= -1;
  return T;
}

std::string RowMajorText(const Eigen::Matrix4d& T, const char* separator, const char* row_separator) {
  std::string text;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      text += fmt::format("{}{}", column > 0 ? separator : row > 0 ? row_separator : "", T(row, column));
    }
  }
  return text;
}

// A row-major matrix as a JSON list of rows.
std::string JsonMatrix(const Eigen::Matrix4d& T) { return "[[" + RowMajorText(T, ", ", "], [") + "]]"; }

// Depth with another value for "unknown".
cv::Mat WithUnknown(const cv::Mat& depth_mm, int value) {
  cv::Mat depth = depth_mm.clone();
  depth.setTo(value, depth_mm == 0);
  return depth;
}

cv::Mat EverySecondPixel(const cv::Mat& image) {
  cv::Mat half(image.rows / 2, image.cols / 2, image.type());
  for (int y = 0; y < half.rows; ++y) {
    for (int x = 0; x < half.cols; ++x) image(cv::Rect(2 * x, 2 * y, 1, 1)).copyTo(half(cv::Rect(x, y, 1, 1)));
  }
  return half;
}

template <class T>
void Append(std::string* bytes, T value) {
  static_assert(std::endian::native == std::endian::little);
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(value));
}

}  // namespace

void WriteTumLayout(const SampleRecording& sample, const std::string& dir) {
  std::string rgb = "# color images\n", depth = "# depth maps\n", poses = "# ground truth trajectory\n";
  for (const SampleFrame& frame : sample.frames) {
    const double time_s = 1305031102.175 + frame.time_s;
    const std::string color_name = fmt::format("rgb/{:.6f}.png", time_s);
    const std::string depth_name = fmt::format("depth/{:.6f}.png", time_s + 0.008);
    WriteImage(dir + "/" + color_name, frame.color);
    WriteImage(dir + "/" + depth_name, frame.depth_mm * 5);  // 5000 per meter
    rgb += fmt::format("{:.6f} {}\n", time_s, color_name);
    depth += fmt::format("{:.6f} {}\n", time_s + 0.008, depth_name);
    const Eigen::Quaterniond q(Eigen::Matrix3d(frame.T_world_camera.topLeftCorner<3, 3>()));
    const Eigen::Vector3d t = frame.T_world_camera.topRightCorner<3, 1>();
    for (const double offset_s : {-0.003, 0.003}) {
      poses += fmt::format("{:.4f} {} {} {} {} {} {} {}\n", time_s + offset_s, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(),
                           q.w());
    }
  }
  WriteText(dir + "/rgb.txt", rgb);
  WriteText(dir + "/depth.txt", depth);
  WriteText(dir + "/groundtruth.txt", poses);
}

void WriteSevenScenesLayout(const SampleRecording& sample, const std::string& dir) {
  for (size_t k = 0; k < sample.frames.size(); ++k) {
    const std::string base = fmt::format("{}/frame-{:06}", dir, k);
    WriteImage(base + ".color.png", sample.frames[k].color);
    WriteImage(base + ".depth.png", WithUnknown(sample.frames[k].depth_mm, 65535));
    WriteText(base + ".pose.txt", RowMajorText(sample.frames[k].T_world_camera, "\t ", "\t\n") + "\n");
  }
}

void WriteReplicaLayout(const SampleRecording& sample, const std::string& dir) {
  const CameraModel& camera = sample.camera;
  std::string trajectory;
  for (size_t k = 0; k < sample.frames.size(); ++k) {
    WriteImage(fmt::format("{}/results/frame{:06}.jpg", dir, k), sample.frames[k].color);
    cv::Mat depth;
    sample.frames[k].depth_mm.convertTo(depth, CV_16U, 6.5535);
    WriteImage(fmt::format("{}/results/depth{:06}.png", dir, k), depth);
    trajectory += RowMajorText(sample.frames[k].T_world_camera, " ", " ") + "\n";
  }
  WriteText(dir + "/traj.txt", trajectory);
  WriteText(
      dir + "/../cam_params.json",
      fmt::format(R"({{"camera": {{"w": {}, "h": {}, "fx": {}, "fy": {}, "cx": {}, "cy": {}, "scale": 6553.5}}}})",
                  camera.width_px, camera.height_px, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px));
}

void WriteVmapLayout(const SampleRecording& sample, const std::string& dir) {
  std::string trajectory;
  for (size_t k = 0; k < sample.frames.size(); ++k) {
    WriteImage(fmt::format("{}/rgb/rgb_{}.png", dir, k), sample.frames[k].color);
    WriteImage(fmt::format("{}/depth/depth_{}.png", dir, k), sample.frames[k].depth_mm);
    WriteImage(fmt::format("{0}/semantic_instance/semantic_instance_{1}.png", dir, k), sample.frames[k].labels);
    trajectory += RowMajorText(sample.frames[k].T_world_camera, " ", " ") + "\n";
  }
  WriteText(dir + "/traj_w_c.txt", trajectory);
}

void WriteTransformsLayout(const SampleRecording& sample, const std::string& dir, const TransformsStyle& style) {
  const CameraModel& camera = sample.camera;
  // The corner of the image is the origin of its coordinates.
  const auto intrinsics = [&](double change_px) {
    return fmt::format(
        R"("fl_x": {}, "fl_y": {}, "cx": {}, "cy": {}, "w": {:.1f}, "h": {:.1f}, "k1": {}, "k2": {}, "p1": {}, "p2": {})",
        camera.fx_px + change_px, camera.fy_px, camera.cx_px + 0.5, camera.cy_px + 0.5,
        static_cast<double>(camera.width_px), static_cast<double>(camera.height_px), camera.distortion[0],
        camera.distortion[1], camera.distortion[2], camera.distortion[3]);
  };
  std::string frames;
  const size_t count = sample.frames.size();
  for (size_t i = 0; i < count; ++i) {
    const size_t k = style.shuffled ? (7 * i + 3) % count : i;  // count is no multiple of 7
    const SampleFrame& frame = sample.frames[k];
    const std::string number = std::to_string(k + 1);
    WriteImage(dir + "/images/" + number + ".png", frame.color);
    WriteImage(dir + "/masks/" + number + ".png", frame.labels);
    WriteImage(dir + "/images/" + number + ".depth.png", frame.depth_mm);
    frames += fmt::format(
        R"({}{{"file_path": "images/{}{}", "{}": "images/{}.depth.png", "mask_path": "masks/{}.png", {}
  "transform_matrix": {}}})",
        frames.empty() ? "" : ",\n", number, style.instant_ngp ? "" : ".png",
        style.instant_ngp ? "depth_path" : "depth_file_path", number, number,
        style.per_frame_camera ? intrinsics(k + 1 == count ? style.focal_change_px : 0) + ", " : "",
        JsonMatrix(InOpenGlAxes(frame.T_world_camera)));
  }
  WriteText(
      dir + "/transforms.json",
      fmt::format("{{{}{} \"applied_transform\": [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]],\n\"frames\": [{}]}}",
                  style.per_frame_camera ? "\"camera_model\": \"OPENCV\"," : intrinsics(0) + ",",
                  style.instant_ngp ? "\"integer_depth_scale\": 0.001," : "", frames));
}

void WriteColmapLayout(const SampleRecording& sample, const std::string& dir, bool binary) {
  const CameraModel& c = sample.camera;
  const std::array<double, 8> parameters = {c.fx_px,         c.fy_px,         c.cx_px + 0.5,   c.cy_px + 0.5,
                                            c.distortion[0], c.distortion[1], c.distortion[2], c.distortion[3]};
  const size_t count = sample.frames.size();
  std::string cameras_text = "# Camera list\n7 OPENCV " + fmt::format("{} {}", c.width_px, c.height_px);
  for (const double parameter : parameters) cameras_text += fmt::format(" {}", parameter);
  std::string cameras, images, images_text = "# Image list with two lines of data per image\n";
  Append<uint64_t>(&cameras, 1);
  Append<int32_t>(&cameras, 7);
  Append<int32_t>(&cameras, 4);  // OPENCV
  Append<uint64_t>(&cameras, static_cast<uint64_t>(c.width_px));
  Append<uint64_t>(&cameras, static_cast<uint64_t>(c.height_px));
  for (const double parameter : parameters) Append(&cameras, parameter);
  Append<uint64_t>(&images, count);
  for (size_t i = 0; i < count; ++i) {
    const size_t k = (7 * i + 4) % count;  // ids in another order than names; count is no multiple of 7
    const Eigen::Matrix4d T_camera_world = InverseOf(sample.frames[k].T_world_camera);
    const Eigen::Quaterniond q(Eigen::Matrix3d(T_camera_world.topLeftCorner<3, 3>()));
    const Eigen::Vector3d t = T_camera_world.topRightCorner<3, 1>();
    const std::string name = fmt::format("frame_{}.png", k);
    WriteImage(dir + "/images/" + name, sample.frames[k].color);
    WriteImage(dir + "/masks/" + name + ".png", sample.frames[k].labels);
    const bool has_points = i % 3 == 0;
    images_text += fmt::format("{} {} {} {} {} {} {} {} 7 {}\n{}\n", 100 - i, q.w(), q.x(), q.y(), q.z(), t.x(), t.y(),
                               t.z(), name, has_points ? "1.5 2.5 -1 3.5 4.5 12" : "");
    Append<int32_t>(&images, static_cast<int32_t>(100 - i));
    for (const double value : {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()}) Append(&images, value);
    Append<int32_t>(&images, 7);
    images += name + '\0';
    Append<uint64_t>(&images, has_points ? 2 : 0);
    for (int point = 0; has_points && point < 2; ++point) {
      Append(&images, 1.5);
      Append(&images, 2.5);
      Append<int64_t>(&images, -1);
    }
  }
  const std::string model = dir + "/sparse/0";
  WriteText(model + (binary ? "/cameras.bin" : "/cameras.txt"), binary ? cameras : cameras_text + "\n");
  WriteText(model + (binary ? "/images.bin" : "/images.txt"), binary ? images : images_text);
}

void WriteBopLayout(const SampleRecording& sample, const std::string& dir) {
  const CameraModel& c = sample.camera;
  std::string cameras, truth;
  for (size_t k = 0; k < sample.frames.size(); ++k) {
    const SampleFrame& frame = sample.frames[k];
    const size_t id = 5 * k + 2;  // images are a part of a recording
    const Eigen::Matrix4d T_camera_world = InverseOf(frame.T_world_camera);
    const Eigen::Matrix3d r = T_camera_world.topLeftCorner<3, 3>();
    const Eigen::Vector3d t_mm = 1000 * T_camera_world.topRightCorner<3, 1>();
    const std::string separator = k == 0 ? "" : ",\n";
    // Depth units of 0.1 mm.
    cameras += fmt::format(
        R"({}"{}": {{"cam_K": [{}, 0.0, {}, 0.0, {}, {}, 0.0, 0.0, 1.0], "depth_scale": 0.1,
"cam_R_w2c": [{}, {}, {}, {}, {}, {}, {}, {}, {}], "cam_t_w2c": [{}, {}, {}]}})",
        separator, id, c.fx_px, c.cx_px, c.fy_px, c.cy_px, r(0, 0), r(0, 1), r(0, 2), r(1, 0), r(1, 1), r(1, 2),
        r(2, 0), r(2, 1), r(2, 2), t_mm.x(), t_mm.y(), t_mm.z());
    WriteImage(fmt::format("{}/rgb/{:06}.png", dir, id), frame.color);
    WriteImage(fmt::format("{}/depth/{:06}.png", dir, id), frame.depth_mm * 10);
    truth += fmt::format("{}\"{}\": [", separator, id);
    size_t instance = 0;
    for (const auto& [label, name] : sample.classes) {
      truth += fmt::format(R"({}{{"cam_R_m2c": [1, 0, 0, 0, 1, 0, 0, 0, 1], "cam_t_m2c": [0, 0, 0], "obj_id": {}}})",
                           instance == 0 ? "" : ", ", label);
      WriteImage(fmt::format("{}/mask_visib/{:06}_{:06}.png", dir, id, instance++), frame.labels == label);
    }
    truth += "]";
  }
  WriteText(dir + "/scene_camera.json", "{" + cameras + "}");
  WriteText(dir + "/scene_gt.json", "{" + truth + "}");
}

void WriteScanNetLayout(const SampleRecording& sample, const std::string& dir) {
  const CameraModel& c = sample.camera;
  const auto matrix = [](double fx, double fy, double cx, double cy) {
    return fmt::format("{} 0 {} 0\n0 {} {} 0\n0 0 1 0\n0 0 0 1\n", fx, cx, fy, cy);
  };
  WriteText(dir + "/intrinsic/intrinsic_color.txt", matrix(c.fx_px, c.fy_px, c.cx_px, c.cy_px));
  // The center of pixel u of the color image is at (u + 0.5) / 2 - 0.5 of an image of half the size. The depth image
  // has one more column at both sides.
  WriteText(dir + "/intrinsic/intrinsic_depth.txt",
            matrix(c.fx_px / 2, c.fy_px / 2, (c.cx_px + 0.5) / 2 - 0.5 + 1, (c.cy_px + 0.5) / 2 - 0.5));
  for (size_t k = 0; k < sample.frames.size(); ++k) {
    const SampleFrame& frame = sample.frames[k];
    WriteImage(fmt::format("{}/color/{}.jpg", dir, k), frame.color);
    cv::Mat depth;
    cv::copyMakeBorder(EverySecondPixel(frame.depth_mm), depth, 0, 0, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(9999));
    WriteImage(fmt::format("{}/depth/{}.png", dir, k), depth);
    WriteImage(fmt::format("{}/instance-filt/{}.png", dir, k), frame.labels);
    WriteText(fmt::format("{}/pose/{}.txt", dir, k), RowMajorText(frame.T_world_camera, " ", "\n") + "\n");
  }
  std::string groups;
  for (const auto& [label, name] : sample.classes) {
    groups += fmt::format(R"({}{{"objectId": {}, "label": "{}", "segments": []}})", groups.empty() ? "" : ", ",
                          label - 1, name);
  }
  WriteText(dir + "/scene.aggregation.json", "{\"segGroups\": [" + groups + "]}");
}

void WriteEurocLayout(const SampleRecording& sample, const std::string& dir) {
  const CameraModel& c = sample.camera;
  Eigen::Matrix4d T_body_camera = Eigen::Matrix4d::Identity();
  T_body_camera.topLeftCorner<3, 3>() =
      Eigen::AngleAxisd(1.2, Eigen::Vector3d(0.3, 0.5, -0.8).normalized()).toRotationMatrix();
  T_body_camera.topRightCorner<3, 1>() << -0.02, -0.06, 0.01;
  std::string images = "#timestamp [ns],filename\r\n";
  std::string states =
      "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
      "q_RS_z [], v_RS_R_x [m s^-1]\r\n";
  for (const SampleFrame& frame : sample.frames) {
    const int64_t time_ns = 1403636579763555584 + std::llround(1e9 * frame.time_s);
    images += fmt::format("{0},{0}.png\r\n", time_ns);
    cv::Mat gray;
    cv::cvtColor(frame.color, gray, cv::COLOR_BGR2GRAY);
    WriteImage(fmt::format("{}/mav0/cam0/data/{}.png", dir, time_ns), gray);
    const Eigen::Matrix4d T_world_body = frame.T_world_camera * InverseOf(T_body_camera);
    const Eigen::Quaterniond q(Eigen::Matrix3d(T_world_body.topLeftCorner<3, 3>()));
    states += fmt::format("{},{},{},{},{},{},{},{},0.5\r\n", time_ns, T_world_body(0, 3), T_world_body(1, 3),
                          T_world_body(2, 3), q.w(), q.x(), q.y(), q.z());
  }
  WriteText(dir + "/mav0/cam0/data.csv", images);
  WriteText(dir + "/mav0/state_groundtruth_estimate0/data.csv", states);
  WriteText(
      dir + "/mav0/cam0/sensor.yaml",
      fmt::format("# General sensor definitions.\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [{}]\n"
                  "rate_hz: 10\nresolution: [{}, {}]\ncamera_model: pinhole\nintrinsics: [{}, {}, {}, {}]\n"
                  "distortion_model: radial-tangential\ndistortion_coefficients: [{}, {}, {}, {}]\n",
                  RowMajorText(T_body_camera, ", ", ",\n    "), c.width_px, c.height_px, c.fx_px, c.fy_px, c.cx_px,
                  c.cy_px, c.distortion[0], c.distortion[1], c.distortion[2], c.distortion[3]));
}

void WriteArkitScenesLayout(const SampleRecording& sample, const std::string& dir) {
  const CameraModel& c = sample.camera;
  std::string trajectory;
  for (size_t k = 0; k < sample.frames.size(); ++k) {
    const SampleFrame& frame = sample.frames[k];
    const double time_s = 3310.25 + frame.time_s;
    WriteImage(fmt::format("{}/lowres_wide/41048190_{:.3f}.png", dir, time_s), frame.color);
    WriteText(
        fmt::format("{}/lowres_wide_intrinsics/41048190_{:.3f}.pincam", dir, time_s + 0.001),
        fmt::format("{} {} {} {} {} {}", c.width_px, c.height_px, c.fx_px, c.fy_px, c.cx_px + 0.5, c.cy_px + 0.5));
    WriteImage(fmt::format("{}/lowres_depth/41048190_{:.3f}.png", dir, time_s), WithUnknown(frame.depth_mm, 3000));
    cv::Mat confidence(frame.depth_mm.size(), CV_8UC1, cv::Scalar(2));
    confidence.setTo(1, frame.depth_mm == 0);
    WriteImage(fmt::format("{}/confidence/41048190_{:.3f}.png", dir, time_s), confidence);
    if (k % 2 == 1) continue;  // the trajectory has a lower rate
    const Eigen::Matrix4d T_camera_world = InverseOf(frame.T_world_camera);
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(T_camera_world.topLeftCorner<3, 3>()));
    const Eigen::Vector3d r = turn.angle() * turn.axis();
    trajectory += fmt::format("{:.6f} {} {} {} {} {} {}\n", time_s, r.x(), r.y(), r.z(), T_camera_world(0, 3),
                              T_camera_world(1, 3), T_camera_world(2, 3));
  }
  WriteText(dir + "/lowres_wide.traj", trajectory);
}

void WritePolycamLayout(const SampleRecording& sample, const std::string& dir, bool corrected) {
  const CameraModel& c = sample.camera;
  const std::string prefix = dir + "/keyframes/" + (corrected ? "corrected_" : "");
  for (const SampleFrame& frame : sample.frames) {
    const std::string name = std::to_string(1442008525605 + std::llround(1e6 * frame.time_s));
    const Eigen::Matrix4d T = InOpenGlAxes(frame.T_world_camera);
    std::string matrix;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) {
        matrix += fmt::format(", \"t_{}{}\": {}", row, column, T(row, column));
      }
    }
    WriteText(prefix + "cameras/" + name + ".json",
              fmt::format(R"({{"fx": {}, "fy": {}, "cx": {}, "cy": {}, "width": {}, "height": {}{}}})", c.fx_px,
                          c.fy_px, c.cx_px + 0.5, c.cy_px + 0.5, c.width_px, c.height_px, matrix));
    WriteImage(prefix + "images/" + name + ".jpg", frame.color);
    const cv::Mat depth = EverySecondPixel(frame.depth_mm);
    WriteImage(dir + "/keyframes/depth/" + name + ".png", WithUnknown(depth, 3000));
    cv::Mat confidence(depth.size(), CV_8UC1, cv::Scalar(255));
    confidence.setTo(127, depth == 0);
    WriteImage(dir + "/keyframes/confidence/" + name + ".png", confidence);
  }
}

}  // namespace romap::testing_support
