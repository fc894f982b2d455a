"""A session that this program feeds."""

from __future__ import annotations

import time
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Any, Iterable, List, Optional, Type, Union

import romap.v1.mapping_pb2 as pb

from ._link import MapOpener
from ._retry import Retry, retry_while_unavailable
from ._rpc import MAX_MESSAGE_BYTES
from ._stream import EventStream, OnEvent, OnLink
from ._unsettled import rejection
from .camera import Camera
from .errors import Error, invalid
from .events import Map, SessionInfo
from .frame import Instance, frame_to_proto, masks_to_proto
from .geometry import Array, Vector

if TYPE_CHECKING:
    from .server import Server


@dataclass(frozen=True)
class Limits:
    """Of the memory for inputs that are kept, because they are not known to be safe on the server."""

    max_bytes: int = 256 << 20
    max_waiting: int = 16  # inputs that wait to be sent


class Session(EventStream):
    """Keeps a copy of every input until the server acknowledged it and, if it has a store, has stored it. When the
    connection breaks or the server restarts, it opens another stream and sends these again. Every input is
    acknowledged once; objects that are gone after an interruption are reported as removed.

    As a context manager, it waits at its end until all inputs are safe, unless an exception leaves it. The session stays
    on the server; finish() ends its input. Thread-safe."""

    def __init__(
        self,
        server: Server,
        info: SessionInfo,
        *,
        retry: Retry = Retry(),
        limits: Limits = Limits(),
        on_event: Optional[OnEvent] = None,
        on_link: Optional[OnLink] = None,
    ) -> None:
        self._server, self._limits, self._is_live = server, limits, info.mode == "live"
        self.id = info.id
        self.camera = info.camera
        self.dropped = 0  # frames of a live session that were not sent, see send()
        super().__init__(MapOpener(server._rpc, info.id), retry, on_event, on_link)
        self._newest_frame_id: int = self.opened.newest_frame_id
        self._newest_time_ns: Optional[int] = None

    # --------------------------------------------------------------------------------------------------------- inputs

    def send(
        self,
        image: Union[bytes, Array],
        timestamp_ns: int,
        *,
        masks: Union[bytes, Array, None] = None,
        instances: Iterable[Instance] = (),
        pose: Optional[Array] = None,
        depth: Union[bytes, Array, None] = None,
        depth_scale: float = 0.001,
        gravity: Optional[Vector] = None,
        frame_id: Optional[int] = None,
    ) -> int:
        """Sends a frame and returns its id. Waits while the server or the connection is busy; in a live session, the
        oldest frame that was not sent yet is dropped instead, and reported as rejected.

        image         the bytes of a JPEG or PNG file, or H x W x 3 (RGB) or H x W (gray) of uint8
        timestamp_ns  capture time, any epoch, strictly increasing
        masks         H x W integer labels, 0 = no instance, 65535 = unknown; or the bytes of a PNG file with one channel.
                      None: no detector ran on this frame, or its masks follow with send_masks()
        instances     what the labels mean; labels without one get the class "object"
        pose          camera to world, 4 x 4; camera x right, y down, z forward (see romap.conventions)
        depth         z depth, H x W: integers in units of depth_scale, or floating-point numbers in the unit of the
                      poses, 0 or NaN = unknown; or the bytes of a PNG file with 16 bits
        depth_scale   units of the poses per unit of depth; 0.001 for millimeters and poses in meters
        gravity       direction of gravity (down) in the camera frame

        The server checks the content. It reports an invalid frame as FrameAck(accepted=False), and the session goes on.
        Raises Error at once for wrong shapes and sizes, and if the session has ended."""
        frame = frame_to_proto(
            self.camera,
            image,
            timestamp_ns,
            masks=masks,
            instances=instances,
            pose=pose,
            depth=depth,
            depth_scale=depth_scale,
            gravity=gravity,
        )
        with self._changed:
            if self._newest_time_ns is not None and timestamp_ns <= self._newest_time_ns:
                raise invalid(f"timestamp_ns: must increase; is {timestamp_ns} after {self._newest_time_ns}")
            frame.frame_id = self._newest_frame_id + 1 if frame_id is None else frame_id
            if frame.frame_id <= self._newest_frame_id:
                raise invalid(f"frame_id: must increase; is {frame_id} after {self._newest_frame_id}")
            dropped = self._add(pb.MapRequest(frame=frame))
            self._newest_frame_id, self._newest_time_ns = frame.frame_id, timestamp_ns
        self._report(dropped)
        new_id: int = frame.frame_id
        return new_id

    def send_masks(self, frame_id: int, masks: Union[bytes, Array], instances: Iterable[Instance] = ()) -> None:
        """Sends the masks of a frame that was sent without them. They are acknowledged with MasksAck."""
        late = pb.LateMasks(frame_id=frame_id, masks=masks_to_proto(masks, instances, self.camera))
        with self._changed:
            dropped = self._add(pb.MapRequest(late_masks=late))
        self._report(dropped)

    def _add(self, request: Any) -> List[int]:
        """Returns the frames that were dropped for it."""
        size = request.ByteSize()
        if size > MAX_MESSAGE_BYTES:
            raise Error("RESOURCE_EXHAUSTED", f"the message has {size} bytes; the limit is {MAX_MESSAGE_BYTES}")
        if not self._is_live:
            self._changed.wait_for(lambda: self._ended or self._send_error is not None or not self._is_full(size))
        if self._ended:
            ended = Error("FAILED_PRECONDITION", "the session is finished and accepts no more inputs")
            raise self._end_error or ended
        if self._send_error is not None:
            raise self._send_error
        self._inputs.add(request)
        dropped = self._drop_to_fit() if self._is_live else []
        self._changed.notify_all()
        return dropped

    def _is_full(self, size: int) -> bool:
        """An input that alone exceeds the limit is sent when no other is kept."""
        if len(self._inputs) == 0:
            return False
        return self._inputs.bytes + size > self._limits.max_bytes or self._inputs.waiting() >= self._limits.max_waiting

    def _drop_to_fit(self) -> List[int]:
        dropped: List[int] = []
        while self._inputs.bytes > self._limits.max_bytes or self._inputs.waiting() > self._limits.max_waiting:
            frame_id = self._inputs.drop_oldest_unsent_frame()
            if frame_id is None:
                break
            self.dropped += 1
            dropped.append(frame_id)
        return dropped

    def _report(self, dropped: List[int]) -> None:
        """Without the lock, because a callback may wait."""
        for frame_id in dropped:
            reason = "dropped: the connection is broken or too slow, and the client's memory for frames is full"
            self._deliver(rejection(frame_id, reason))

    # ---------------------------------------------------------------------------------------------------------- its end

    @property
    def unsettled(self) -> int:
        """Inputs that are kept, because they are not known to be safe on the server."""
        with self._changed:
            return len(self._inputs)

    def flush(self, timeout: Optional[float] = None) -> None:
        """Waits until the server has processed all inputs and, if it has a store, has stored them. Raises Error
        DEADLINE_EXCEEDED after `timeout` seconds, or why the stream ended."""
        with self._changed:
            if not self._changed.wait_for(lambda: self._ended or len(self._inputs) == 0, timeout):
                raise Error("DEADLINE_EXCEEDED", f"{len(self._inputs)} inputs are not safe on the server yet")
            if self._ended and self._end_error is not None:
                raise self._end_error

    def finish(self, timeout: Optional[float] = None) -> SessionInfo:
        """Waits as flush() and ends the input of the session. Its objects are trained to completion after that; wait()
        and events() end when this is done."""
        # A restarted server could not get inputs again that it lost if the session were finished before.
        self.flush(timeout)
        return retry_while_unavailable(lambda: self._server.finish(self.id), self._retry)

    def result(self, timeout: Optional[float] = None) -> Map:
        """Finishes the session, waits until its objects are trained, and returns its map. Events that nobody reads
        meanwhile do not matter."""
        end = None if timeout is None else time.monotonic() + timeout
        self.finish(timeout)
        if not self.wait(None if end is None else max(0.0, end - time.monotonic())):
            raise Error("DEADLINE_EXCEEDED", f"the session was not finished within {timeout:.0f} s")
        return retry_while_unavailable(lambda: self._server.export(self.id), self._retry)

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: Optional[Type[BaseException]], error: Optional[BaseException], trace: Optional[TracebackType]
    ) -> None:
        try:
            if kind is None:
                self.flush()
        finally:
            self.close()
