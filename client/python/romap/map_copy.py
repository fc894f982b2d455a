"""A copy of the server's map that follows the events of a session."""

from __future__ import annotations

from typing import Dict

from dataclasses import replace

from .events import Event, MapObject, MeshUpdate, ObjectMerged, ObjectRemoved, ObjectUpdate


class MapCopy:
    """Apply all events of a stream in order; then `objects` equals the server's map, including provisional objects."""

    def __init__(self) -> None:
        self.objects: Dict[int, MapObject] = {}

    def apply(self, event: Event) -> None:
        """Ignores events that do not concern objects, and cuboids and meshes that are older than the ones it has."""
        if isinstance(event, ObjectUpdate):
            known = self.objects.get(event.id)
            if known is None:
                self.objects[event.id] = MapObject(event)
            elif event.revision >= known.object.revision:
                self.objects[event.id] = MapObject(event, known.mesh)
        elif isinstance(event, MeshUpdate):
            known = self.objects.get(event.id)
            if known is not None and (known.mesh is None or event.revision >= known.mesh.revision):
                self.objects[event.id] = MapObject(known.object, event)
        elif isinstance(event, ObjectRemoved):
            self.objects.pop(event.id, None)
        elif isinstance(event, ObjectMerged):
            self.objects.pop(event.source, None)
            into = self.objects.get(event.into)
            if into is not None and event.revision > into.object.revision:
                self.objects[event.into] = MapObject(replace(into.object, revision=event.revision), into.mesh)
