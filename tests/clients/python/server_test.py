"""The Python client against romap-server: whole sessions, errors, TLS and tokens, and a server that is killed."""

from __future__ import annotations

import re
import subprocess
import sys
import threading
import unittest
from pathlib import Path
from typing import Any, List

import numpy as np
import romap
from servers import CLIENT, LIMIT_S, SEQUENCE, SERVER, SOURCE_DIR, FolderTest, eventually, run, small_image

CAMERA = romap.Camera(64, 48, 60, 60, 31.5, 23.5)
EXAMPLES = SOURCE_DIR / "client/python/examples"
sys.path.insert(0, str(EXAMPLES))
import stream_folder  # noqa: E402


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


class ErrorTest(FolderTest):
    def assert_error(self, code: str, pattern: str, call: Any) -> None:
        with self.assertRaisesRegex(romap.Error, pattern) as caught:
            call()
        self.assertEqual(caught.exception.code, code, caught.exception)
        self.assertNotIn("\n", str(caught.exception))

    def test_errors_have_a_code_and_one_line(self) -> None:
        server = self.start("--ephemeral")
        with romap.connect(server.address) as connection:
            for call in (connection.info, connection.export, connection.delete, connection.finish, connection.open):
                self.assert_error("NOT_FOUND", "session 'none' does not exist", lambda: call("none"))
            self.assert_error("NOT_FOUND", "session 'none' does not exist", lambda: connection.watch("none"))
            self.assert_error("NOT_FOUND", "'none'", lambda: connection.save("none", self.folder / "file"))
            self.assertEqual(list(self.folder.iterdir()), [], "no partial file is left")
            flat = romap.Camera(64, 48, 0, 60, 31.5, 23.5)
            self.assert_error("INVALID_ARGUMENT", "fx", lambda: connection.session(flat))
            self.assert_error("INVALID_ARGUMENT", "mode", lambda: connection.session(CAMERA, mode="fast"))
            with connection.session(CAMERA) as session:
                self.assert_error("FAILED_PRECONDITION", "stream", lambda: connection.open(session.id))
                small = np.zeros((4, 4), np.uint8)
                self.assert_error("INVALID_ARGUMENT", "4x4", lambda: session.send(small_image(0), 1, masks=small))
                session.send(small_image(1), 1)
                # What only the server can see is reported by the acknowledgement, and the session goes on.
                session.send(small_image(2), 2, masks=b"not a PNG file")
                session.send(b"\xff\xd8\xff damaged", 3)
                session.send(small_image(4), 4)
                with self.assertLogs("romap", "WARNING") as logged:
                    session.flush(LIMIT_S)
                    acks = {
                        each.frame_id: each
                        for each in iter(lambda: session.next_event(0), None)
                        if isinstance(each, romap.FrameAck)
                    }
                    session.send(b"\xff\xd8\xff damaged", 5)
                    session.flush(LIMIT_S)
                self.assertRegex("".join(logged.output), "was rejected")
                self.assertEqual([acks[id].accepted for id in range(1, 5)], [True, False, False, True])
                self.assertRegex(acks[2].error, "mask")
                session.finish(LIMIT_S)
                session.wait(LIMIT_S)
                ended = "is finished and accepts no more inputs"
                self.assert_error("FAILED_PRECONDITION", ended, lambda: session.send(small_image(9), 9))
        # Another server on that port is not a romap-server.
        server.stop()
        self.assert_error("UNAVAILABLE", "cannot connect to romap-server at", lambda: romap.connect(server.address))

    def test_connect_waits_for_a_server(self) -> None:
        server = self.start("--ephemeral")
        server.kill()
        restart = threading.Timer(0.3, server.restart)
        restart.start()
        self.addCleanup(restart.join)
        with romap.connect(server.address, wait=LIMIT_S) as connection:
            self.assertEqual(connection.sessions(), [])


class AccessTest(FolderTest):
    def certificate(self) -> None:
        """An authority, and a certificate of the server for 127.0.0.1 that it signed."""
        openssl = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
        run(*openssl, "-keyout", f"{self.folder}/ca.key", "-out", f"{self.folder}/ca.pem", "-subj", "/CN=test authority")
        run(*openssl, "-keyout", f"{self.folder}/key.pem", "-out", f"{self.folder}/certificate.pem", "-subj",
            "/CN=romap-server", "-CA", f"{self.folder}/ca.pem", "-CAkey", f"{self.folder}/ca.key", "-addext",
            "subjectAltName=IP:127.0.0.1", "-addext", "basicConstraints=critical,CA:FALSE")

    def token(self, role: str) -> str:
        data = str(self.folder / "data")
        return run(SERVER, "token", "create", "--tenant", "lab", "--role", role, "--data-dir", data).strip()

    def test_tls_and_tokens(self) -> None:
        self.certificate()
        owner, viewer = self.token("owner"), self.token("viewer")
        server = self.start("--data-dir", str(self.folder / "data"), "--tls-cert", str(self.folder / "certificate.pem"),
                            "--tls-key", str(self.folder / "key.pem"))
        tls = romap.Tls(ca=str(self.folder / "ca.pem"))
        with romap.connect(server.address, token=owner, tls=tls) as connection:
            with connection.session(CAMERA) as session:
                session.send(small_image(1), 1, pose=np.eye(4))
                self.assertEqual(session.result(LIMIT_S).state, "finished")
        file = self.folder / "viewer.token"
        file.write_text(viewer + "\n")
        with romap.connect(server.address, token_file=str(file), tls=tls) as connection:
            self.assertEqual(len(connection.sessions()), 1)
            self.assertEqual(len(connection.export(session.id).trajectory), 1)
            with self.assertRaisesRegex(romap.Error, "PERMISSION_DENIED: .*the role owner"):
                connection.delete(session.id)
            with self.assertRaisesRegex(romap.Error, "PERMISSION_DENIED: .*the role owner"):
                connection.session(CAMERA)
        for token, pattern in ((None, "this server needs a token"), (owner[:-1] + "?", "the token is not valid")):
            with self.assertRaisesRegex(romap.Error, f"UNAUTHENTICATED: {pattern}"):
                romap.connect(server.address, token=token, tls=tls)
        for wrong in (None, romap.Tls(), romap.Tls(ca=tls.ca, server_name="another.name")):
            with self.assertRaisesRegex(romap.Error, "UNAVAILABLE: cannot connect"):
                romap.connect(server.address, token=owner, tls=wrong)
        file.write_text("two words")
        with self.assertRaisesRegex(romap.Error, "must have one token"):
            romap.connect(server.address, token_file=str(file), tls=tls)


class ProgramsTest(FolderTest):
    def program(self, *arguments: str) -> str:
        done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, timeout=LIMIT_S)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def test_the_program_of_the_readme(self) -> None:
        blocks = re.findall(r"```python\n(.*?)```", (SOURCE_DIR / "client/python/README.md").read_text(), re.DOTALL)
        program = self.folder / "program.py"
        program.write_text(blocks[0])
        self.assertLessEqual(len(blocks[0].splitlines()), 20)
        server, sequence = self.start("--ephemeral"), SEQUENCE
        printed = self.program(str(program), server.address, str(sequence)).splitlines()
        self.assertEqual(len(printed), 2, printed)

    def test_the_examples(self) -> None:
        server, sequence = self.start("--ephemeral"), SEQUENCE
        printed = self.program(str(EXAMPLES / "stream_folder.py"), str(sequence), "--server", server.address)
        self.assertRegex(printed, r"1 \w+: [\d.]+ x [\d.]+ x [\d.]+, mesh with \d+ triangles")
        with romap.connect(server.address) as connection:
            session = connection.sessions()[0].id
        run(CLIENT, "export", session, "--server", server.address, "--out", str(self.folder / "exported"))
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            self.skipTest("show_map.py: python3-matplotlib is not installed")
        picture = self.folder / "map.png"
        self.program(str(EXAMPLES / "show_map.py"), session, str(picture), "--server", server.address)
        self.assertGreater(picture.stat().st_size, 10_000)


if __name__ == "__main__":
    unittest.main()
