"""What the tests of the Python client share: romap-server, a server that the test scripts, and sequences."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
import threading
import time
import unittest
from concurrent import futures
from pathlib import Path
from typing import Any, Callable, List, Optional

import grpc
import numpy as np
import romap.v1.mapping_pb2 as pb
from romap.v1 import mapping_pb2_grpc

SOURCE_DIR = Path(os.environ["ROMAP_SOURCE_DIR"])
SERVER = os.environ["ROMAP_SERVER"]
CLIENT = os.environ["ROMAP_CLIENT"]
SEQUENCE = Path(os.environ["ROMAP_SEQUENCE"])  # of `romap synth`, with two objects
LIMIT_S = 200.0
LITTLE_TRAINING = [
    argument
    for setting in (
        "nerf.first_budget_steps=40",
        "nerf.full_budget_steps=40",
        "nerf.refine_steps_per_view=1",
        "mesh.resolution=32",
        "mesh.min_side_nodes=32",
    )
    for argument in ("--set", setting)
]


def eventually(condition: Callable[[], Any], what: str) -> Any:
    end = time.monotonic() + LIMIT_S
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.01)
    raise AssertionError(f"not within {LIMIT_S:.0f} s: {what}")


class RomapServer:
    """A romap-server that trains little. restart() uses the same port and data folder."""

    def __init__(self, *arguments: str) -> None:
        self._arguments = list(arguments)
        self.address = "127.0.0.1:0"
        self._start()

    def _start(self) -> None:
        command = [SERVER, "--listen", self.address, *self._arguments, *LITTLE_TRAINING]
        self._log = tempfile.TemporaryFile("w+")
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=self._log, text=True)
        assert self._process.stdout is not None
        marker = "romap-server listening on "
        for line in self._process.stdout:
            if line.startswith(marker):
                self.address = line[len(marker) :].strip()
                return
        self._log.seek(0)
        raise AssertionError(f"romap-server did not start: {self._log.read()}")

    def kill(self) -> None:
        self._process.send_signal(signal.SIGKILL)
        self._process.communicate(timeout=LIMIT_S)
        self._log.close()

    def restart(self) -> None:
        self.kill()
        self._start()

    def stop(self) -> None:
        if self._process.returncode is None:
            self._process.terminate()
            self._process.communicate(timeout=LIMIT_S)
            self._log.close()


class FolderTest(unittest.TestCase):
    """With a folder that is removed at the end."""

    def setUp(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="romap_python_"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def start(self, *arguments: str) -> RomapServer:
        server = RomapServer(*arguments)
        self.addCleanup(server.stop)
        return server


def run(*command: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(command)} failed with {done.returncode}: {done.stdout}{done.stderr}")
    return done.stdout


def small_image(index: int) -> np.ndarray[Any, Any]:
    """48 x 64 RGB, different for every index."""
    return np.random.default_rng(index).integers(0, 256, (48, 64, 3), np.uint8)


class ScriptedServer(mapping_pb2_grpc.MappingServicer):
    """A server whose Map streams run the functions in `scripts`, one each, with the requests after `start`. It lets
    tests reach what romap-server does only at rare moments."""

    def __init__(self, *scripts: Callable[[Any], Any]) -> None:
        self.scripts = list(scripts)
        self.starts: List[Any] = []
        self.watch: Optional[Callable[[], Any]] = None
        self.state = pb.SESSION_STATE_OPEN
        self._lock = threading.Lock()
        self._server = grpc.server(
            futures.ThreadPoolExecutor(8),
            options=[("grpc.max_send_message_length", 64 << 20), ("grpc.max_receive_message_length", 64 << 20)],
        )
        mapping_pb2_grpc.add_MappingServicer_to_server(self, self._server)
        self.address = f"127.0.0.1:{self._server.add_insecure_port('127.0.0.1:0')}"
        self._server.start()

    def stop(self) -> None:
        self._server.stop(None).wait()

    def info(self) -> Any:
        camera = pb.Camera(width_px=64, height_px=48, fx_px=60, fy_px=60, cx_px=31.5, cy_px=23.5)
        return pb.SessionInfo(id="scripted", camera=camera, mode=pb.FRAME_MODE_REPLAY, state=self.state)

    def ListSessions(self, request: Any, context: Any) -> Any:
        return pb.ListSessionsResponse(sessions=[self.info()])

    def CreateSession(self, request: Any, context: Any) -> Any:
        return pb.CreateSessionResponse(session=self.info())

    def GetSession(self, request: Any, context: Any) -> Any:
        return pb.GetSessionResponse(session=self.info())

    def Map(self, requests: Any, context: Any) -> Any:
        with self._lock:
            self.starts.append(next(requests).start)
            script = self.scripts.pop(0)
        yield from self._run(script(requests), context)

    def Watch(self, request: Any, context: Any) -> Any:
        assert self.watch is not None
        yield from self._run(self.watch(), context)

    def _run(self, answers: Any, context: Any) -> Any:
        try:
            yield from answers
        except ConnectionError:
            context.abort(grpc.StatusCode.UNAVAILABLE, "scripted break")


def opened(**fields: Any) -> Any:
    return pb.MapResponse(opened=pb.StreamOpened(session_id="scripted", resume_token="token", **fields))


def event(**fields: Any) -> Any:
    return pb.MapResponse(event=pb.MapEvent(**fields))


def ack(frame_id: int, **fields: Any) -> Any:
    return event(frame_ack=pb.FrameAck(frame_id=frame_id, accepted=True, **fields))
