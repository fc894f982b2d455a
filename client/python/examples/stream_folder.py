#!/usr/bin/env python3
"""Streams a recorded folder in the layout of client/README.md, e.g. one of `romap synth`, and prints the map.

    romap synth --out desk && python3 stream_folder.py desk --server 127.0.0.1:50051
"""

import argparse
import bisect
import csv
import json
import sys
from decimal import Decimal
from pathlib import Path
from typing import Dict, List, Optional, Tuple

import romap

MATCH_NS = 20_000_000


def read_camera(path: Path) -> romap.Camera:
    values = dict(line.split("#")[0].split(":", 1) for line in path.read_text().splitlines() if ":" in line)
    number = {key: json.loads(values[key]) for key in ("width", "height", "fx", "fy", "cx", "cy")}
    lens = values.get("lens", "radial-tangential").strip()
    distortion = tuple(json.loads(values.get("distortion", "[]")))
    return romap.Camera(**number, lens=lens, distortion=distortion, readout_s=json.loads(values.get("readout_s", "0")))


def read_list(path: Path) -> List[Tuple[int, List[str]]]:
    """The lines of a TUM list: time in nanoseconds, and the other columns."""
    if not path.exists():
        return []
    rows = [line.split() for line in path.read_text().splitlines() if line.strip() and not line.startswith("#")]
    return sorted((int(Decimal(time) * 10**9), rest) for time, *rest in rows)


def nearest(rows: List[Tuple[int, List[str]]], time_ns: int) -> Optional[List[str]]:
    at = bisect.bisect(rows, (time_ns,))
    close = [row for row in rows[max(0, at - 1) : at + 1] if abs(row[0] - time_ns) <= MATCH_NS]
    return min(close, key=lambda row: abs(row[0] - time_ns))[1] if close else None


def read_instances(path: Path) -> Dict[int, List[romap.Instance]]:
    """The rows of detections.csv by time in nanoseconds."""
    instances: Dict[int, List[romap.Instance]] = {}
    if path.exists():
        with open(path, newline="") as file:
            for row in csv.DictReader(file):
                time_ns = int(Decimal(row["timestamp"]) * 10**9)
                instance = romap.Instance(int(row["label"]), row["class"], float(row["score"]))
                instances.setdefault(time_ns, []).append(instance)
    return instances


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--server", default="127.0.0.1:50051")
    arguments.add_argument("--tls-ca", help="PEM file; connects with TLS")
    arguments.add_argument("--token-file")
    arguments.add_argument("--wait", type=float, default=0, help="seconds to wait for the server")
    arguments.add_argument("--no-poses", action="store_true", help="track the camera from the images")
    options = arguments.parse_args()
    folder: Path = options.folder
    masks, poses = read_list(folder / "mask.txt"), read_list(folder / "groundtruth.txt")
    instances = read_instances(folder / "detections.csv")
    tls = romap.Tls(ca=options.tls_ca) if options.tls_ca else None
    with romap.connect(options.server, tls=tls, token_file=options.token_file, wait=options.wait) as server:
        camera, pose_use = read_camera(folder / "camera.yaml"), "ignore" if options.no_poses else "given"
        with server.session(camera, name=folder.resolve().name, pose_use=pose_use) as session:
            for time_ns, (image, *_) in read_list(folder / "rgb.txt"):
                mask, row = nearest(masks, time_ns), nearest(poses, time_ns)
                numbers = [float(value) for value in row] if row else []
                session.send(
                    (folder / image).read_bytes(),
                    time_ns,
                    masks=(folder / mask[0]).read_bytes() if mask else None,
                    instances=instances.get(time_ns, ()),
                    pose=romap.pose(numbers[3:7], numbers[:3]) if numbers and not options.no_poses else None,
                )
            result = session.result()
    for warning in result.statistics.diagnostics:
        print(f"{warning.severity}: {warning.text}", file=sys.stderr)
    for each in result.objects:
        size = " x ".join(f"{2 * side:.3f}" for side in each.object.cuboid.half_extents)
        triangles = len(each.mesh.mesh.triangles) if each.mesh else 0
        print(f"{each.object.id} {each.object.class_name}: {size}, mesh with {triangles} triangles")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (romap.Error, OSError) as error:
        sys.exit(f"stream_folder: {error}")
