"""The streams of the Python client against a scripted server: broken connections, limits, and what servers may send."""

from __future__ import annotations

import threading
import unittest
from typing import Any, List

import romap
import romap.v1.mapping_pb2 as pb
from servers import LIMIT_S, ScriptedServer, ack, event, opened, small_image

CAMERA = romap.Camera(64, 48, 60, 60, 31.5, 23.5)
QUICK = romap.Retry(initial_delay_s=0.01, max_delay_s=0.05)


def until_closed(requests: Any) -> Any:
    """Acknowledges all frames until the client ends the stream."""
    for each in requests:
        yield ack(each.frame.frame_id)


class LinkTest(unittest.TestCase):
    def serve(self, *scripts: Any) -> ScriptedServer:
        scripted = ScriptedServer(*scripts)
        self.addCleanup(scripted.stop)
        self.server = romap.connect(scripted.address, wait=LIMIT_S)
        self.addCleanup(self.server.close)
        return scripted

    def session(self, **options: Any) -> romap.Session:
        session = self.server.session(CAMERA, retry=QUICK, **options)
        self.addCleanup(session.close)
        return session

    def send(self, session: romap.Session, *indices: int) -> None:
        for index in indices:
            session.send(small_image(index), index)

    def test_what_is_not_stored_is_sent_again_in_order(self) -> None:
        got: List[Any] = []

        def first(requests: Any) -> Any:
            yield opened(durable=True)
            for expected in (1, 2, 3):
                self.assertEqual(next(requests).frame.frame_id, expected)
                yield ack(expected)
            yield event(durable=pb.Durable(frame_id=1))
            raise ConnectionError

        def second(requests: Any) -> Any:
            yield opened(durable=True, newest_frame_id=3)
            for each in requests:
                got.append((each.frame.frame_id, each.frame.resent))
                yield ack(each.frame.frame_id, duplicate=each.frame.frame_id <= 3)
                yield event(durable=pb.Durable(frame_id=each.frame.frame_id))

        scripted = self.serve(first, second)
        link: List[Any] = []
        session = self.session(on_link=lambda up, reason, attempt: link.append((up, reason)))
        self.send(session, 1, 2, 3)
        acks = [session.next_event(LIMIT_S) for _ in range(3)]
        self.send(session, 4)
        session.flush(LIMIT_S)
        self.assertEqual(got[:2], [(2, True), (3, True)])
        self.assertEqual(got[2][0], 4)
        self.assertEqual([each.resume_token for each in scripted.starts], ["", "token"])
        self.assertEqual(link, [(False, "scripted break"), (True, "")])
        session.close()
        acks += [each for each in self.left(session) if isinstance(each, romap.FrameAck)]
        frame_ids = [each.frame_id for each in acks if isinstance(each, romap.FrameAck)]
        self.assertEqual(frame_ids, [1, 2, 3, 4], "each frame is acknowledged once")

    def left(self, session: romap.Session) -> List[romap.Event]:
        """What a closed session has delivered and nobody has read."""
        return list(session.events())

    def test_objects_that_are_gone_after_a_break_are_removed(self) -> None:
        pose = pb.RigidTransform(rotation=pb.Quaternion(w=1))
        update = pb.ObjectUpdate(id=7, revision=3, state=pb.OBJECT_STATE_CONFIRMED, cuboid=pb.Cuboid(t_world_object=pose))

        def first(requests: Any) -> Any:
            yield opened()
            yield event(object=update)
            raise ConnectionError

        def second(requests: Any) -> Any:
            yield opened(object_ids=[8])
            yield from until_closed(requests)

        self.serve(first, second)
        session = self.session()
        self.assertIsInstance(session.next_event(LIMIT_S), romap.ObjectUpdate)
        removed = session.next_event(LIMIT_S)
        assert isinstance(removed, romap.ObjectRemoved)
        self.assertEqual((removed.id, removed.revision), (7, 4))

    def test_a_mesh_larger_than_the_default_limit_of_grpc(self) -> None:
        texture = bytes(9 << 20)

        def script(requests: Any) -> Any:
            yield opened()
            yield event(mesh=pb.MeshUpdate(id=1, revision=1, texture=texture))
            yield from until_closed(requests)

        self.serve(script)
        mesh = self.session().next_event(LIMIT_S)
        assert isinstance(mesh, romap.MeshUpdate)
        self.assertEqual(len(mesh.texture), len(texture))

    def test_a_message_that_is_too_large_is_refused_at_once(self) -> None:
        def script(requests: Any) -> Any:
            yield opened()
            yield from until_closed(requests)

        self.serve(script)
        with self.assertRaisesRegex(romap.Error, "RESOURCE_EXHAUSTED: the message has .* the limit is 33554432"):
            self.session().send(b"\xff\xd8\xff" + bytes(33 << 20), 1)

    def test_send_waits_for_a_busy_server(self) -> None:
        may_read = threading.Event()

        def script(requests: Any) -> Any:
            yield opened()
            may_read.wait(LIMIT_S)
            yield from until_closed(requests)

        self.serve(script)
        session = self.session(limits=romap.Limits(max_waiting=2, max_bytes=40_000))  # four frames
        sent: List[int] = []

        def send_all() -> None:
            for index in range(1, 21):
                sent.append(session.send(small_image(index), index))

        sender = threading.Thread(target=send_all)
        sender.start()
        sender.join(0.5)
        self.assertTrue(sender.is_alive())
        self.assertLessEqual(len(sent), 4)
        may_read.set()
        sender.join(LIMIT_S)
        session.flush(LIMIT_S)
        self.assertEqual(sent, list(range(1, 21)))

    def test_a_live_session_drops_the_oldest_frames_instead(self) -> None:
        may_read = threading.Event()

        def script(requests: Any) -> Any:
            yield opened()
            may_read.wait(LIMIT_S)
            yield from until_closed(requests)

        scripted = self.serve(script)
        live = scripted.info()
        live.mode = pb.FRAME_MODE_LIVE
        scripted.info = lambda: live  # type: ignore[method-assign]
        session = self.session(mode="live", limits=romap.Limits(max_waiting=2))
        big = b"\xff\xd8\xff" + bytes(2 << 20)  # more than flow control lets through
        for index in range(1, 21):
            session.send(big, index)
        self.assertGreater(session.dropped, 10)
        may_read.set()
        session.flush(LIMIT_S)
        session.close()
        acks = [each for each in self.left(session) if isinstance(each, romap.FrameAck)]
        self.assertEqual(sorted(each.frame_id for each in acks), list(range(1, 21)))
        self.assertEqual(sum(not each.accepted for each in acks), session.dropped)

    def test_events_are_bounded_while_nobody_reads_them(self) -> None:
        pose = pb.RigidTransform(rotation=pb.Quaternion(w=1))

        def script(requests: Any) -> Any:
            yield opened()
            for revision in range(1, 3000):
                yield event(object=pb.ObjectUpdate(id=1, revision=revision, state=2, cuboid=pb.Cuboid(t_world_object=pose)))
            next(requests)
            yield ack(1)
            yield from until_closed(requests)

        self.serve(script)
        session = self.session()
        self.send(session, 1)
        session.flush(LIMIT_S)
        newest = session.next_event(LIMIT_S)
        assert isinstance(newest, romap.ObjectUpdate)
        self.assertEqual(newest.revision, 2999)
        self.assertIsInstance(session.next_event(LIMIT_S), romap.FrameAck)

    def test_callbacks_get_all_events_and_their_errors_end_the_session(self) -> None:
        def script(requests: Any) -> Any:
            yield opened()
            yield from until_closed(requests)

        self.serve(script)
        got: List[int] = []

        def on_event(each: romap.Event) -> None:
            assert isinstance(each, romap.FrameAck)
            got.append(each.frame_id)
            if each.frame_id == 3:
                raise KeyError("no such thing")

        session = self.session(on_event=on_event)
        self.send(session, 1, 2, 3)
        with self.assertLogs("romap"), self.assertRaisesRegex(romap.Error, "INTERNAL: the callback .*no such thing"):
            session.wait(LIMIT_S)
        self.assertEqual(got, [1, 2, 3])
        with self.assertRaisesRegex(romap.Error, "the callback of the session failed"):
            self.send(session, 4)

    def test_a_connection_that_the_program_closed(self) -> None:
        def script(requests: Any) -> Any:
            yield opened()
            yield from until_closed(requests)

        self.serve(script)
        session = self.session()
        self.server.close()
        with self.assertRaisesRegex(romap.Error, "FAILED_PRECONDITION: this connection was closed by the program"):
            session.wait(LIMIT_S)
        with self.assertRaisesRegex(romap.Error, "closed by the program"):
            self.server.sessions()

    def test_gives_up_after_the_time_of_retry(self) -> None:
        def script(requests: Any) -> Any:
            yield opened()
            yield from until_closed(requests)

        scripted = self.serve(script)
        session = self.server.session(CAMERA, retry=romap.Retry(0.01, 0.05, max_down_s=0.3))
        scripted.stop()
        with self.assertRaisesRegex(romap.Error, r"\(gave up after 0\.\d s\)"):
            session.wait(LIMIT_S)

    def test_a_session_that_another_program_finishes_early(self) -> None:
        def script(requests: Any) -> Any:
            yield opened()
            next(requests)  # and ends the stream without an acknowledgement

        self.serve(script)
        session = self.session()
        self.send(session, 1)
        with self.assertRaisesRegex(romap.Error, "FAILED_PRECONDITION: the session was finished before 1 inputs"):
            session.wait(LIMIT_S)

    def test_frames_must_be_in_order(self) -> None:
        def script(requests: Any) -> Any:
            yield opened(newest_frame_id=5)
            yield from until_closed(requests)

        self.serve(script)
        session = self.session()
        self.assertEqual(session.send(small_image(1), 10), 6)
        with self.assertRaisesRegex(romap.Error, "timestamp_ns: must increase; is 10 after 10"):
            session.send(small_image(2), 10)
        with self.assertRaisesRegex(romap.Error, "frame_id: must increase; is 6 after 6"):
            session.send(small_image(2), 11, frame_id=6)

    def test_a_watch_begins_again_after_a_break(self) -> None:
        scripted = self.serve()
        answers = [ConnectionError, None]

        def watch() -> Any:
            yield pb.WatchResponse(opened=pb.StreamOpened(session_id="scripted"))
            yield pb.WatchResponse(event=pb.MapEvent(statistics=pb.Statistics(keyframes=len(answers))))
            if answers.pop(0) is not None:
                raise ConnectionError

        scripted.watch = watch
        with self.server.watch("scripted", retry=QUICK) as events:
            self.assertEqual([each.keyframes for each in events if isinstance(each, romap.Statistics)][-1], 1)


if __name__ == "__main__":
    unittest.main()
