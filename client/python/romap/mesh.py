"""Meshes as numpy arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

import numpy as np

from .errors import invalid
from .geometry import Array


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh. Arrays that it does not have are None."""

    vertices: Array  # N x 3, float32
    triangles: Array  # M x 3, uint32: counter-clockwise viewed from outside
    normals: Optional[Array] = None  # N x 3, float32, unit length
    colors: Optional[Array] = None  # N x 3, uint8, sRGB
    uv: Optional[Array] = None  # N x 2, float32: u to the right, v down, as in glTF
    confidence: Optional[Array] = None  # N, float32: how well the views observed the vertex, 0..1

    def transformed(self, pose: Array, scale: float = 1.0) -> Mesh:
        """The mesh with vertices pose * (scale * vertex), in float64."""
        rotation = pose[:3, :3]
        vertices = scale * self.vertices.astype(np.float64) @ rotation.T + pose[:3, 3]
        normals = None if self.normals is None else self.normals @ rotation.T
        return Mesh(vertices, self.triangles, normals, self.colors, self.uv, self.confidence)


def decode_mesh(draco: bytes) -> Mesh:
    """Decodes MeshUpdate.draco. INVALID_ARGUMENT: not a mesh of romap."""
    from romap._draco import decode

    try:
        vertices, triangles, normals, colors, uv, confidence = decode(draco)
    except ValueError as error:
        raise invalid(str(error)) from None

    def array(data: bytearray, dtype: type, columns: int) -> Optional[Array]:
        return np.frombuffer(data, dtype).reshape(-1, columns) if data else None

    return Mesh(
        np.frombuffer(vertices, np.float32).reshape(-1, 3),
        np.frombuffer(triangles, np.uint32).reshape(-1, 3),
        array(normals, np.float32, 3),
        array(colors, np.uint8, 3),
        array(uv, np.float32, 2),
        np.frombuffer(confidence, np.float32) if confidence else None,
    )
