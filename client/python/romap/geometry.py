"""Poses as 4x4 matrices, and their form on the wire."""

from __future__ import annotations

from typing import Any, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

import romap.v1.mapping_pb2 as pb

from .errors import invalid

Array = npt.NDArray[Any]
Vector = Union[Sequence[float], Array]


def rotation_matrix(quaternion_xyzw: Vector) -> Array:
    """The 3x3 rotation matrix of a quaternion x, y, z, w (Hamilton), which is normalized."""
    x, y, z, w = np.asarray(quaternion_xyzw, dtype=float) / np.linalg.norm(quaternion_xyzw)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion(rotation: Array) -> Array:
    """The quaternion x, y, z, w with w >= 0 of a 3x3 rotation matrix."""
    # Shepperd's method: the largest component is found first, so that nothing is divided by a small number.
    r = np.asarray(rotation, dtype=float)
    trace = np.trace(r)
    squares = np.array([1 + 2 * r[0, 0] - trace, 1 + 2 * r[1, 1] - trace, 1 + 2 * r[2, 2] - trace, 1 + trace])
    largest = int(np.argmax(squares))
    if largest == 3:
        q = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], squares[3]])
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        q = np.empty(4)
        q[i], q[j], q[k] = squares[i], r[i, j] + r[j, i], r[i, k] + r[k, i]
        q[3] = r[k, j] - r[j, k]
    q /= np.linalg.norm(q)
    return q if q[3] >= 0 else -q


def pose(quaternion_xyzw: Vector, translation: Vector) -> Array:
    """The 4x4 matrix of a rotation and a translation."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_matrix(quaternion_xyzw)
    matrix[:3, 3] = translation
    return matrix


def transform_to_proto(matrix: Any, name: str) -> Any:
    m = np.asarray(matrix, dtype=float)
    if m.shape != (4, 4):
        raise invalid(f"{name}: must be a 4x4 matrix, has the shape {m.shape}")
    if not np.isfinite(m).all():
        raise invalid(f"{name}: has values that are not finite")
    rotation = m[:3, :3]
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3) or np.linalg.det(rotation) < 0:
        raise invalid(f"{name}: its upper left 3x3 part is not a rotation matrix")
    if not np.allclose(m[3], [0, 0, 0, 1]):
        raise invalid(f"{name}: its last row must be 0 0 0 1")
    x, y, z, w = quaternion(rotation)
    return pb.RigidTransform(rotation=pb.Quaternion(x=x, y=y, z=z, w=w), translation=vector_to_proto(m[:3, 3], name))


def vector_to_proto(vector: Any, name: str) -> Any:
    v = np.asarray(vector, dtype=float)
    if v.shape != (3,):
        raise invalid(f"{name}: must have 3 numbers, has the shape {v.shape}")
    return pb.Vector3(x=v[0], y=v[1], z=v[2])


def vector_from_proto(proto: Any) -> Array:
    return np.array([proto.x, proto.y, proto.z])


def rotation_from_proto(proto: Any) -> Array:
    return rotation_matrix([proto.x, proto.y, proto.z, proto.w])


def transform_from_proto(proto: Any) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_from_proto(proto.rotation)
    matrix[:3, 3] = vector_from_proto(proto.translation)
    return matrix


def optional_transform(message: Any, field: str) -> Optional[Array]:
    return transform_from_proto(getattr(message, field)) if message.HasField(field) else None
