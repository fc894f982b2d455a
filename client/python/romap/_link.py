"""Opens the streams of a session and decides which errors are worth another attempt."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Callable, Iterator, Optional

import romap.v1.mapping_pb2 as pb

from ._rpc import Rpc
from .errors import Error

Requests = Callable[["Link"], Iterator[Any]]


class Link:
    """One stream. `takes_inputs`: it is a Map stream."""

    def __init__(self, takes_inputs: bool) -> None:
        self.takes_inputs = takes_inputs
        self.call: Any = None
        self.opened: Any = None
        self.ready = False  # the inputs may be sent on it
        self.ended = False


@dataclass(frozen=True)
class Kept:
    """What must be on the server before it is enough to watch a finished session."""

    unacknowledged: int
    newest_frame_id: Optional[int]


class Refused(Exception):
    def __init__(self, error: Error, retry: bool) -> None:
        super().__init__(str(error))
        self.error, self.retry = error, retry


class WatchOpener:
    def __init__(self, rpc: Rpc, session_id: str) -> None:
        self._rpc, self._id = rpc, session_id

    def open(self, broken: Optional[Error], kept: Kept, requests: Requests) -> Link:
        try:
            return _watch(self._rpc, self._id)
        except Error as error:
            raise Refused(error, retry=error.may_pass) from None

    def may_reopen(self, error: Error) -> bool:
        return error.may_pass


class MapOpener:
    def __init__(self, rpc: Rpc, session_id: str) -> None:
        self._rpc, self._id = rpc, session_id
        self._token = ""
        self._unanswered = 0  # openings without an answer, which may still reach the server

    def open(self, broken: Optional[Error], kept: Kept, requests: Requests) -> Link:
        """`broken`: how the last stream ended; None before the first one. Raises Refused."""
        link = Link(takes_inputs=True)
        start = pb.MapRequest(start=pb.MapStart(session_id=self._id, resume_token=self._token))

        def all_requests() -> Iterator[Any]:
            yield start
            yield from requests(link)

        try:
            link.call, link.opened = self._rpc.open("Map", all_requests())
        except Error as error:
            link.ended = True
            if error.code == "FAILED_PRECONDITION":
                return self._open_finished(error, broken, kept)
            self._unanswered += error.may_pass
            # Too many streams: that of the broken connection may be among them. INTERNAL may come from gRPC.
            retry = error.may_pass or error.code in ("RESOURCE_EXHAUSTED", "INTERNAL")
            raise Refused(error, retry) from None
        self._token = link.opened.resume_token
        return link

    def may_reopen(self, error: Error) -> bool:
        # A stream is replaced if an earlier opening of this client reaches the server late.
        if error.code == "ABORTED" and self._unanswered > 0:
            self._unanswered -= 1
            return True
        if error.code != "INTERNAL":
            return error.may_pass
        # From gRPC's transport, or because the session failed.
        try:
            return bool(self._state() != pb.SESSION_STATE_FAILED)
        except Error:
            return True

    def _state(self) -> int:
        request = pb.GetSessionRequest(session_id=self._id)
        state: int = self._rpc.call("GetSession", request).session.state
        return state

    def _open_finished(self, refusal: Error, broken: Optional[Error], kept: Kept) -> Link:
        """The session exists but accepts no Map stream."""
        try:
            state = self._state()
            if state == pb.SESSION_STATE_RESTORING:
                raise Refused(refusal, retry=True)
            if state == pb.SESSION_STATE_OPEN:
                # An opening of this client whose answer was lost may hold the session, until the server notices.
                is_own = not self._token and (self._unanswered > 0 or broken is not None)
                raise Refused(refusal, retry=is_own)
            if state == pb.SESSION_STATE_FAILED:
                # The stream may have told the cause before.
                raise Refused(broken if broken and broken.code == "INTERNAL" else refusal, retry=False)
            if broken is None or kept.unacknowledged > 0:
                raise Refused(refusal, retry=False)
            link = _watch(self._rpc, self._id)
        except Error as error:
            raise Refused(error, retry=error.may_pass) from None
        # A server that was restarted may have lost what it acknowledged before it was stored.
        if kept.newest_frame_id is not None and link.opened.newest_frame_id < kept.newest_frame_id:
            link.call.cancel()
            raise Refused(refusal, retry=False)
        return link


def _watch(rpc: Rpc, session_id: str) -> Link:
    link = Link(takes_inputs=False)
    link.call, link.opened = rpc.open("Watch", pb.WatchRequest(session_id=session_id))
    return link
