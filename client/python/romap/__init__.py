"""Client of romap-server: streams images with instance masks, receives a live map of objects.

    with romap.connect("127.0.0.1:50051") as server, server.session(camera) as session:
        session.send(image, timestamp_ns, masks=labels, pose=pose)
        map = session.result()
"""

from . import conventions
from ._retry import Retry
from ._rpc import Tls
from .camera import Camera
from .errors import Error
from .events import (
    Cuboid,
    Diagnostic,
    Durable,
    Event,
    FrameAck,
    Map,
    MapObject,
    MasksAck,
    MeshLevel,
    MeshUpdate,
    NextView,
    ObjectMerged,
    ObjectRemoved,
    ObjectUpdate,
    SessionInfo,
    Statistics,
    TrajectoryPoint,
)
from .frame import Instance, label_runs, labels_from_runs
from .geometry import pose, quaternion, rotation_matrix
from .map_copy import MapCopy
from .mesh import Mesh, decode_mesh
from .server import Server, Watch, connect
from .session import Limits, Session

__all__ = [
    "Camera",
    "Cuboid",
    "Diagnostic",
    "Durable",
    "Error",
    "Event",
    "FrameAck",
    "Instance",
    "Limits",
    "Map",
    "MapCopy",
    "MapObject",
    "MasksAck",
    "Mesh",
    "MeshLevel",
    "MeshUpdate",
    "NextView",
    "ObjectMerged",
    "ObjectRemoved",
    "ObjectUpdate",
    "Retry",
    "Server",
    "Session",
    "SessionInfo",
    "Statistics",
    "Tls",
    "TrajectoryPoint",
    "Watch",
    "connect",
    "conventions",
    "decode_mesh",
    "label_runs",
    "labels_from_runs",
    "pose",
    "quaternion",
    "rotation_matrix",
]
