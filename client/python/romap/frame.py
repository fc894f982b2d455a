"""Images, masks and depth in their form on the wire."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Iterable, Optional, Union

import numpy as np

import romap.v1.mapping_pb2 as pb

from .camera import Camera
from .errors import invalid
from .geometry import Array, transform_to_proto, vector_to_proto

_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8\xff"


@dataclass(frozen=True)
class Instance:
    """What a label of a mask means, in its frame only."""

    label: int  # 1..65534
    class_name: str = "object"
    score: float = 1.0  # of the detector, 0..1
    track_id: Optional[int] = None  # of the detector's tracker, if it has one


def label_runs(labels: Any) -> Array:
    """Run lengths of a label image (H x W integers, row-major): label, length, label, length, ... (uint32)."""
    flat = np.ascontiguousarray(labels).reshape(-1)
    if flat.size == 0:
        return np.zeros(0, np.uint32)
    starts = np.flatnonzero(np.append(True, flat[1:] != flat[:-1]))
    runs = np.empty(2 * starts.size, np.uint32)
    runs[0::2] = flat[starts]
    runs[1::2] = np.diff(np.append(starts, flat.size))
    return runs


def labels_from_runs(runs: Any, height: int, width: int) -> Array:
    """The label image (H x W, uint16) of run lengths."""
    pairs = np.asarray(runs).reshape(-1, 2)
    if int(pairs[:, 1].sum()) != height * width:
        raise invalid(f"runs: have {int(pairs[:, 1].sum())} pixels; {width}x{height} need {height * width}")
    return np.repeat(pairs[:, 0].astype(np.uint16), pairs[:, 1]).reshape(height, width)


def _check_size(array: Array, camera: Camera, name: str) -> None:
    if array.shape[:2] != (camera.height, camera.width):
        size = f"{array.shape[1]}x{array.shape[0]}" if array.ndim >= 2 else f"the shape {array.shape}, not a size"
        raise invalid(f"{name}: is {size}; the camera has {camera.width}x{camera.height} px")


def image_to_proto(image: Union[bytes, Array], camera: Camera) -> Any:
    if isinstance(image, (bytes, bytearray, memoryview)):
        data = bytes(image)
        if data.startswith(_PNG):
            return pb.Image(encoding=pb.IMAGE_ENCODING_PNG, data=data)
        if data.startswith(_JPEG):
            return pb.Image(encoding=pb.IMAGE_ENCODING_JPEG, data=data)
        raise invalid("image: the bytes are neither a JPEG nor a PNG file; pass pixels as an array of H x W x 3")
    pixels = np.asarray(image)
    if pixels.dtype != np.uint8 or not (pixels.ndim == 2 or (pixels.ndim == 3 and pixels.shape[2] == 3)):
        raise invalid(f"image: must be H x W x 3 (RGB) or H x W of uint8, is {pixels.shape} of {pixels.dtype}")
    _check_size(pixels, camera, "image")
    encoding = pb.IMAGE_ENCODING_RAW_GRAY8 if pixels.ndim == 2 else pb.IMAGE_ENCODING_RAW_RGB8
    return pb.Image(
        encoding=encoding,
        data=np.ascontiguousarray(pixels).tobytes(),
        width_px=camera.width,
        height_px=camera.height,
    )


def masks_to_proto(masks: Union[bytes, Array], instances: Iterable[Instance], camera: Camera) -> Any:
    proto = pb.Masks()
    if isinstance(masks, (bytes, bytearray, memoryview)):
        proto.label_png = bytes(masks)
    else:
        labels = np.asarray(masks)
        if labels.ndim != 2 or labels.dtype.kind not in "iub":
            raise invalid(f"masks: must be H x W integers, are {labels.shape} of {labels.dtype}")
        _check_size(labels, camera, "masks")
        runs = label_runs(labels)
        if labels.dtype.kind == "i" and labels.min() < 0 or labels.max() > 65535:
            raise invalid(f"masks: labels must be 0..65535, are {labels.min()}..{labels.max()}")
        proto.label_runs.label_length_pairs.extend(runs.tolist())
    for instance in instances:
        proto.instances.add(
            label=instance.label,
            class_name=instance.class_name,
            score=instance.score,
            track_id=instance.track_id,
        )
    return proto


def depth_to_proto(depth: Union[bytes, Array], scale: float, camera: Camera) -> Any:
    if isinstance(depth, (bytes, bytearray, memoryview)):
        return pb.Depth(encoding=pb.DEPTH_ENCODING_PNG16, data=bytes(depth), scale_mu=scale)
    values = np.asarray(depth)
    if values.ndim != 2:
        raise invalid(f"depth: must be H x W, has the shape {values.shape}")
    _check_size(values, camera, "depth")
    if values.dtype.kind == "f":
        # 65535 means that the depth is unknown to many cameras, so it is not used.
        units = np.nan_to_num(values / scale, nan=0.0, posinf=0.0, neginf=0.0)
        values = np.where((units >= 1) & (units < 65535), np.rint(units), 0)
    elif values.min() < 0 or values.max() > 65535:
        raise invalid(f"depth: must be 0..65535, is {values.min()}..{values.max()}")
    data = np.ascontiguousarray(values.astype("<u2")).tobytes()
    return pb.Depth(encoding=pb.DEPTH_ENCODING_RAW_UINT16, data=data, scale_mu=scale)


def frame_to_proto(
    camera: Camera,
    image: Union[bytes, Array],
    timestamp_ns: int,
    *,
    masks: Union[bytes, Array, None],
    instances: Iterable[Instance],
    pose: Optional[Array],
    depth: Union[bytes, Array, None],
    depth_scale: float,
    gravity: Any,
) -> Any:
    """A Frame without an id; the arguments are those of Session.send()."""
    frame = pb.Frame(timestamp_ns=timestamp_ns, image=image_to_proto(image, camera))
    if masks is not None:
        frame.masks.CopyFrom(masks_to_proto(masks, instances, camera))
    if pose is not None:
        frame.t_world_camera.CopyFrom(transform_to_proto(pose, "pose"))
    if depth is not None:
        frame.depth.CopyFrom(depth_to_proto(depth, depth_scale, camera))
    if gravity is not None:
        frame.gravity_camera.CopyFrom(vector_to_proto(gravity, "gravity"))
    return frame
