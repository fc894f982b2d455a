"""The events that a program has not read yet."""

from __future__ import annotations

from collections import OrderedDict
from typing import Deque, List, Optional, Tuple
from collections import deque

from .events import (
    Diagnostic,
    Durable,
    Event,
    FrameAck,
    MasksAck,
    MeshUpdate,
    ObjectMerged,
    ObjectRemoved,
    ObjectUpdate,
    Statistics,
)

MAX_ACKS = 4096
_Key = Tuple[object, ...]


class EventBuffer:
    """Bounded, so that a program may send without reading events: of an object only its newest update and mesh wait,
    and of the acknowledgements the newest MAX_ACKS. A MapCopy of the events still equals the server's map."""

    def __init__(self) -> None:
        self._events: "OrderedDict[_Key, Event]" = OrderedDict()
        self._acks: Deque[_Key] = deque()

    def __len__(self) -> int:
        return len(self._events)

    def add(self, event: Event) -> None:
        # A newer update takes the place of an older one, so that the update that announces an object stays before
        # all other events of the object.
        if isinstance(event, ObjectUpdate):
            self._events[("object", event.id)] = event
        elif isinstance(event, MeshUpdate):
            self._events[("mesh", event.id)] = event
        elif isinstance(event, ObjectRemoved):
            self._forget(event.id)
            self._events[("gone", event.id)] = event
        elif isinstance(event, ObjectMerged):
            self._forget(event.source)
            self._events[("gone", event.source)] = event
        elif isinstance(event, (FrameAck, MasksAck)):
            self._add_ack((type(event), event.frame_id, event.accepted), event)
        elif isinstance(event, (Statistics, Durable)):
            self._events[(type(event),)] = event
        elif isinstance(event, Diagnostic):
            self._events[("diagnostic", event.code)] = event

    def pop(self) -> Optional[Event]:
        """The oldest one."""
        if not self._events:
            return None
        key, event = self._events.popitem(last=False)
        if self._acks and self._acks[0] == key:
            self._acks.popleft()
        return event

    def _add_ack(self, key: _Key, event: Event) -> None:
        if key not in self._events:
            self._acks.append(key)
        self._events[key] = event
        if len(self._acks) > MAX_ACKS:
            self._events.pop(self._acks.popleft(), None)

    def _forget(self, object_id: int) -> None:
        for kind in ("object", "mesh"):
            self._events.pop((kind, object_id), None)


class SeenObjects:
    """The objects that the events of a stream announced, with their newest revision."""

    def __init__(self) -> None:
        self._revisions: "dict[int, int]" = {}

    def note(self, event: Event) -> None:
        if isinstance(event, ObjectUpdate):
            self._revisions[event.id] = max(event.revision, self._revisions.get(event.id, 0))
        elif isinstance(event, MeshUpdate) and event.id in self._revisions:
            self._revisions[event.id] = max(event.revision, self._revisions[event.id])
        elif isinstance(event, ObjectRemoved):
            self._revisions.pop(event.id, None)
        elif isinstance(event, ObjectMerged):
            self._revisions.pop(event.source, None)
            if event.into in self._revisions:
                self._revisions[event.into] = max(event.revision, self._revisions[event.into])

    def keep_only(self, existing: "set[int]") -> List[ObjectRemoved]:
        """A new stream begins, whose server has only these objects. Returns the removals of the others."""
        gone = [id for id in self._revisions if id not in existing]
        return [
            ObjectRemoved(id, self._revisions.pop(id) + 1, "removed while the connection was broken") for id in gone
        ]
