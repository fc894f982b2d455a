"""A connection to a romap-server."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Any, Iterator, List, Optional, Type, Union

import romap.v1.mapping_pb2 as pb

from . import events
from ._link import WatchOpener
from ._retry import Retry, retry_while_unavailable
from ._rpc import EXPORT_TIMEOUT_S, Rpc, Tls, read_token
from ._stream import EventStream, OnEvent, OnLink
from .camera import Camera
from .errors import Error, invalid
from .events import Map, MapObject, SessionInfo, TrajectoryPoint, session_info
from .geometry import Vector, vector_to_proto
from .session import Limits, Session

_MODES = {"replay": pb.FRAME_MODE_REPLAY, "live": pb.FRAME_MODE_LIVE}
_POSE_USES = {"given": pb.POSE_USE_GIVEN, "prior": pb.POSE_USE_PRIOR, "ignore": pb.POSE_USE_IGNORE}
_PIECE_BYTES = 1 << 20


def connect(
    address: str,
    *,
    token: Optional[str] = None,
    token_file: Optional[str] = None,
    tls: Optional[Tls] = None,
    wait: float = 0.0,
) -> Server:
    """Connects to a server and verifies that it is a romap-server.

    address     "HOST:PORT"
    token       for a server that wants one; or the file with it, by default the one that ROMAP_TOKEN_FILE names. It is
                sent only with TLS, or to this machine
    tls         connect with TLS
    wait        seconds to wait for a server that is not there yet
    """
    secret = read_token(token, token_file)

    def attempt() -> Server:
        rpc = Rpc(address, secret, tls)
        try:
            rpc.wait_until_ready()
            return _checked(rpc)
        except BaseException:
            rpc.close()
            raise

    return retry_while_unavailable(attempt, Retry(max_down_s=wait))


def _checked(rpc: Rpc) -> Server:
    server = Server(rpc)
    try:
        server.sessions()
    except Error as error:
        if error.code in ("UNAUTHENTICATED", "PERMISSION_DENIED"):
            raise
        message = f"{rpc.address} accepts connections but is not a working romap-server: {error.message}"
        raise Error("UNAVAILABLE", message) from None
    return server


class Server:
    """Made by connect(). Thread-safe. Every call raises Error: UNAVAILABLE without a connection, DEADLINE_EXCEEDED,
    UNAUTHENTICATED without a valid token, PERMISSION_DENIED if its role does not allow the call, and NOT_FOUND for a
    session that does not exist."""

    def __init__(self, rpc: Rpc) -> None:
        self._rpc = rpc

    def session(
        self,
        camera: Camera,
        *,
        name: str = "",
        mode: str = "replay",
        pose_use: str = "given",
        up_world: Optional[Vector] = None,
        estimate_up: bool = False,
        retry: Retry = Retry(),
        limits: Limits = Limits(),
        on_event: Optional[OnEvent] = None,
        on_link: Optional[OnLink] = None,
    ) -> Session:
        """Creates a session and opens it.

        mode         "replay": a busy server slows the program down; "live": it drops the oldest frame
        pose_use     poses of the frames: "given" (exact), "prior" (corrected by the images), "ignore"
        up_world     up in the world of the poses, if it is not z
        estimate_up  estimate it from the images
        on_event     is called with every event on another thread, instead of events(); for frames of a live session that
                     are dropped, on the thread of send()
        on_link      is called with (is_up, reason, attempt) when the connection breaks and when it is back
        """
        if mode not in _MODES:
            raise invalid(f"mode: must be one of {', '.join(_MODES)}; is {mode}")
        if pose_use not in _POSE_USES:
            raise invalid(f"pose_use: must be one of {', '.join(_POSE_USES)}; is {pose_use}")
        request = pb.CreateSessionRequest(
            name=name,
            camera=camera.to_proto(),
            mode=_MODES[mode],
            pose_use=_POSE_USES[pose_use],
            estimate_up=estimate_up,
        )
        if up_world is not None:
            request.up_world.CopyFrom(vector_to_proto(up_world, "up_world"))
        info = session_info(self._rpc.call("CreateSession", request).session)
        return Session(self, info, retry=retry, limits=limits, on_event=on_event, on_link=on_link)

    def open(
        self,
        session_id: str,
        *,
        retry: Retry = Retry(),
        limits: Limits = Limits(),
        on_event: Optional[OnEvent] = None,
        on_link: Optional[OnLink] = None,
    ) -> Session:
        """Continues an open session. Session.opened.newest_frame_id tells what it has."""
        info = self.info(session_id)
        return Session(self, info, retry=retry, limits=limits, on_event=on_event, on_link=on_link)

    def watch(
        self,
        session_id: str,
        *,
        retry: Retry = Retry(),
        on_event: Optional[OnEvent] = None,
        on_link: Optional[OnLink] = None,
    ) -> Watch:
        """The events of a session that another program feeds, beginning with its current objects."""
        return Watch(WatchOpener(self._rpc, session_id), retry, on_event, on_link)

    def sessions(self) -> List[SessionInfo]:
        return [session_info(each) for each in self._rpc.call("ListSessions", pb.ListSessionsRequest()).sessions]

    def info(self, session_id: str) -> SessionInfo:
        return session_info(self._rpc.call("GetSession", pb.GetSessionRequest(session_id=session_id)).session)

    def finish(self, session_id: str) -> SessionInfo:
        """Ends the input of a session. See Session.finish() for one that this program feeds."""
        return session_info(self._rpc.call("FinishSession", pb.FinishSessionRequest(session_id=session_id)).session)

    def delete(self, session_id: str) -> None:
        self._rpc.call("DeleteSession", pb.DeleteSessionRequest(session_id=session_id))

    def pin(self, session_id: str, pinned: bool = True) -> SessionInfo:
        """A pinned session is not deleted by age or size."""
        request = pb.PinSessionRequest(session_id=session_id, pinned=pinned)
        return session_info(self._rpc.call("PinSession", request).session)

    def export(self, session_id: str) -> Map:
        """The current map."""
        header: Any = None
        objects: List[MapObject] = []
        trajectory: List[TrajectoryPoint] = []
        for part in self._rpc.read("ExportMap", pb.ExportMapRequest(session_id=session_id)):
            kind = part.WhichOneof("part")
            if kind == "header":
                header = part.header
            elif kind == "object":
                mesh = events.mesh_update(part.object.mesh) if part.object.HasField("mesh") else None
                objects.append(MapObject(events.object_update(part.object.object), mesh))
            elif kind == "trajectory":
                points = part.trajectory.points
                trajectory.extend(TrajectoryPoint(each.timestamp_ns, events.frame_ack(each.frame)) for each in points)
        if header is None:
            raise Error("DATA_LOSS", "the exported map has no header")
        state = events.word(pb.SessionState, "SESSION_STATE", header.state)
        return Map(header.session_id, state, events.statistics(header.statistics), objects, trajectory)

    def save(self, session_id: str, file: Union[str, Path]) -> None:
        """Saves the whole session as a file (*.romap)."""
        pieces = self._rpc.read("SaveSession", pb.SaveSessionRequest(session_id=session_id))
        partial = Path(f"{file}.part")
        try:
            with open(partial, "wb") as target:
                for each in pieces:
                    target.write(each.piece)
            partial.replace(file)
        finally:
            partial.unlink(missing_ok=True)

    def load(self, file: Union[str, Path]) -> SessionInfo:
        """Adds a saved session; it gets another id."""

        def pieces() -> Iterator[Any]:
            with open(file, "rb") as source:
                while piece := source.read(_PIECE_BYTES):
                    yield pb.LoadSessionRequest(piece=piece)

        return session_info(self._rpc.call("LoadSession", pieces(), EXPORT_TIMEOUT_S).session)

    def close(self) -> None:
        """Closes the connection and its streams. Sessions stay on the server."""
        self._rpc.close()

    def __enter__(self) -> Server:
        return self

    def __exit__(
        self, kind: Optional[Type[BaseException]], error: Optional[BaseException], trace: Optional[TracebackType]
    ) -> None:
        self.close()


class Watch(EventStream):
    """The events of a session. Iterate over it, or use it as a context manager to end it early. After a broken
    connection it starts again; then objects that are gone are reported as removed."""

    def __iter__(self) -> Iterator[events.Event]:
        return self.events()

    def __enter__(self) -> Watch:
        return self

    def __exit__(
        self, kind: Optional[Type[BaseException]], error: Optional[BaseException], trace: Optional[TracebackType]
    ) -> None:
        self.close()
