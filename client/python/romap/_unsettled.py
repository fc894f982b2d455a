"""The inputs of a session that may have to be sent again."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Dict, List, Optional, Union

from .events import FrameAck, MasksAck

Ack = Union[FrameAck, MasksAck]


@dataclass
class _Item:
    request: Any  # MapRequest
    is_masks: bool
    frame_id: int
    bytes: int
    sent: bool = False  # on any stream
    waited: bool = False  # while there was no stream
    sent_on_stream: bool = False  # on the current one
    acked: bool = False  # the caller has had its acknowledgement
    covered: bool = False  # by a Durable event


class UnsettledInputs:
    """An input is settled, and forgotten, once it was acknowledged and the server keeps it: from a server with a store,
    once a Durable event covers it; else at once. A rejected input is settled, too. Not thread-safe."""

    def __init__(self) -> None:
        self._items: Dict[int, _Item] = {}  # by sequence number, in ascending order
        self._added = 0
        self._next = 0  # sequence number from which on the inputs were not taken for the current stream
        self._is_first = True
        self._durable = False
        self.bytes = 0

    def __len__(self) -> int:
        return len(self._items)

    def add(self, request: Any) -> None:
        is_masks = request.HasField("late_masks")
        part = request.late_masks if is_masks else request.frame
        item = _Item(request, is_masks, part.frame_id, request.ByteSize())
        self._items[self._added] = item
        self._added += 1
        self.bytes += item.bytes

    def waiting(self) -> int:
        """Not yet taken for the current stream. Those are the newest ones, without gaps but for dropped frames."""
        count = 0
        for sequence in reversed(self._items):
            if sequence < self._next:
                break
            count += 1
        return count

    def take_next(self) -> Optional[Any]:
        """The next request for the current stream, marked as sent again if that is so; None if all were taken."""
        first = next(iter(self._items), self._added)
        for sequence in range(max(self._next, first), self._added):
            item = self._items.get(sequence)
            if item is None:
                continue
            self._next = sequence + 1
            part = item.request.late_masks if item.is_masks else item.request.frame
            part.resent = item.sent or item.waited
            item.sent = item.sent_on_stream = True
            return item.request
        self._next = self._added
        return None

    def begin_stream(self, durable: bool) -> None:
        """All inputs are sent again on a new stream. `durable`: the server has a store."""
        self._durable = durable
        self._next = 0
        for sequence, item in list(self._items.items()):
            item.sent_on_stream = False
            item.waited = not self._is_first
            self._forget_settled(sequence, item)
        self._is_first = False

    def acknowledge(self, ack: Ack) -> List[Ack]:
        """The acknowledgements that the caller has not had yet.

        An accepted input proves that all inputs of its kind before it on the same stream arrived, because the server
        acknowledges in order. Those whose acknowledgements were lost are delivered as duplicates, without a pose."""
        is_masks = isinstance(ack, MasksAck)
        found = self._find(is_masks, ack.frame_id)
        if found is None:
            return []  # settled: the caller has had the acknowledgement
        item = self._items[found]
        new = self._acknowledge_before(found, is_masks, ack) if ack.accepted and item.sent_on_stream else []
        if not item.acked:
            new.append(ack)
        item.acked = True
        if ack.accepted:
            self._forget_settled(found, item)
        else:
            self._remove(found)
        return new

    def cover(self, frame_id: int, masks_frame_id: int) -> None:
        """Of a Durable event. What was never sent cannot be stored, whatever its id."""
        for sequence, item in list(self._items.items()):
            newest = masks_frame_id if item.is_masks else frame_id
            item.covered = item.covered or (item.sent and item.frame_id <= newest)
            self._forget_settled(sequence, item)

    def drop_oldest_unsent_frame(self) -> Optional[int]:
        """Its id; None: there is none."""
        for sequence, item in self._items.items():
            if sequence >= self._next and not item.sent and not item.is_masks:
                self._remove(sequence)
                return item.frame_id
        return None

    def clear(self) -> None:
        self._items.clear()
        self.bytes = 0

    def unacknowledged(self) -> int:
        return sum(not item.acked for item in self._items.values())

    def newest_frame_id(self) -> Optional[int]:
        return max((item.frame_id for item in self._items.values() if not item.is_masks), default=None)

    def _find(self, is_masks: bool, frame_id: int) -> Optional[int]:
        found = None
        for sequence, item in self._items.items():
            if item.is_masks != is_masks or item.frame_id != frame_id or not item.sent:
                continue
            if not item.acked:
                return sequence
            found = sequence if found is None else found
        return found

    def _acknowledge_before(self, end: int, is_masks: bool, ack: Ack) -> List[Ack]:
        new: List[Ack] = []
        for sequence, item in list(self._items.items()):
            if sequence >= end:
                break
            if item.is_masks != is_masks or not item.sent_on_stream:
                continue
            if not item.acked:
                new.append(_duplicate(ack, item.frame_id))
            item.acked = True
            self._forget_settled(sequence, item)
        return new

    def _forget_settled(self, sequence: int, item: _Item) -> None:
        if item.acked and (item.covered or not self._durable):
            self._remove(sequence)

    def _remove(self, sequence: int) -> None:
        self.bytes -= self._items.pop(sequence).bytes


def _duplicate(ack: Ack, frame_id: int) -> Ack:
    if isinstance(ack, MasksAck):
        return replace(ack, frame_id=frame_id, duplicate=True)
    return FrameAck(frame_id, True, "", "unspecified", "", None, None, None, None, False, 0.0, 0, True)


def rejection(frame_id: int, reason: str) -> FrameAck:
    return FrameAck(frame_id, False, reason, "unspecified", "", None, None, None, None, False, 0.0, 0, False)
