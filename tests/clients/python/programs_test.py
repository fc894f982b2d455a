"""The program of client/python/README.md and the examples."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
import unittest

import romap
from servers import CLIENT, LIMIT_S, SEQUENCE, SOURCE_DIR, FolderTest, run

EXAMPLES = SOURCE_DIR / "client/python/examples"


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
        server = self.start("--ephemeral")
        printed = self.program(str(program), server.address, str(SEQUENCE)).splitlines()
        self.assertEqual(len(printed), 2, printed)

    def test_the_example_of_a_camera(self) -> None:
        if importlib.util.find_spec("cv2") is None:
            self.skipTest("camera.py: python3-opencv is not installed")
        server = self.start("--ephemeral")
        video = str(SEQUENCE / "rgb/%06d.png")
        command = [str(EXAMPLES / "camera.py"), "--server", server.address, "--device", video, "--focal", "288"]
        self.program(*command, "--box", "100,80,60,60")
        with romap.connect(server.address) as connection:
            (info,) = connection.sessions()
        self.assertEqual((info.name, info.state), ("camera", "finished"))
        self.assertEqual(info.statistics.frames_processed, len(list((SEQUENCE / "rgb").iterdir())))

    def test_the_examples(self) -> None:
        server = self.start("--ephemeral")
        printed = self.program(str(EXAMPLES / "stream_folder.py"), str(SEQUENCE), "--server", server.address)
        self.assertRegex(printed, r"1 \w+: [\d.]+ x [\d.]+ x [\d.]+, mesh with \d+ triangles")
        with romap.connect(server.address) as connection:
            session = connection.sessions()[0].id
        run(CLIENT, "export", session, "--server", server.address, "--out", str(self.folder / "exported"))
        if importlib.util.find_spec("matplotlib") is None:
            self.skipTest("show_map.py: python3-matplotlib is not installed")
        picture = self.folder / "map.png"
        self.program(str(EXAMPLES / "show_map.py"), session, str(picture), "--server", server.address)
        self.assertGreater(picture.stat().st_size, 10_000)


if __name__ == "__main__":
    unittest.main()
