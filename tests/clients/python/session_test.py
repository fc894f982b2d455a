"""Whole sessions of the Python client with romap-server, also one that is killed."""

from __future__ import annotations

import sys
import threading
import unittest
from pathlib import Path
from typing import Any, List

import numpy as np
import romap
from servers import LIMIT_S, SEQUENCE, SOURCE_DIR, FolderTest, eventually, small_image

sys.path.insert(0, str(SOURCE_DIR / "client/python/examples"))
import stream_folder  # noqa: E402

CAMERA = romap.Camera(64, 48, 60, 60, 31.5, 23.5)


class Sequence:
    """A folder of `romap synth`."""

    def __init__(self, folder: Path = SEQUENCE) -> None:
        self.folder = folder
        self.camera = stream_folder.read_camera(folder / "camera.yaml")
        self.images = stream_folder.read_list(folder / "rgb.txt")
        self.masks = stream_folder.read_list(folder / "mask.txt")
        self.poses = stream_folder.read_list(folder / "groundtruth.txt")
        self.instances = stream_folder.read_instances(folder / "detections.csv")

    def __len__(self) -> int:
        return len(self.images)

    def send(self, session: romap.Session, index: int) -> int:
        time_ns, (image, *_) = self.images[index]
        mask = stream_folder.nearest(self.masks, time_ns)
        row = stream_folder.nearest(self.poses, time_ns)
        assert mask is not None and row is not None
        numbers = [float(value) for value in row]
        return session.send(
            (self.folder / image).read_bytes(),
            time_ns,
            masks=(self.folder / mask[0]).read_bytes(),
            instances=self.instances.get(time_ns, ()),
            pose=romap.pose(numbers[3:7], numbers[:3]),
        )


class WholeSessionTest(FolderTest):
    def check_map(self, map: romap.Map, frames: int) -> None:
        self.assertEqual(map.state, "finished")
        self.assertEqual([each.frame.frame_id for each in map.trajectory], list(range(1, frames + 1)))
        self.assertEqual(len(map.objects), 2, map)
        truth = (SEQUENCE / "objects.yaml").read_text()
        for each in map.objects:
            self.assertEqual(each.object.state, "confirmed")
            self.assertIn(each.object.class_name, truth)
            self.assertTrue(np.all((each.object.cuboid.half_extents > 0.01) & (each.object.cuboid.half_extents < 0.5)))
            mesh = each.world_mesh()
            assert mesh is not None and each.mesh is not None and mesh.colors is not None and mesh.normals is not None
            self.assertTrue(each.mesh.is_final)
            self.assertEqual(len(mesh.triangles), each.mesh.triangle_count)
            self.assertGreater(len(mesh.triangles), 50)
            self.assertLess(mesh.triangles.max(), len(mesh.vertices))
            self.assertEqual((mesh.colors.shape, mesh.colors.dtype), (mesh.vertices.shape, np.uint8))
            self.assertGreater(mesh.colors.std(), 1)
            np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=0.02)
            # In the world, the mesh is about where the cuboid is.
            corners = each.object.cuboid.corners()
            center = (corners.min(axis=0) + corners.max(axis=0)) / 2
            self.assertLess(np.linalg.norm(mesh.vertices.mean(axis=0) - center), np.ptp(corners))

    def test_a_sequence_becomes_a_map(self) -> None:
        server, sequence = self.start("--ephemeral"), Sequence()
        with romap.connect(server.address) as connection:
            with connection.session(sequence.camera, name="desk") as session:
                watched, copy = romap.MapCopy(), romap.MapCopy()
                watch = connection.watch(session.id, on_event=watched.apply)
                acks: List[romap.FrameAck] = []
                reader = threading.Thread(target=lambda: self.read(session, copy, acks))
                reader.start()
                for index in range(len(sequence)):
                    sequence.send(session, index)
                session.finish(LIMIT_S)
                reader.join(LIMIT_S)
                self.assertFalse(reader.is_alive())
                self.assertTrue(watch.wait(LIMIT_S))
            info = connection.info(session.id)
            self.assertEqual((info.name, info.camera.fx, info.state), ("desk", sequence.camera.fx, "finished"))
            self.assertEqual([each.id for each in connection.sessions()], [session.id])
            map = connection.export(session.id)
            self.check_map(map, len(sequence))
            self.assertEqual([each.frame_id for each in acks], list(range(1, len(sequence) + 1)))
            for followed in (copy, watched):
                self.assertEqual(self.revisions(list(followed.objects.values())), self.revisions(map.objects))
            connection.delete(session.id)
            self.assertEqual(connection.sessions(), [])

    def read(self, session: romap.Session, copy: romap.MapCopy, acks: List[romap.FrameAck]) -> None:
        for event in session.events():
            copy.apply(event)
            if isinstance(event, romap.FrameAck):
                acks.append(event)

    def revisions(self, objects: List[romap.MapObject]) -> Any:
        return sorted(
            (each.object.id, each.object.revision, each.mesh.revision if each.mesh else None)
            for each in objects
            if each.object.state != "provisional"
        )

    def test_a_killed_server_loses_nothing(self) -> None:
        server, sequence = self.start("--data-dir", str(self.folder / "data")), Sequence()
        breaks: List[str] = []

        def on_link(is_up: bool, reason: str, attempt: int) -> None:
            if attempt == 0:
                breaks.append(reason)

        with romap.connect(server.address) as connection:
            with connection.session(sequence.camera, on_link=on_link) as session:
                for index in range(len(sequence)):
                    if index in (len(sequence) // 3, 2 * len(sequence) // 3):
                        server.restart()
                    sequence.send(session, index)
                map = session.result(LIMIT_S)
            self.assertGreaterEqual(len(breaks), 1)
            self.check_map(map, len(sequence))
            # The file holds the whole session, also on another server.
            connection.save(session.id, self.folder / "desk.romap")
            copy = connection.load(self.folder / "desk.romap")
            self.assertNotEqual(copy.id, session.id)
            self.assertEqual(connection.pin(copy.id).pinned, True)
            eventually(lambda: connection.info(copy.id).state == "finished", "the loaded session is finished")
            self.check_map(connection.export(copy.id), len(sequence))

    def test_a_session_is_continued_by_another_program(self) -> None:
        server = self.start("--ephemeral")
        with romap.connect(server.address) as connection:
            with connection.session(CAMERA) as session:
                session.send(small_image(1), 1)
            with connection.open(session.id) as continued:
                self.assertEqual(continued.opened.newest_frame_id, 1)
                self.assertEqual(continued.send(small_image(2), 2), 2)
                frame_id = continued.send(small_image(3), 3)
                continued.send_masks(frame_id, np.zeros((48, 64), np.uint8))
            events = list(continued.events())
            self.assertIn(romap.MasksAck(3, True, "", False), events)
            self.assertEqual(connection.info(session.id).statistics.frames_processed, 3)


if __name__ == "__main__":
    unittest.main()
