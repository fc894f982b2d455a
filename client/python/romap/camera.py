"""The camera of a session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Tuple

import romap.v1.mapping_pb2 as pb

from .errors import invalid

_LENSES = {"radial-tangential": pb.LENS_MODEL_RADIAL_TANGENTIAL, "fisheye": pb.LENS_MODEL_FISHEYE}


@dataclass(frozen=True)
class Camera:
    """Pinhole camera with lens distortion, in pixels; pixel centers are at integer coordinates."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: Tuple[float, ...] = ()  # k1 k2 p1 p2 k3, or k1 k2 k3 k4 of a fisheye lens, as in OpenCV
    lens: str = "radial-tangential"  # or "fisheye"
    readout_s: float = 0.0  # of a rolling shutter: the time from the first to the last row

    def to_proto(self) -> Any:
        if self.lens not in _LENSES:
            raise invalid(f"camera.lens: must be one of {', '.join(_LENSES)}; is {self.lens}")
        return pb.Camera(
            width_px=self.width,
            height_px=self.height,
            fx_px=self.fx,
            fy_px=self.fy,
            cx_px=self.cx,
            cy_px=self.cy,
            distortion=self.distortion,
            lens=_LENSES[self.lens],
            readout_s=self.readout_s,
        )

    @staticmethod
    def from_proto(proto: Any) -> Camera:
        fisheye = proto.lens == pb.LENS_MODEL_FISHEYE
        return Camera(
            proto.width_px,
            proto.height_px,
            proto.fx_px,
            proto.fy_px,
            proto.cx_px,
            proto.cy_px,
            tuple(proto.distortion),
            "fisheye" if fisheye else "radial-tangential",
            proto.readout_s,
        )
