#!/usr/bin/env python3
"""Maps what a camera (V4L2) or a video shows until it ends, or until Ctrl-C. Needs python3-opencv.

    python3 camera.py --server 127.0.0.1:50051 --focal 600

The boxes that you draw in the first image, or pass with --box, are the masks of the objects; OpenCV's CSRT tracker follows
them. Replace `masks_of()` by your detector: it returns an image of integer labels and what they mean.
"""

import argparse
import sys
import threading
import time
from typing import Any, List, Tuple

import cv2
import numpy as np

import romap


class BoxTracker:
    def __init__(self, image: Any, boxes: List[str]) -> None:
        self.trackers: List[Any] = []
        drawn = [[int(side) for side in box.split(",")] for box in boxes]
        for box in drawn or cv2.selectROIs("romap: draw boxes, Enter after each, Escape to start", image):
            self.trackers.append(cv2.TrackerCSRT_create())
            self.trackers[-1].init(image, tuple(int(side) for side in box))

    def masks_of(self, image: Any) -> Tuple[Any, List[romap.Instance]]:
        labels = np.zeros(image.shape[:2], np.uint8)
        instances = []
        for label, tracker in enumerate(self.trackers, start=1):
            found, (x, y, width, height) = tracker.update(image)
            if found:
                labels[max(0, y) : y + height, max(0, x) : x + width] = label
                instances.append(romap.Instance(label, "object", track_id=label))
        return labels, instances


def show_events(session: romap.Session) -> None:
    for event in session.events():
        if isinstance(event, romap.ObjectUpdate) and event.state == "confirmed":
            print(f"object {event.id}: {event.class_name}, half extents {event.cuboid.half_extents.round(3)}")
        elif isinstance(event, romap.FrameAck) and event.state_reason:
            print(f"camera {event.state}: {event.state_reason}")


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--server", default="127.0.0.1:50051")
    arguments.add_argument("--device", default="0", help="number of the camera, or a video file")
    arguments.add_argument("--box", action="append", default=[], help="X,Y,WIDTH,HEIGHT in pixels; may be repeated")
    arguments.add_argument("--focal", type=float, required=True, help="focal length in pixels, from a calibration")
    options = arguments.parse_args()
    is_live = options.device.isdigit()
    video = cv2.VideoCapture(int(options.device) if is_live else options.device)
    found, image = video.read()
    if not found:
        sys.exit(f"camera: {options.device} gives no image")
    height, width = image.shape[:2]
    camera = romap.Camera(width, height, options.focal, options.focal, (width - 1) / 2, (height - 1) / 2)
    tracker = BoxTracker(image, options.box)
    with romap.connect(options.server) as server:
        with server.session(camera, name="camera", mode="live" if is_live else "replay", pose_use="ignore") as session:
            reader = threading.Thread(target=show_events, args=(session,))
            reader.start()
            sent = 0
            try:
                while found:
                    seconds = time.monotonic() if is_live else sent / (video.get(cv2.CAP_PROP_FPS) or 25)
                    labels, instances = tracker.masks_of(image)
                    jpeg = cv2.imencode(".jpg", image)[1].tobytes()
                    sent = session.send(jpeg, round(seconds * 1e9), masks=labels, instances=instances)
                    found, image = video.read()
            except KeyboardInterrupt:
                print("finishing; the map stays on the server as session", session.id)
            session.finish()
            reader.join()


if __name__ == "__main__":
    try:
        main()
    except romap.Error as error:
        sys.exit(f"camera: {error}")
