"""The parts of the Python client that need no server."""

from __future__ import annotations

import unittest
from typing import Any

import numpy as np
import romap
import romap.v1.mapping_pb2 as pb
from romap import conventions
from romap._event_buffer import MAX_ACKS, EventBuffer
from romap._rpc import stays_on_this_machine
from romap._unsettled import UnsettledInputs
from romap.events import event_from_proto
from romap.frame import depth_to_proto, image_to_proto, masks_to_proto
from romap.geometry import transform_from_proto, transform_to_proto

CAMERA = romap.Camera(64, 48, 60, 60, 31.5, 23.5)


def random_pose(rng: Any) -> Any:
    return romap.pose(rng.normal(size=4), rng.normal(size=3))


class LabelRunsTest(unittest.TestCase):
    def test_round_trip(self) -> None:
        rng = np.random.default_rng(1)
        for dtype in (np.uint8, np.uint16, np.int32, np.int64, bool):
            for shape in ((1, 1), (1, 7), (7, 1), (48, 64)):
                labels = rng.integers(0, 2 if dtype is bool else 200, shape).astype(dtype)
                labels[:, : shape[1] // 2] = labels[0, 0]
                runs = romap.label_runs(labels)
                self.assertEqual(runs.dtype, np.uint32)
                np.testing.assert_array_equal(romap.labels_from_runs(runs, *shape), labels)

    def test_runs_are_maximal_and_continue_in_the_next_row(self) -> None:
        labels = np.array([[0, 0, 3], [3, 3, 65535]], np.uint16)
        self.assertEqual(romap.label_runs(labels).tolist(), [0, 2, 3, 3, 65535, 1])
        self.assertEqual(romap.label_runs(np.zeros((5, 4), np.uint8)).tolist(), [0, 20])

    def test_a_view_is_read_in_row_major_order(self) -> None:
        labels = np.arange(6, dtype=np.uint8).reshape(2, 3).T
        self.assertEqual(romap.label_runs(labels)[0::2].tolist(), [0, 3, 1, 4, 2, 5])

    def test_a_wrong_number_of_pixels(self) -> None:
        with self.assertRaisesRegex(romap.Error, "have 5 pixels; 3x2 need 6"):
            romap.labels_from_runs([1, 5], 2, 3)


class FrameTest(unittest.TestCase):
    def assert_invalid(self, pattern: str, call: Any, *arguments: Any) -> None:
        with self.assertRaisesRegex(romap.Error, pattern) as caught:
            call(*arguments)
        self.assertEqual(caught.exception.code, "INVALID_ARGUMENT")
        self.assertNotIn("\n", str(caught.exception))

    def test_images(self) -> None:
        pixels = np.arange(48 * 64 * 3, dtype=np.uint32).astype(np.uint8).reshape(48, 64, 3)
        raw = image_to_proto(pixels[:, ::-1], CAMERA)
        self.assertEqual((raw.encoding, raw.width_px, raw.height_px), (pb.IMAGE_ENCODING_RAW_RGB8, 64, 48))
        np.testing.assert_array_equal(np.frombuffer(raw.data, np.uint8).reshape(48, 64, 3), pixels[:, ::-1])
        self.assertEqual(image_to_proto(pixels[:, :, 0], CAMERA).encoding, pb.IMAGE_ENCODING_RAW_GRAY8)
        self.assertEqual(image_to_proto(b"\xff\xd8\xff\xe0", CAMERA).encoding, pb.IMAGE_ENCODING_JPEG)
        self.assertEqual(image_to_proto(b"\x89PNG\r\n\x1a\n", CAMERA).encoding, pb.IMAGE_ENCODING_PNG)
        self.assert_invalid("neither a JPEG nor a PNG", image_to_proto, b"GIF89a", CAMERA)
        self.assert_invalid("of float64", image_to_proto, np.zeros((48, 64, 3)), CAMERA)
        self.assert_invalid(r"\(48, 64, 4\)", image_to_proto, np.zeros((48, 64, 4), np.uint8), CAMERA)
        self.assert_invalid("is 48x64; the camera has 64x48", image_to_proto, np.zeros((64, 48, 3), np.uint8), CAMERA)

    def test_masks(self) -> None:
        instances = [romap.Instance(2, "mug", 0.5), romap.Instance(3, "cup", track_id=0)]
        masks = masks_to_proto(np.full((48, 64), 2), instances, CAMERA)
        self.assertEqual(list(masks.label_runs.label_length_pairs), [2, 48 * 64])
        self.assertEqual([each.class_name for each in masks.instances], ["mug", "cup"])
        self.assertEqual([each.HasField("track_id") for each in masks.instances], [False, True])
        self.assert_invalid("is 10x20; the camera has", masks_to_proto, np.zeros((20, 10), int), (), CAMERA)
        self.assert_invalid("of float64", masks_to_proto, np.zeros((48, 64)), (), CAMERA)
        self.assert_invalid("are -1..-1", masks_to_proto, np.full((48, 64), -1), (), CAMERA)
        self.assert_invalid("are 65536..65536", masks_to_proto, np.full((48, 64), 65536), (), CAMERA)

    def test_depth(self) -> None:
        meters = np.full((48, 64), 1.5)
        meters[0, :4] = [np.nan, -1, 70, np.inf]
        depth = depth_to_proto(meters, 0.001, CAMERA)
        values = np.frombuffer(depth.data, "<u2").reshape(48, 64)
        self.assertEqual(values[0, :5].tolist(), [0, 0, 0, 0, 1500])
        self.assertEqual(depth_to_proto(b"\x89PNG", 0.002, CAMERA).encoding, pb.DEPTH_ENCODING_PNG16)
        self.assert_invalid("is 1x1", depth_to_proto, np.zeros((1, 1)), 0.001, CAMERA)

    def test_poses(self) -> None:
        rng = np.random.default_rng(2)
        for _ in range(100):
            pose = random_pose(rng)
            np.testing.assert_allclose(transform_from_proto(transform_to_proto(pose, "pose")), pose, atol=1e-12)
        for axis in np.eye(3):  # half turns
            pose = romap.pose([*axis, 0], [1, 2, 3])
            np.testing.assert_allclose(transform_from_proto(transform_to_proto(pose, "pose")), pose, atol=1e-12)
        self.assert_invalid("pose: must be a 4x4 matrix", transform_to_proto, np.eye(3), "pose")
        self.assert_invalid("not a rotation matrix", transform_to_proto, np.diag([1, 1, -1, 1]), "pose")
        self.assert_invalid("last row", transform_to_proto, romap.pose([0, 0, 0, 1], [1, 0, 0]).T, "pose")
        self.assert_invalid("not finite", transform_to_proto, np.full((4, 4), np.nan), "pose")


class UnsettledInputsTest(unittest.TestCase):
    def request(self, frame_id: int, masks: bool = False) -> Any:
        if masks:
            return pb.MapRequest(late_masks=pb.LateMasks(frame_id=frame_id))
        return pb.MapRequest(frame=pb.Frame(frame_id=frame_id))

    def ack(self, frame_id: int, accepted: bool = True) -> Any:
        return event_from_proto(pb.MapEvent(frame_ack=pb.FrameAck(frame_id=frame_id, accepted=accepted)))

    def inputs(self, durable: bool, *frame_ids: int) -> UnsettledInputs:
        inputs = UnsettledInputs()
        inputs.begin_stream(durable)
        for frame_id in frame_ids:
            inputs.add(self.request(frame_id))
        return inputs

    def take_all(self, inputs: UnsettledInputs) -> "list[tuple[int, bool]]":
        taken = []
        while (request := inputs.take_next()) is not None:
            taken.append((request.frame.frame_id, request.frame.resent))
        return taken

    def test_without_a_store_an_acknowledged_input_is_settled(self) -> None:
        inputs = self.inputs(False, 1, 2)
        self.assertEqual(self.take_all(inputs), [(1, False), (2, False)])
        self.assertEqual([each.frame_id for each in inputs.acknowledge(self.ack(1))], [1])
        self.assertEqual((len(inputs), inputs.unacknowledged()), (1, 1))

    def test_with_a_store_an_input_is_kept_until_it_is_stored(self) -> None:
        inputs = self.inputs(True, 1, 2)
        self.take_all(inputs)
        inputs.acknowledge(self.ack(1))
        inputs.acknowledge(self.ack(2))
        self.assertEqual((len(inputs), inputs.unacknowledged()), (2, 0))
        inputs.cover(1, 0)
        inputs.begin_stream(True)
        self.assertEqual(self.take_all(inputs), [(2, True)])
        self.assertEqual(inputs.acknowledge(self.ack(2)), [], "the caller has had it")
        inputs.cover(2, 0)
        self.assertEqual((len(inputs), inputs.bytes), (0, 0))

    def test_lost_acknowledgements_are_made_up_as_duplicates(self) -> None:
        inputs = self.inputs(False, 1, 2, 3)
        self.take_all(inputs)
        inputs.begin_stream(False)
        self.take_all(inputs)
        acks = inputs.acknowledge(self.ack(3))
        self.assertEqual([(each.frame_id, each.accepted, each.duplicate) for each in acks],
                         [(1, True, True), (2, True, True), (3, True, False)])

    def test_a_rejected_input_is_settled(self) -> None:
        inputs = self.inputs(True, 1)
        self.take_all(inputs)
        self.assertEqual(len(inputs.acknowledge(self.ack(1, accepted=False))), 1)
        self.assertEqual(len(inputs), 0)

    def test_what_waited_during_a_break_is_marked_and_what_was_not_sent_is_not_covered(self) -> None:
        inputs = self.inputs(True, 1)
        inputs.begin_stream(True)
        inputs.add(self.request(2))
        inputs.cover(9, 9)
        self.assertEqual(self.take_all(inputs), [(1, True), (2, False)])

    def test_late_masks_are_covered_separately(self) -> None:
        inputs = self.inputs(True, 1)
        inputs.add(self.request(1, masks=True))
        self.take_all(inputs)
        inputs.acknowledge(self.ack(1))
        inputs.acknowledge(event_from_proto(pb.MapEvent(masks_ack=pb.MasksAck(frame_id=1, accepted=True))))  # type: ignore
        inputs.cover(1, 0)
        self.assertEqual(len(inputs), 1)
        inputs.cover(1, 1)
        self.assertEqual(len(inputs), 0)

    def test_only_frames_that_were_never_sent_are_dropped(self) -> None:
        inputs = self.inputs(False, 1, 2)
        inputs.add(self.request(2, masks=True))
        inputs.add(self.request(3))
        inputs.take_next()
        self.assertEqual(inputs.waiting(), 3)
        self.assertEqual([inputs.drop_oldest_unsent_frame() for _ in range(3)], [2, 3, None])


class EventsTest(unittest.TestCase):
    def update(self, **fields: Any) -> Any:
        still = pb.RigidTransform(rotation=pb.Quaternion(w=1))
        return pb.MapEvent(object=pb.ObjectUpdate(cuboid=pb.Cuboid(t_world_object=still), **fields))

    def events(self) -> "list[Any]":
        """Random but valid events of a few objects."""
        rng = np.random.default_rng(4)
        made, alive = [], {}
        for revision in range(1, 400):
            kind = rng.integers(0, 10)
            if not alive or kind == 0:
                alive[revision] = made.append(self.update(id=revision, revision=1, state=1))
                continue
            target = int(rng.choice(list(alive)))
            if kind < 5:
                made.append(self.update(id=target, revision=revision, state=2))
            elif kind < 8:
                made.append(pb.MapEvent(mesh=pb.MeshUpdate(id=target, revision=revision)))
            elif kind == 8 or len(alive) < 2:
                made.append(pb.MapEvent(removed=pb.ObjectRemoved(id=target, revision=revision)))
                del alive[target]
            else:
                del alive[target]
                merged = pb.ObjectMerged(into=list(alive)[0], revision=revision)
                setattr(merged, "from", target)
                made.append(pb.MapEvent(merged=merged))
        return [event_from_proto(each) for each in made]

    def state(self, copy: romap.MapCopy) -> Any:
        return {
            id: (each.object.revision, each.object.state, each.mesh and each.mesh.revision)
            for id, each in sorted(copy.objects.items())
        }

    def test_a_copy_of_buffered_events_equals_one_of_all_events(self) -> None:
        rng = np.random.default_rng(5)
        whole, buffered, buffer = romap.MapCopy(), romap.MapCopy(), EventBuffer()
        self.assertGreater(len(self.events()), 300)
        longest = 0
        for each in self.events():
            whole.apply(each)
            buffer.add(each)
            longest = max(longest, len(buffer))
            if rng.random() < 0.02:
                while (event := buffer.pop()) is not None:
                    buffered.apply(event)
                self.assertEqual(self.state(buffered), self.state(whole))
        self.assertLess(longest, 100)

    def test_the_newest_acknowledgements_are_kept(self) -> None:
        buffer = EventBuffer()
        for frame_id in range(1, MAX_ACKS + 11):
            event = event_from_proto(pb.MapEvent(frame_ack=pb.FrameAck(frame_id=frame_id, accepted=True)))
            assert event is not None
            buffer.add(event)
        self.assertEqual(len(buffer), MAX_ACKS)
        first = buffer.pop()
        assert isinstance(first, romap.FrameAck)
        self.assertEqual(first.frame_id, 11)

    def test_unknown_kinds_and_values_are_ignored(self) -> None:
        self.assertIsNone(event_from_proto(pb.MapEvent()))
        self.assertIsNone(event_from_proto(self.update(id=1, state=77)))
        self.assertIsNone(event_from_proto(pb.MapEvent(frame_ack=pb.FrameAck(state=77))))

    def test_corners_of_a_cuboid(self) -> None:
        cuboid = romap.Cuboid(romap.pose([0, 0, np.sqrt(0.5), np.sqrt(0.5)], [10, 0, 0]), np.array([1, 2, 3]), 1)
        corners = cuboid.corners()
        np.testing.assert_allclose(corners.min(axis=0), [8, -1, -3], atol=1e-12)
        np.testing.assert_allclose(corners.max(axis=0), [12, 1, 3], atol=1e-12)


class ConnectionTest(unittest.TestCase):
    def test_the_token_is_not_sent_in_clear_text(self) -> None:
        for address in ("127.0.0.1:1", "127.9.9.9:1", "localhost:1", "[::1]:1", "unix:/tmp/romap"):
            self.assertTrue(stays_on_this_machine(address), address)
        for address in ("127.0.0.1.evil.org:1", "10.0.0.1:1", "0.0.0.0:1", "example:1"):
            self.assertFalse(stays_on_this_machine(address), address)
            with self.assertRaisesRegex(romap.Error, "not sent to .* in clear text"):
                romap.connect(address, token="secret")

    def test_bad_addresses_and_files(self) -> None:
        for address in ("localhost", ":1", "host:x", "host:70000"):
            with self.assertRaisesRegex(romap.Error, "must be HOST:PORT"):
                romap.connect(address)
        with self.assertRaisesRegex(romap.Error, "NOT_FOUND: cannot read /none.pem: No such file"):
            romap.connect("localhost:1", tls=romap.Tls(ca="/none.pem"))
        with self.assertRaisesRegex(romap.Error, "both the certificate and its key"):
            romap.connect("localhost:1", tls=romap.Tls(certificate="/none.pem"))
        with self.assertRaisesRegex(romap.Error, "the token is not one that"):
            romap.connect("localhost:1", token="two words")

    def test_no_server(self) -> None:
        with self.assertRaisesRegex(romap.Error, "UNAVAILABLE: cannot connect to romap-server at 127.0.0.1:1 "):
            romap.connect("127.0.0.1:1")

    def test_damaged_meshes(self) -> None:
        for data in (b"", b"DRACO", b"DRACO\x02\x02\x01\x01\0\0\0" + b"\xff" * 20):
            with self.assertRaisesRegex(romap.Error, "INVALID_ARGUMENT: .*Draco"):
                romap.decode_mesh(data)


class ConventionsTest(unittest.TestCase):
    """Each convention against its definition: where points of the world appear."""

    def project(self, pose: Any, point: Any) -> Any:
        p = (np.linalg.inv(pose) @ [*point, 1])[:3]
        return p[:2] / p[2] if p[2] > 0 else None

    def test_opengl(self) -> None:
        # An AR camera at height 1.5 (y up), level, that looks along -z, as ARKit and ARCore start.
        pose = conventions.pose_from_opengl(romap.pose([0, 0, 0, 1], [0, 1.5, 0]))
        np.testing.assert_allclose(pose[:3, 3], [0, 0, 1.5])
        # World of the AR session: 2 m in front (z = -2), 1 m to the right and 0.5 m above the camera.
        x, y, z = 1.0, 2.0, -2.0
        image = self.project(pose, [x, -z, y])
        np.testing.assert_allclose(image, [0.5, -0.25], atol=1e-12)  # to the right, above the center (y is down)
        self.assertIsNone(self.project(pose, [0, -3, 1.5]), "behind the camera")
        np.testing.assert_allclose(conventions.gravity_of_pose(pose), [0, 1, 0], atol=1e-12)
        np.testing.assert_allclose(conventions.gravity_from_opengl([0, -1, 0]), [0, 1, 0])

    def test_opengl_of_any_pose(self) -> None:
        rng = np.random.default_rng(6)
        for _ in range(20):
            given = random_pose(rng)
            pose = conventions.pose_from_opengl(given)
            self.assertAlmostEqual(np.linalg.det(pose[:3, :3]), 1)
            # A point in front of the camera: -z in its own frame, y up in the image.
            local = np.array([0.3, 0.2, -2.0])
            x, y, z = (given @ [*local, 1])[:3]
            np.testing.assert_allclose(self.project(pose, [x, -z, y]), [0.15, -0.1], atol=1e-9)
            down_camera = given[:3, :3].T @ [0, -1, 0]
            np.testing.assert_allclose(
                conventions.gravity_from_opengl(down_camera), conventions.gravity_of_pose(pose), atol=1e-12
            )

    def test_opengl_as_two_rotations_about_x(self) -> None:
        # As client/integration.md has it for ARKit and ARCore.
        rng = np.random.default_rng(7)
        up, flip = romap.pose([np.sqrt(0.5), 0, 0, np.sqrt(0.5)], [0, 0, 0]), romap.pose([1, 0, 0, 0], [0, 0, 0])
        given = random_pose(rng)
        pose = conventions.pose_from_opengl(given)
        np.testing.assert_allclose(up @ given @ flip, pose, atol=1e-12)
        np.testing.assert_allclose(pose[:3, :3].T @ [0, 0, -1], conventions.gravity_of_pose(pose), atol=1e-12)

    def test_arkit_intrinsics_are_columns(self) -> None:
        columns = [[1500, 0, 0], [0, 1501, 0], [960.5, 720.25, 1]]
        camera = conventions.camera_from_arkit(columns, 1920, 1440)
        self.assertEqual(camera, romap.Camera(1920, 1440, 1500, 1501, 960.5, 720.25))

    def test_arcore_intrinsics(self) -> None:
        camera = conventions.camera_from_arcore((490, 491), (320.5, 240.25), 640, 480)
        self.assertEqual(camera, romap.Camera(640, 480, 490, 491, 320.5, 240.25))

    def test_ros(self) -> None:
        k = [500, 0, 320, 0, 501, 240, 0, 0, 1]
        camera = conventions.camera_from_ros(640, 480, k, [0.1, 0, 0, 0, 0])
        self.assertEqual((camera.fy, camera.cx, camera.distortion), (501, 320, (0.1, 0, 0, 0, 0)))
        self.assertEqual(conventions.camera_from_ros(640, 480, k, [0.1, 0, 0, 0], "equidistant").lens, "fisheye")
        self.assertEqual(conventions.camera_from_ros(640, 480, k, [0.0] * 5).distortion, ())
        with self.assertRaisesRegex(ValueError, "rational_polynomial must be one of"):
            conventions.camera_from_ros(640, 480, k, [0.1] * 8, "rational_polynomial")
        # camera_link (x forward, y left, z up) looks along x of the map: REP 103.
        pose = conventions.pose_from_ros_body([0, 0, 0, 1], [0, 0, 1])
        np.testing.assert_allclose(self.project(pose, [2, -1, 1.5]), [0.5, -0.25], atol=1e-12)  # right, above
        # The usual static transform from camera_link to the optical frame gives the same pose.
        optical = conventions.pose_from_ros([-0.5, 0.5, -0.5, 0.5], [0, 0, 1])
        np.testing.assert_allclose(optical, pose, atol=1e-12)

    def test_gravity_of_an_imu_at_rest(self) -> None:
        # An IMU with the axes of camera_link at rest measures +9.81 along z (up).
        body_to_optical = romap.quaternion(conventions.ROS_BODY_FROM_OPTICAL[:3, :3].T)
        np.testing.assert_allclose(
            conventions.gravity_from_imu([0, 0, 9.81], body_to_optical), [0, 9.81, 0], atol=1e-12
        )

    def test_timestamps(self) -> None:
        self.assertEqual(conventions.timestamp_ns(1.5), 1_500_000_000)


if __name__ == "__main__":
    unittest.main()
