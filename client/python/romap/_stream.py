"""A stream of events that survives a broken connection, with the inputs that it sends again."""

from __future__ import annotations

import logging
import threading
import time
from typing import Any, Callable, Iterator, List, Optional, Union

import grpc

from ._event_buffer import EventBuffer, SeenObjects
from ._link import Kept, Link, MapOpener, Refused, WatchOpener
from ._retry import Delays, Retry
from ._unsettled import UnsettledInputs
from .errors import Error, from_rpc
from .events import Durable, Event, FrameAck, MasksAck, event_from_proto

log = logging.getLogger("romap")
OnEvent = Callable[[Event], None]
OnLink = Callable[[bool, str, int], None]  # is up, reason, attempt


class EventStream:
    """A thread of its own opens the streams and reads their events; gRPC's thread takes the inputs."""

    def __init__(
        self,
        opener: Union[MapOpener, WatchOpener],
        retry: Retry,
        on_event: Optional[OnEvent],
        on_link: Optional[OnLink],
    ) -> None:
        self._opener, self._retry, self._on_event, self._on_link = opener, retry, on_event, on_link
        self._delays = Delays(retry)
        self._down_since: Optional[float] = None  # the first break of the link since the last progress
        self._changed = threading.Condition()
        self._link: Optional[Link] = None
        self._inputs = UnsettledInputs()
        self._seen = SeenObjects()
        self._buffer = EventBuffer()
        self._rejected = 0
        self._send_error: Optional[Error] = None  # the session accepts no more inputs, although its stream goes on
        self._ended = False
        self._closed = False  # by this program
        self._end_error: Optional[Error] = None
        # Waits for the first opening, as for later ones.
        first = self._establish(None)
        self.opened = first.opened
        self._begin(first)
        self._receiver = threading.Thread(target=self._run, args=(first,), name="romap", daemon=True)
        self._receiver.start()

    # ----------------------------------------------------------------------------------------------------- the caller

    def events(self) -> Iterator[Event]:
        """The events until the session is finished or close() is called. Raises Error if the stream ends for another
        reason."""
        while True:
            event = self.next_event()
            if event is None:
                return
            yield event

    def next_event(self, timeout: Optional[float] = None) -> Optional[Event]:
        """None: the stream has ended, or no event came within `timeout` seconds."""
        with self._changed:
            self._changed.wait_for(lambda: self._ended or len(self._buffer) > 0, timeout)
            event = self._buffer.pop()
            if event is None:
                self._raise_unless_closed()
            return event

    @property
    def done(self) -> bool:
        """Whether the stream has ended and all events were read."""
        with self._changed:
            return self._ended and len(self._buffer) == 0

    def wait(self, timeout: Optional[float] = None) -> bool:
        """Waits until the session is finished; False: not within `timeout` seconds. Raises Error as events()."""
        with self._changed:
            ended = self._changed.wait_for(lambda: self._ended, timeout)
            self._raise_unless_closed()
            return ended

    def _raise_unless_closed(self) -> None:
        """What reads the events of a stream that this program closed simply ends."""
        if self._ended and self._end_error is not None and not self._closed:
            raise self._end_error

    def close(self) -> None:
        """Ends the stream, not the session. Inputs that are not known to be safe are forgotten."""
        self._closed = True
        self._end(Error("CANCELLED", "the stream was closed"))
        if threading.current_thread() is not self._receiver:
            self._receiver.join()

    # --------------------------------------------------------------------------------------------------- its receiver

    def _run(self, link: Link) -> None:
        try:
            while True:
                broken = self._receive(link)
                if broken is None or self._ended or not self._opener.may_reopen(broken):
                    return self._end(broken)
                link = self._establish(broken)
                self._begin(link)
        except Error as error:
            self._end(error)
        except Exception as error:  # of a callback
            log.exception("the callback of a session failed")
            self._end(Error("INTERNAL", f"the callback of the session failed: {error!r}"))

    def _establish(self, broken: Optional[Error]) -> Link:
        """Opens a stream, with further attempts. `broken`: how the last one ended; None before the first one."""
        failure = broken
        attempt = 0
        while True:
            if failure is not None:
                self._down_since = self._down_since or time.monotonic()
                self._report_link(False, failure.message, attempt)
                delay_s = self._delays.next_s()
                give_up = self._down_since + self._retry.max_down_s
                with self._changed:
                    self._changed.wait_for(lambda: self._ended, min(delay_s, max(0.0, give_up - time.monotonic())))
                    if self._ended:
                        raise failure
                if time.monotonic() >= give_up:
                    down_s = time.monotonic() - self._down_since
                    raise Error(failure.code, f"{failure.message} (gave up after {down_s:.1f} s)")
            with self._changed:
                kept = Kept(self._inputs.unacknowledged(), self._inputs.newest_frame_id())
            try:
                link = self._opener.open(broken, kept, self._requests)
                if failure is not None:
                    self._report_link(True, "", attempt)
                return link
            except Refused as refused:
                if not refused.retry:
                    raise refused.error from None
                failure = refused.error
            attempt += 1

    def _report_link(self, is_up: bool, reason: str, attempt: int) -> None:
        if is_up:
            log.warning("the link is up again")
        elif attempt == 0:
            log.warning("link lost, retrying: %s", reason)
        if self._on_link is not None:
            self._on_link(is_up, reason, attempt)

    def _begin(self, link: Link) -> None:
        with self._changed:
            if self._ended:
                link.call.cancel()
                return
            self._inputs.begin_stream(link.opened.durable)
            if not link.takes_inputs:
                self._inputs.clear()  # everything is on the server; see MapOpener
                self._send_error = Error("FAILED_PRECONDITION", "the session was finished and accepts no more inputs")
            if len(self._inputs) == 0:
                self._down_since = None
            removals = self._seen.keep_only(set(link.opened.object_ids))
            self._link = link
            link.ready = True
            self._changed.notify_all()
        for removal in removals:
            self._deliver(removal)

    def _receive(self, link: Link) -> Optional[Error]:
        """Reads the stream to its end. None: the server ended it, because the session is finished."""
        try:
            for response in link.call:
                event = event_from_proto(response.event) if response.HasField("event") else None
                if event is not None:
                    for each in self._process(event):
                        self._deliver(each)
            return None
        except grpc.RpcError as failure:
            return from_rpc(failure)
        finally:
            with self._changed:
                link.ended = True
                self._link = None
                self._changed.notify_all()
            link.call.cancel()

    def _process(self, event: Event) -> List[Event]:
        with self._changed:
            before = len(self._inputs)
            deliver: List[Event] = []
            if isinstance(event, (FrameAck, MasksAck)):
                deliver.extend(self._inputs.acknowledge(event))
            else:
                if isinstance(event, Durable):
                    self._inputs.cover(event.frame_id, event.masks_frame_id)
                self._seen.note(event)
                deliver.append(event)
                if len(self._inputs) == before:
                    return deliver
            self._changed.notify_all()
            if deliver or len(self._inputs) != before:
                # The server gets on with the inputs, so that a later break is a new one.
                self._down_since = None
                self._delays.reset()
            return deliver

    def _deliver(self, event: Event) -> None:
        if isinstance(event, (FrameAck, MasksAck)) and not event.accepted:
            self._rejected += 1
            if self._rejected & (self._rejected - 1) == 0:  # names few of many
                log.warning("frame %d was rejected (%d so far): %s", event.frame_id, self._rejected, event.error)
        if self._on_event is not None:
            self._on_event(event)
            return
        with self._changed:
            self._buffer.add(event)
            self._changed.notify_all()

    def _end(self, error: Optional[Error]) -> None:
        with self._changed:
            if self._ended:
                return
            missing = self._inputs.unacknowledged()
            if error is None and missing > 0:
                message = f"the session was finished before {missing} inputs were accepted"
                error = Error("FAILED_PRECONDITION", message)
            if error is None:
                self._inputs.clear()
            self._ended, self._end_error = True, error
            link, self._link = self._link, None
            self._changed.notify_all()
        if link is not None:
            link.ended = True
            link.call.cancel()

    # ----------------------------------------------------------------------------------------------------- its inputs

    def _requests(self, link: Link) -> Iterator[Any]:
        """What gRPC sends on a stream; it takes the next one when the one before has left, as flow control allows."""
        while True:
            with self._changed:
                self._changed.wait_for(
                    lambda: link.ended or self._ended or (link.ready and self._inputs.waiting() > 0)
                )
                if link.ended or self._ended:
                    return
                request = self._inputs.take_next()
                self._changed.notify_all()  # send() may wait
            if request is not None:
                yield request
