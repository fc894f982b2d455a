"""The events of a session and the parts of a map. Poses are 4x4 matrices, lengths are in the unit of the poses.

Words such as "tracking" are the enum values of mapping.proto in lower case without their prefix.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Dict, List, Optional, Tuple, Union

import numpy as np

import romap.v1.mapping_pb2 as pb

from .camera import Camera
from .geometry import Array, optional_transform, rotation_from_proto, transform_from_proto, vector_from_proto
from .mesh import Mesh, decode_mesh


def word(enum: Any, prefix: str, value: int) -> str:
    """ValueError: a value that this release does not know."""
    name: str = enum.Name(value)
    return name[len(prefix) + 1 :].lower()


@dataclass(frozen=True, eq=False)
class FrameAck:
    """The result of one frame."""

    frame_id: int
    accepted: bool
    error: str  # why it was rejected
    state: str  # of the camera: "initializing", "tracking", "lost" or "relocalized"
    state_reason: str
    pose: Optional[Array]  # camera to world; None: not tracked
    rotation: Optional[Array]  # 3x3, while only the rotation is known
    position_sigma: Optional[float]  # standard deviations of the pose; None: not known
    rotation_sigma_rad: Optional[float]
    is_keyframe: bool
    latency_s: float
    map_id: int
    duplicate: bool  # the session had accepted it before


@dataclass(frozen=True)
class MasksAck:
    """The result of masks that were sent after their frame."""

    frame_id: int
    accepted: bool
    error: str
    duplicate: bool


@dataclass(frozen=True, eq=False)
class Cuboid:
    pose: Array  # object to world; the z axis of the object is up
    half_extents: Array  # along the axes of the object
    confidence: float  # 0..1

    def corners(self) -> Array:
        """8 x 3, in the world; bits 0, 1 and 2 of the index say on which side of x, y and z a corner is."""
        sides = np.array([[1 if index >> axis & 1 else -1 for axis in range(3)] for index in range(8)])
        return np.asarray(sides * self.half_extents @ self.pose[:3, :3].T + self.pose[:3, 3])


@dataclass(frozen=True, eq=False)
class ObjectUpdate:
    id: int
    revision: int
    state: str  # "provisional", "confirmed" or "lost"
    class_name: str
    class_score: float
    cuboid: Cuboid
    observations: int
    mesh_pose: Optional[Array]  # of the newest mesh in the world
    mesh_scale: float  # p_world = mesh_pose * (mesh_scale * vertex)
    map_id: int


@dataclass(frozen=True, eq=False)
class NextView:
    direction: Array  # from the object to the camera, in the frame of the mesh
    gain: float


@dataclass(frozen=True)
class MeshLevel:
    """A simpler version of a final mesh."""

    draco: bytes = field(repr=False)
    triangle_count: int
    error: float  # about the largest distance from the mesh

    @cached_property
    def mesh(self) -> Mesh:
        return decode_mesh(self.draco)


@dataclass(frozen=True, eq=False)
class MeshUpdate:
    id: int  # of the object
    revision: int
    steps: int
    train_seconds: float
    is_final: bool
    vertex_count: int
    triangle_count: int
    draco: bytes = field(repr=False)
    texture: bytes = field(repr=False)  # a PNG or JPEG file; empty: colors only
    texture_media_type: str
    levels: Tuple[MeshLevel, ...]
    next_view: Optional[NextView]

    @cached_property
    def mesh(self) -> Mesh:
        """Decoded on first use. Its frame is that of ObjectUpdate.mesh_pose."""
        return decode_mesh(self.draco)


@dataclass(frozen=True)
class ObjectRemoved:
    id: int
    revision: int
    reason: str


@dataclass(frozen=True)
class ObjectMerged:
    """Object `source` was merged into `into`."""

    source: int
    into: int
    revision: int  # of `into`


@dataclass(frozen=True)
class Diagnostic:
    code: str
    text: str
    severity: str  # "info", "warning" or "error"
    first_frame_id: int
    count: int
    advice: str


@dataclass(frozen=True)
class Statistics:
    frames_received: int
    frames_processed: int
    frames_dropped: int
    frames_rejected: int
    keyframes: int
    map_points: int
    objects: int
    objects_training: int
    training_steps: int
    training_progress: float
    resident_bytes: int
    diagnostics: Tuple[Diagnostic, ...]


@dataclass(frozen=True)
class Durable:
    """What survives a crash of the server: inputs up to these frames."""

    frame_id: int
    masks_frame_id: int


Event = Union[
    FrameAck, MasksAck, ObjectUpdate, MeshUpdate, ObjectRemoved, ObjectMerged, Statistics, Diagnostic, Durable
]


@dataclass(frozen=True)
class SessionInfo:
    id: str
    name: str
    camera: Camera
    mode: str  # "replay" or "live"
    state: str  # "open", "finishing", "finished", "failed" or "restoring"
    created_unix_ns: int
    stream_open: bool
    statistics: Statistics
    durable: bool
    pinned: bool
    stored_bytes: int
    tenant: str


@dataclass(frozen=True, eq=False)
class MapObject:
    object: ObjectUpdate
    mesh: Optional[MeshUpdate] = None

    def world_mesh(self) -> Optional[Mesh]:
        """The mesh in the world; None: there is none yet."""
        if self.mesh is None or self.object.mesh_pose is None:
            return None
        return self.mesh.mesh.transformed(self.object.mesh_pose, self.object.mesh_scale)


@dataclass(frozen=True, eq=False)
class TrajectoryPoint:
    timestamp_ns: int
    frame: FrameAck


@dataclass(frozen=True, eq=False)
class Map:
    """An exported map."""

    session_id: str
    state: str
    statistics: Statistics
    objects: List[MapObject]  # confirmed and lost ones, by id
    trajectory: List[TrajectoryPoint]  # by frame id


def frame_ack(proto: Any) -> FrameAck:
    sigma = proto.uncertainty if proto.HasField("uncertainty") else None
    rotation = proto.rotation_world_camera if proto.HasField("rotation_world_camera") else None
    return FrameAck(
        proto.frame_id,
        proto.accepted,
        proto.error,
        word(pb.TrackingState, "TRACKING_STATE", proto.state),
        proto.state_reason,
        optional_transform(proto, "t_world_camera"),
        None if rotation is None else rotation_from_proto(rotation),
        None if sigma is None else sigma.position_sigma,
        None if sigma is None else sigma.rotation_sigma_rad,
        proto.is_keyframe,
        proto.latency_s,
        proto.map_id,
        proto.duplicate,
    )


def masks_ack(proto: Any) -> MasksAck:
    return MasksAck(proto.frame_id, proto.accepted, proto.error, proto.duplicate)


def object_update(proto: Any) -> ObjectUpdate:
    cuboid = proto.cuboid
    return ObjectUpdate(
        proto.id,
        proto.revision,
        word(pb.ObjectState, "OBJECT_STATE", proto.state),
        proto.class_name,
        proto.class_score,
        Cuboid(
            transform_from_proto(cuboid.t_world_object), vector_from_proto(cuboid.half_extents), cuboid.confidence
        ),
        proto.observations,
        optional_transform(proto, "t_world_mesh"),
        proto.mesh_scale or 1.0,
        proto.map_id,
    )


def mesh_update(proto: Any) -> MeshUpdate:
    view = proto.next_view if proto.HasField("next_view") else None
    return MeshUpdate(
        proto.id,
        proto.revision,
        proto.steps,
        proto.train_seconds,
        proto.is_final,
        proto.vertex_count,
        proto.triangle_count,
        proto.draco,
        proto.texture,
        proto.texture_media_type,
        tuple(MeshLevel(level.draco, level.triangle_count, level.error_mu) for level in proto.levels),
        None if view is None else NextView(vector_from_proto(view.direction), view.gain),
    )


def diagnostic(proto: Any) -> Diagnostic:
    severity = proto.severity or pb.SEVERITY_WARNING
    return Diagnostic(
        proto.code, proto.text, word(pb.Severity, "SEVERITY", severity), proto.first_frame_id, proto.count, proto.advice
    )


def statistics(proto: Any) -> Statistics:
    return Statistics(
        proto.frames_received,
        proto.frames_processed,
        proto.frames_dropped,
        proto.frames_rejected,
        proto.keyframes,
        proto.map_points,
        proto.objects,
        proto.objects_training,
        proto.training_steps,
        proto.training_progress,
        proto.resident_bytes,
        tuple(diagnostic(entry) for entry in proto.diagnostics),
    )


_READERS: Dict[str, Any] = {
    "frame_ack": frame_ack,
    "masks_ack": masks_ack,
    "object": object_update,
    "mesh": mesh_update,
    "removed": lambda proto: ObjectRemoved(proto.id, proto.revision, proto.reason),
    "merged": lambda proto: ObjectMerged(getattr(proto, "from"), proto.into, proto.revision),
    "statistics": statistics,
    "diagnostic": diagnostic,
    "durable": lambda proto: Durable(proto.frame_id, proto.masks_frame_id),
}


def event_from_proto(proto: Any) -> Optional[Event]:
    """None: of a kind, or with an enum value, that this release does not know; such events are ignored."""
    kind = proto.WhichOneof("event")
    if kind is None:
        return None
    try:
        event: Event = _READERS[kind](getattr(proto, kind))
    except ValueError:
        return None
    return event


def session_info(proto: Any) -> SessionInfo:
    return SessionInfo(
        proto.id,
        proto.name,
        Camera.from_proto(proto.camera),
        word(pb.FrameMode, "FRAME_MODE", proto.mode or pb.FRAME_MODE_REPLAY),
        word(pb.SessionState, "SESSION_STATE", proto.state),
        proto.created_unix_ns,
        proto.stream_open,
        statistics(proto.statistics),
        proto.durable,
        proto.pinned,
        proto.stored_bytes,
        proto.tenant,
    )
