"""The conversation with GRBL: answers in order, a full buffer, refusals, alarms, resets, settings."""

from __future__ import annotations

import random

import pytest

from armkin.board.grbl import replies, settings
from armkin.board.grbl.grbl_session import GrblError, Session
from armkin.board.grbl.settings import Axis
from armkin.board.sim.sim_grbl import Grbl
from armkin.errors import LinkError

QUICK = {110 + k: 6000.0 for k in range(4)} | {120 + k: 1000.0 for k in range(4)}
AXES = [Axis("X", "q1", 35.556, False, 60, 120), Axis("Z", "q3", 66.667, True, 60, 120)]


def open_session(board: Grbl) -> Session:
    session = Session(board)
    session.open()
    return session


def never_stop() -> bool:
    return False


def test_lines_arrive_at_their_steps_and_the_buffer_never_overflows() -> None:
    board = Grbl(axes=4, settings=QUICK)
    session = open_session(board)
    rng = random.Random(1)
    targets = [[rng.randrange(-9000, 9000) / 250 for _ in range(4)] for _ in range(60)]
    work = [f"G53G1{''.join(f'{letter}{v:.5f}' for letter, v in zip('XYZA', t, strict=True))}F6000" for t in targets]
    assert session.stream([*work, "G4P0"], never_stop)
    assert board.steps == [round(250 * value) for value in targets[-1]]
    assert session.status().position == tuple(round(value, 3) for value in targets[-1])


def test_a_hold_stands_on_the_line_and_a_reset_there_keeps_the_position() -> None:
    board = Grbl(axes=2, settings=QUICK)
    session = open_session(board)
    polls = iter(range(1000))
    assert not session.stream(["G53G1X40Y20F6000", "G4P0"], lambda: next(polls) > 20)
    session.realtime(replies.HOLD)
    while session.status().detail or session.status().state != "Hold":
        board.advance(0.01)
    x, y = board.steps
    assert 0 < x < 10_000
    assert abs(2 * y - x) <= 2
    session.reset()
    assert session.status().state == "Idle"
    assert board.steps == [x, y]


def test_a_hold_that_nobody_asked_for_ends_in_words() -> None:
    """A byte damaged into `!` holds GRBL, which then reports Hold ten times a second: it was waited for without end."""
    board = Grbl(axes=2, settings=QUICK)
    session = open_session(board)
    ticks = iter(range(10_000))  # the old host took them all

    def tick() -> bool:
        if next(ticks) == 3:
            board.write(b"!")
        return False

    with pytest.raises(LinkError, match=r"in state Hold, has left .* bytes without an answer"):
        session.stream([f"G53G1X{k}F600" for k in range(1, 40)], tick)
    assert board.now() < 30


def test_a_reset_in_motion_is_an_alarm() -> None:
    board = Grbl(axes=2, settings=QUICK)
    session = open_session(board)
    polls = iter(range(1000))
    session.stream(["G53G1X40Y20F6000"], lambda: next(polls) > 20)
    session.realtime(b"G4P1\n")
    with pytest.raises(GrblError, match="reset in motion") as caught:
        session.reset()
    assert caught.value.alarm in replies.LOSES_POSITION
    with pytest.raises(GrblError, match="locked by an alarm"):
        session.ask("G53G1X0F100")


@pytest.mark.parametrize(
    ("line", "number"), [("$77=1", 3), ("G53G1X1", 22), ("G53G1X1..2F5", 1), ("G53G1XF5", 2), ("$H", 5)]
)
def test_what_grbl_refuses_is_told_with_its_line(line: str, number: int) -> None:
    with pytest.raises(GrblError, match=rf"GRBL refused '{line.replace('$', '.')}'.*error {number}\)"):
        open_session(Grbl()).ask(line)


def test_a_port_without_grbl_is_named() -> None:
    board = Grbl(name="/dev/ttyX")
    board.dead = True
    with pytest.raises(LinkError, match="/dev/ttyX does not answer as GRBL does"):
        open_session(board)


def test_errors_that_nobody_asked_for_keep_no_board_from_answering() -> None:
    """A new grblHAL board says error:7 of its empty memory; another program may have left a line to be refused."""
    board = Grbl(hal=True)
    board._send("error:7")
    board.write(b"G999\n")
    assert open_session(board).hal


def test_a_cable_that_is_pulled_is_told() -> None:
    board = Grbl()
    session = open_session(board)
    board.dead = True
    with pytest.raises(LinkError, match="does not answer any more"):
        session.status()
    with pytest.raises(LinkError, match=r"did not answer '\$\$' within"):
        session.ask("$$")


def test_settings_are_compared_and_only_what_is_wrong_is_serious() -> None:
    board = Grbl(axes=4)
    session = open_session(board)
    actual = dict(pair for line in session.ask("$$") if (pair := replies.parse_setting(line)))
    odd = {difference.number: difference.serious for difference in settings.differences(AXES, actual)}
    assert odd == {1: False, 3: True, 100: True, 102: True, 110: False, 112: False, 120: False, 122: False}
    for number, (_, value) in settings.expected_settings(AXES).items():
        session.ask(f"${number}={value:g}")
    actual = dict(pair for line in session.ask("$$") if (pair := replies.parse_setting(line)))
    assert settings.differences(AXES, actual) == []
    assert actual[101] == 250  # another axis is left alone
    too_fast = settings.differences(AXES, actual | {110: 9000.0})
    assert [(d.number, d.serious) for d in too_fast] == [(110, True)]
    assert str(too_fast[0]) == "$110 (q1: greatest speed, units/min) is 9000: the robot file wants $110=3600"


DAMAGED = ["<Idle|MPos:1,x,3>", "<>", "Idle", "<Run|MPos:", "<Hold:x|MPos:0>", "<Idle|Bf:3>"]
NO_NUMBERS = ["nan", "inf", "-inf", "1e400", "1_0", "9" * 400, "\u0663", "", " 1", "+1"]


@pytest.mark.parametrize("text", [*DAMAGED, *(f"<Idle|MPos:0.000,{text},0.000>" for text in NO_NUMBERS)])
def test_damaged_reports_are_no_reports(text: str) -> None:
    report = replies.parse_report(text)
    assert report is None or report.position is None


@pytest.mark.parametrize("text", NO_NUMBERS)
def test_what_grbl_never_prints_is_no_number(text: str) -> None:
    assert replies.parse_setting(f"$100={text}") is None
    assert replies.parse_offset(f"[G92:0.000,{text},0.000]") is None
    assert replies.parse_spindle(f"[GC:G0 M3 S{text}]") is None


def test_any_bytes_end_in_an_answer_or_an_error() -> None:
    rng = random.Random(7)

    class Noise:
        name, simulated, baud = "noise", False, 115_200
        clock = 0.0

        def write(self, data: bytes) -> None:
            """Nobody listens."""

        def read(self, timeout: float) -> bytes:
            """Random bytes, with line ends and pieces of answers among them."""
            self.clock += 0.002
            pieces = [b"ok\r\n", b"error:9\n", b"ALARM:1\n", b"<Idle|MPos:0>\n", b"Grbl 1.1h\n", rng.randbytes(40)]
            return rng.choice(pieces)

        def now(self) -> float:
            """Seconds."""
            return self.clock

        def close(self) -> None:
            """Nothing to close."""

    for _ in range(200):
        session = Session(Noise())
        try:
            session.open()
            session.stream(["G1X1F1"] * 5, never_stop)
            session.status()
        except LinkError:
            pass
