"""Camera poses, gravity and intrinsics of AR frameworks and robots in the convention of romap.

romap: camera x right, y down, z forward (OpenCV, the optical frame of ROS); world right-handed, z up; a pose maps the
camera to the world; pixel centers are at integer coordinates. See client/integration.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .camera import Camera
from .geometry import Array, pose, rotation_matrix

# The axes of a camera x right, y up, z backward (OpenGL, ARKit, ARCore) in those of romap, and the reverse.
_OPENGL_CAMERA = np.diag([1.0, -1.0, -1.0, 1.0])
# A world whose y is up, turned about its x axis into one whose z is up: (x, y, z) becomes (x, -z, y).
_Z_UP_FROM_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
# The columns are the axes of an optical frame in a body frame of ROS: x right = -y, y down = -z, z forward = x.
ROS_BODY_FROM_OPTICAL = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


def pose_from_opengl(t_world_camera: Any) -> Array:
    """The pose of a camera that is given with x right, y up, z backward, in a world whose y is up: ARKit's
    ARCamera.transform with the alignment .gravity, and the matrix of ARCore's Camera.getPose()."""
    return np.asarray(_Z_UP_FROM_Y_UP @ np.asarray(t_world_camera, dtype=float) @ _OPENGL_CAMERA)


def gravity_of_pose(t_world_camera: Any) -> Array:
    """The direction of gravity in the camera frame of a pose of romap, whose world has z up."""
    return -np.asarray(t_world_camera, dtype=float)[2, :3]


def gravity_from_opengl(down_camera: Any) -> Array:
    """A direction in a camera with x right, y up, z backward in the camera frame of romap."""
    return np.asarray(down_camera, dtype=float) * [1, -1, -1]


def camera_from_arkit(intrinsics_columns: Any, width: int, height: int) -> Camera:
    """ARCamera.intrinsics: `intrinsics_columns` are the columns of the simd_float3x3, so that [2] is (cx, cy, 1).
    The image resolution is that of ARCamera.imageResolution; the image is in landscape, as the sensor delivers it."""
    columns = np.asarray(intrinsics_columns, dtype=float)
    return Camera(width, height, columns[0][0], columns[1][1], columns[2][0], columns[2][1])


def camera_from_arcore(focal_length: Any, principal_point: Any, width: int, height: int) -> Camera:
    """CameraIntrinsics of Camera.getImageIntrinsics(): getFocalLength(), getPrincipalPoint(), getImageDimensions()."""
    (fx, fy), (cx, cy) = focal_length, principal_point
    return Camera(width, height, float(fx), float(fy), float(cx), float(cy))


def camera_from_ros(width: int, height: int, k: Any, d: Any = (), distortion_model: str = "plumb_bob") -> Camera:
    """sensor_msgs/CameraInfo of an image that is not rectified. `k`: 9 numbers, row-major. `distortion_model`:
    "plumb_bob" or "equidistant". Of a rectified image, pass the first three columns of P and no `d`."""
    lenses = {"plumb_bob": "radial-tangential", "equidistant": "fisheye"}
    if distortion_model not in lenses and any(d):
        raise ValueError(f"the lens model {distortion_model} must be one of {', '.join(lenses)}; rectify the images")
    m = np.asarray(k, dtype=float).reshape(3, 3)
    distortion = tuple(float(each) for each in d) if any(d) else ()
    lens = lenses.get(distortion_model, "radial-tangential")
    return Camera(width, height, m[0, 0], m[1, 1], m[0, 2], m[1, 2], distortion, lens)


def pose_from_ros(quaternion_xyzw: Any, translation: Any) -> Array:
    """The transform from the optical frame of the camera (header.frame_id of its images, REP 103) to a world with z up
    (map or odom, REP 105), e.g. of tf2: lookup_transform("map", image.header.frame_id, image.header.stamp)."""
    return pose(quaternion_xyzw, translation)


def pose_from_ros_body(quaternion_xyzw: Any, translation: Any) -> Array:
    """As pose_from_ros(), of a camera frame with x forward, y left, z up ("camera_link") at the place of the camera."""
    return np.asarray(pose(quaternion_xyzw, translation) @ ROS_BODY_FROM_OPTICAL)


def timestamp_ns(seconds: float) -> int:
    """Of a time in seconds, e.g. ARFrame.timestamp. Only differences matter. ARCore's Frame.getTimestamp() and the
    stamp of ROS (sec * 10**9 + nanosec) are in nanoseconds already."""
    return round(seconds * 1e9)


def gravity_from_imu(acceleration_imu: Any, rotation_camera_imu: Any) -> Array:
    """Gravity in the camera frame of romap of an accelerometer at rest, which measures the opposite direction (up), as
    sensor_msgs/Imu does. `rotation_camera_imu`: x, y, z, w from the IMU to the optical frame."""
    return np.asarray(-rotation_matrix(rotation_camera_imu) @ np.asarray(acceleration_imu, dtype=float))
