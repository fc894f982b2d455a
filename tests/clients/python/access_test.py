"""Errors, tokens and TLS of the Python client with romap-server."""

from __future__ import annotations

import threading
import unittest
from typing import Any

import numpy as np
import romap
from servers import LIMIT_S, SERVER, FolderTest, run, small_image

CAMERA = romap.Camera(64, 48, 60, 60, 31.5, 23.5)


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


if __name__ == "__main__":
    unittest.main()
