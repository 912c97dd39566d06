"""The simulated board: the golden conversations, and the promises of PROTOCOL.md that need time to pass."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path

import pytest

from armkin.board.firmware.segments.straight_lines import straight_line
from armkin.board.firmware.wire import motion_frame, protocol
from armkin.board.firmware.wire.protocol import (
    AxisImage,
    Error,
    Flag,
    GuardImage,
    Image,
    Segment,
    State,
    Status,
    whole_steps,
)
from armkin.board.sim.sim_board import SimBoard
from armkin.board_catalogue import BOARDS

GOLDEN = Path(__file__).parents[2] / "firmware" / "golden"


@pytest.mark.parametrize("path", sorted(GOLDEN.glob("*.talk")), ids=lambda p: p.stem)
def test_golden_conversations(path: Path) -> None:
    board: SimBoard | None = None
    splitter = protocol.Splitter()
    waiting: list[bytes] = []
    checked = 0
    for number, text in enumerate(path.read_text().splitlines(), 1):
        word, _, argument = text.partition(" ")
        if not text or word == "#":
            continue
        if word == "board":
            board = SimBoard(BOARDS[argument])
            continue
        assert board is not None
        if word == ">":
            board.receive(protocol.encode_frame(bytes.fromhex(argument)))
        elif word == "wire":
            board.receive(bytes.fromhex(argument))
        elif word == "wait":
            board.advance(int(argument) / 1000)
        elif word == "reset":
            board.reset()
        elif word == "silent":
            board.advance(0.02)
            waiting += splitter.feed(board.take())
            assert waiting == [], f"{path.name}:{number}"
        else:
            assert word == "<", f"{path.name}:{number}"
            waiting += splitter.feed(board.take())
            answer = waiting.pop(0).hex()
            shown = "".join(
                "??" if argument[i : i + 2] == "??" else answer[i : i + 2] for i in range(0, len(answer), 2)
            )
            assert shown == argument, f"{path.name}:{number}"
            checked += 1
    assert checked >= 2
    assert waiting == []


class Host:
    """Says one frame at a time to a board and reads the answer."""

    def __init__(self, board: SimBoard) -> None:
        self.board, self.splitter, self.tag, self.nonce = board, protocol.Splitter(), 0, 0

    def ask(self, payload: bytes) -> protocol.Reply:
        self.board.receive(protocol.encode_frame(payload))
        (answer,) = self.splitter.feed(self.board.take())
        reply = protocol.parse_reply(answer)
        assert reply is not None
        return reply

    def hello(self) -> protocol.Info:
        self.nonce, self.tag = self.nonce + 1, 0
        info = self.ask(protocol.hello(0, self.nonce))
        assert isinstance(info, protocol.Info)
        return info

    def say(self, make: bytes) -> Error:
        """A frame in sequence: its tag is filled in."""
        ack = self.ask(bytes([make[0], self.tag]) + make[2:])
        assert isinstance(ack, protocol.Ack)
        self.tag = ack.next
        return Error(ack.error)

    def status(self, page: int = 0) -> Status:
        status = self.ask(protocol.status_query(1, page))
        assert isinstance(status, Status)
        return status

    def move(
        self,
        axes: Sequence[int],
        start: Sequence[int],
        segments: Sequence[Segment],
        at_rest: bool,
        brake: float = 1.0,
    ) -> Error:
        plan = [self.board.motors.queue.plan[axis] for axis in axes]  # 2^-23 step
        ends = [(p + sum(s.ticks * s.rates[i] for s in segments)) >> 23 for i, p in enumerate(plan)]
        return self.say(motion_frame.motion(0, axes, start, ends, segments, at_rest=at_rest, brake=brake))


AXIS = AxisImage(True, False, -20_000, 20_000, 0, 20_000, 200_000)


def ready_host(switch=None, image: Image | None = None) -> Host:  # type: ignore[no-untyped-def]
    """A host with a configured board whose X, Y and Z are known and on."""
    board = BOARDS["uno_cnc_shield"]
    host = Host(SimBoard(board, switch))
    host.hello()
    image = image or Image((AXIS, AXIS, AXIS, AxisImage(), AxisImage()), (), (GuardImage(),) * 3)
    packed = image.pack()
    assert host.say(protocol.config(0, 0, packed)) == Error.OK
    assert host.say(protocol.commit(0, len(packed), image.crc())) == Error.OK
    assert host.say(protocol.set_position(0, {0: 0, 1: 0, 2: 0})) == Error.OK
    assert host.say(protocol.enable(0, 1)) == Error.OK
    return host


CRUISE = [whole_steps(500, 1600, 0, (250, -500))] * 8  # 0.4 s at 5 and 10 kHz


@pytest.mark.parametrize("brake", [1.0, 0.625])
def test_a_hold_stops_on_the_path_within_the_ramp(brake: float) -> None:
    host = ready_host()
    assert host.move([0, 1], [0, 0], CRUISE, at_rest=False, brake=brake) == Error.OK
    host.board.advance(0.1)
    before = host.status()
    assert before.state == State.MOVING
    held = host.ask(protocol.hold(1))
    assert isinstance(held, protocol.Ack)
    assert held.error == Error.HELD
    host.board.advance(0.05 * 0.9 / brake)
    assert host.status().state == State.HOLDING
    host.board.advance(0.05 * 0.2)
    after = host.status()
    assert (after.state, after.error, after.queued) == (State.IDLE, Error.HELD, 0)
    assert after.known == 7
    assert after.counts[1] == pytest.approx(-2 * after.counts[0], abs=2)
    # 10 kHz down at 200 kHz/s: 250 steps; a queue that holds less is a plan slower than that.
    assert 230 / brake <= abs(after.counts[1] - before.counts[1]) <= 260 / brake
    host.board.advance(1)
    assert host.status().counts == after.counts


def test_a_limit_switch_stops_within_the_ramp_however_gentle_the_motion() -> None:
    unused = AxisImage()
    image = Image((AXIS, AXIS, AXIS, unused, unused), (), (GuardImage(False, (1, 0, 0, 0, 0)), *(GuardImage(),) * 2))
    host = ready_host(lambda number, net: number != 0 or net[0] < 300, image)  # pressed is low
    assert host.move([0], [0], [whole_steps(5000, 1600, 0, (5000,))], at_rest=True, brake=0.25) == Error.OK
    host.board.advance(0.3)
    status = host.status()
    assert (status.error, status.state, status.known) == (Error.LIMIT_SWITCH, State.IDLE, 7)
    assert 500 <= status.counts[0] <= 300 + 10_000 * (0.05 / 2 + 0.006)  # u = 50 ms, 3 ms of debounce


@pytest.mark.parametrize("brake", [1.0, 0.125])
def test_a_queue_that_runs_dry_stops_in_time(brake: float) -> None:
    host = ready_host()
    assert host.move([0, 1], [0, 0], CRUISE[:5], at_rest=False, brake=brake) == Error.OK
    for _ in range(10):
        host.board.advance(0.1)
        host.status()
    status = host.status()
    assert (status.error, status.state, status.known) == (Error.DRY, State.IDLE, 7)
    assert abs(status.counts[1]) < 2500


def test_a_slow_arm_stands_where_its_queue_ends() -> None:
    host = ready_host()
    assert host.move([0, 1], [0, 0], [whole_steps(640, 8000, 0, (640, -320))], at_rest=False) == Error.OK  # u = 10 ms
    host.board.advance(0.4)
    status = host.status()
    assert (status.error, status.state, status.known) == (Error.DRY, State.IDLE, 7)
    assert status.counts[:2] == (640, -320)


def test_a_queue_that_ends_abruptly_is_lost() -> None:
    host = ready_host()
    assert host.move([0, 1], [0, 0], CRUISE[:1], at_rest=False) == Error.OK
    host.board.motors.queue.dry = lambda u, **_: False  # type: ignore[method-assign]  # a board too busy to notice in time
    host.board.advance(0.2)
    status = host.status()
    assert (status.error, status.state, status.known) == (Error.DRY, State.IDLE, 4)
    assert status.counts[:2] == (250, -500)


def test_silence_is_a_hold() -> None:
    host = ready_host()
    assert host.move([0], [0], [whole_steps(1000, 16000, 0, (100,))], at_rest=True) == Error.OK
    host.board.advance(0.4)
    assert host.status().state == State.MOVING
    host.board.advance(0.6)
    status = host.status()
    assert (status.error, status.state) == (Error.SILENCE, State.IDLE)
    assert 80 <= status.counts[0] <= 95


def test_a_reset_at_rest_is_retained_and_a_reset_in_motion_is_lost() -> None:
    host = ready_host()
    host.board.reset()
    info = host.hello()
    assert info.known == 7
    assert info.flags & Flag.RETAINED
    assert info.boots == 2
    assert host.move([0, 1], [0, 0], CRUISE, at_rest=True) == Error.OK
    host.board.advance(0.05)
    host.board.reset()
    info = host.hello()
    assert (info.known, info.config, info.flags & Flag.RETAINED) == (0, 0, 0)
    assert 200 < host.board.net[0] < 300


def test_a_power_cycle_forgets_all() -> None:
    host = ready_host()
    host.board.hidden_cause = False
    host.board.reset(power=True)
    info = host.hello()
    assert (info.known, info.config, info.boots, info.cause) == (0, 0, 1, 1)


def test_the_abort_input_stops_and_blocks() -> None:
    host = ready_host()
    assert host.move([0, 1], [0, 0], CRUISE, at_rest=True) == Error.OK
    host.board.advance(0.05)
    host.board.inputs.abort_level = False
    host.board.advance(0.4)
    assert host.status().error == Error.ABORT
    assert host.status().state == State.IDLE
    host.hello()
    counts = host.status().counts
    assert host.move([0], counts[:1], [whole_steps(10, 1600, 0, (1,))], at_rest=True) == Error.ABORT


def test_homing_finds_the_edge() -> None:
    edge = -1234

    def switch(number: int, net: Sequence[int]) -> bool:
        return not (number == 1 and net[1] <= edge)

    host = ready_host(switch)
    going = protocol.home(
        0, switch=1, closed=False, slow=32, backoff=200, travel=5000, time=100, rate=[0, -4000, 0, 0, 0]
    )
    assert host.say(going) == Error.OK
    while host.status().state == State.HOMING:
        host.board.advance(0.05)
    status, latch = host.status(), host.status(page=1)
    assert status.error == Error.OK
    assert status.flags & Flag.LATCH
    assert status.known == 5
    assert latch.counts[1] == pytest.approx(edge, abs=1)
    assert host.say(protocol.set_position(0, {1: status.counts[1] - latch.counts[1] - 5000})) == Error.OK
    assert host.status().known == 7


def test_homing_without_a_switch_ends_with_travel() -> None:
    host = ready_host()
    going = protocol.home(
        0, switch=0, closed=False, slow=32, backoff=200, travel=3000, time=100, rate=[4000, 0, 0, 0, 0]
    )
    assert host.say(going) == Error.OK
    for _ in range(20):
        host.board.advance(0.1)
        host.status()
    assert host.status().error == Error.TRAVEL
    assert host.status().state == State.IDLE
    assert 3000 <= host.status().counts[0] < 3400


def test_jogging_needs_its_handle_and_brakes_before_the_limit() -> None:
    host = ready_host()
    for _ in range(10):
        assert host.say(protocol.jog(0, [10_000, 0, 0, 0, 0])) == Error.OK
        host.board.advance(0.1)
    host.board.advance(0.6)
    status = host.status()
    assert (status.state, status.error) == (State.IDLE, Error.OK)
    assert status.counts[0] == pytest.approx(10_000 * 1.15, abs=100)
    for _ in range(20):
        host.say(protocol.jog(0, [10_000, 0, 0, 0, 0]))
        host.board.advance(0.1)
    assert 19_900 <= host.status().counts[0] <= 20_000


def test_a_lost_axis_jogs_slowly() -> None:
    host = ready_host()
    assert host.say(protocol.enable(0, 0)) == Error.OK
    assert host.say(protocol.enable(0, 1)) == Error.OK
    assert host.status().known == 0
    assert host.say(protocol.jog(0, [2500, 0, 0, 0, 0])) == Error.OK
    host.hello()
    host.board.advance(1)
    assert host.say(protocol.jog(0, [2501, 0, 0, 0, 0])) == Error.RATE


def test_a_planned_line_runs_to_its_count() -> None:
    host = ready_host()
    segments = straight_line([0, 0, 0], [-1067, -10144, 5667], 1.2, 2.0).segments
    counts, sent = [0, 0, 0], 0
    while sent < len(segments):
        free = host.status().free
        for s in list(segments)[sent : sent + free]:
            sent += 1
            assert host.move([0, 1, 2], counts, [s], at_rest=sent == len(segments)) == Error.OK
            counts = host.board.motors.queue.plan_counts()[:3]
        host.board.advance(0.01)
    while host.status().state == State.MOVING:
        host.board.advance(0.1)
    assert host.status().counts[:3] == (-1067, -10144, 5667)
    assert host.board.net[:3] == [-1067, -10144, 5667]


def test_mutated_frames_move_nothing_that_was_not_sent() -> None:
    """Frames whose checksum is right and whose content is not: start, end and steps must agree."""
    rng = random.Random(8)
    host = ready_host()
    moved = 0
    for _ in range(3000):
        base = list(host.status().counts)
        frame = bytearray(
            motion_frame.motion(
                0,
                [0, 1],
                base[:2],
                [base[0] + 10, base[1] - 5],
                [whole_steps(40, 1600, 0, (10, -5))],
                at_rest=True,
            )
        )
        for _ in range(rng.randrange(1, 4)):
            frame[rng.randrange(len(frame))] ^= 1 << rng.randrange(8)
        host.hello()
        host.board.receive(protocol.encode_frame(bytes(frame)))
        list(host.splitter.feed(host.board.take()))
        host.board.advance(0.02)
        counts = list(host.status().counts)
        if counts != base:
            moved += 1
            host.board.advance(3)
            counts = list(host.status().counts)
            # Only what leads from the true start to an end that the frame names.
            assert frame[0] == protocol.Type.MOTION
            limits = [AXIS.lower <= c <= AXIS.upper for c in counts[:3]]
            assert all(limits)
        while host.status().state != State.IDLE:
            host.board.advance(0.5)
    assert moved < 300  # a changed duration; a step, axis or count never
