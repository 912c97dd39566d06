"""Other programs on GRBL: whatever they write, a position is true or lost, and no line of theirs is ended by us."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterator

import numpy as np
import pytest

import armkin
from armkin.board.backend import StoppedError
from armkin.board.grbl.grbl_machine import GrblMachine
from armkin.board.grbl.motor_axes import axes_of
from armkin.board.grbl.settings import expected_settings
from armkin.board.ports import record_path
from armkin.board.sim.sim_grbl import Grbl
from armkin.errors import LinkError, PositionLostError

ARM = armkin.load("three_dof")
FITS = {number: value for number, (_, value) in expected_settings(axes_of(ARM)).items()}
GOAL = np.deg2rad([10, 80, -70])
_numbers = itertools.count()


@pytest.fixture(params=[False, True], ids=["grbl", "grblHAL"])
def port(request: pytest.FixtureRequest) -> Iterator[Grbl]:
    """A board whose port has a name of its own, so that its record is."""
    hal = bool(request.param)
    grbl = Grbl(4, f"foreign-{os.getpid()}-{next(_numbers)}", FITS | ({384: 1} if hal else {}), hal=hal)
    grbl.simulated = False
    grbl.step = 0.01
    yield grbl
    if os.path.exists(record_path(grbl.name)):
        os.unlink(record_path(grbl.name))


def connect_grbl(port: Grbl, stop: Callable[[], bool] = lambda: False) -> GrblMachine:
    return GrblMachine(port, ARM, stop)


def stands_elsewhere(port: Grbl) -> GrblMachine:
    """An arm that was told where it stands, and was moved from there."""
    machine = connect_grbl(port)
    machine.prepare(assume=ARM.home)
    machine.run([machine.plan(machine.counts(), GOAL)])
    return machine


def speak_as_other_program(port: Grbl, *lines: str) -> None:
    """Another program speaks, and waits until all is done."""
    for line in lines:
        port.write(line.encode() + b"\n")
        for _ in range(4000):
            port.advance(0.005)
            if not port._blocks and not port._rx and port._whole is None:
                break
    port.close()


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (["G92 X0 Y0 Z0"], "G92 is"),
        (["G92.1"], "G92 is 0 0 0, and armkin left 1"),
        (["G10 L20 P1 X0"], "G54 is"),
        (["G10 L2 P1 X10 Y10 Z10"], "G54 is 10 10 10, and armkin left 0 0 0"),
        (["G10 L2 P2 X5", "G55"], "G55 is 5 0 0, and armkin left 0 0 0"),
        (["G55"], "system is G55, and armkin left G54"),
        (["G43.1 Z7"], "TLO is"),
        (["G91", "G0 X3"], r"it stands at \[.*\] steps, and armkin left it at \["),
        (["$J=G91X3F600"], "another program has moved it"),
    ],
)
def test_what_another_program_sets_between_two_commands_is_lost_in_words(
    port: Grbl, lines: list[str], says: str
) -> None:
    stands_elsewhere(port)
    before = list(port.steps)
    speak_as_other_program(port, *lines)
    after = list(port.steps)
    again = connect_grbl(port)
    assert again.position() == "lost"
    with pytest.raises(PositionLostError, match=says):
        again.prepare()
    assert port.steps == after
    assert (after != before) == any("X3" in line for line in lines)


def test_offsets_that_somebody_set_long_ago_are_recorded_as_found(port: Grbl) -> None:
    speak_as_other_program(port, "G10 L2 P1 X10 Y-20 Z30", "G10 L2 P3 X1 Y1 Z1", "G43.1 Z5", "G91", "G20", "G55")
    machine = stands_elsewhere(port)
    for _ in range(2):
        assert (machine.position(), list(machine.counts())) == ("known", port.steps[:3])
        assert port.steps[:3] == armkin.pulses(ARM, GOAL).tolist()
        machine = connect_grbl(port)


@pytest.mark.parametrize("line", ["G20", "G91", "G93", "G18", "G21G1F5", "G0", "G80"])
def test_modes_that_another_program_left_change_no_motion(port: Grbl, line: str) -> None:
    machine = stands_elsewhere(port)
    speak_as_other_program(port, line)
    again = connect_grbl(port)
    assert again.position() == "known"
    again.prepare()
    plan, began = again.plan(again.counts(), np.deg2rad([22, 80, -70])), port.now()
    again.run([plan])
    assert port.steps[:3] == plan.end.tolist() == list(again.counts())
    assert port.now() - began < plan.duration + 2.0
    assert machine.counts() != again.counts()


def test_feeds_that_another_program_overrides_are_as_planned_again(port: Grbl) -> None:
    machine = stands_elsewhere(port)
    port.write(b"\x91" * 5)
    port.advance(0.1)
    assert port.override == 150
    machine.run([machine.plan(machine.counts(), np.deg2rad([40, 80, -70]), speed=0.2)])
    assert port.override == 100

    def faster() -> bool:
        if port.steps[0] > 600:
            port.write(b"\x91")
        return False

    two = connect_grbl(port, faster)
    with pytest.raises(LinkError, match=r"another program has set feeds to 1?\d\d0? %; the arm was stopped"):
        two.run([two.plan(two.counts(), np.deg2rad([0, 80, -70]), speed=0.2)])
    assert list(two.counts()) == port.steps[:3]


OPEN = ["G1X5F500", "G1X5", "g0 x-4", "$J=G91X5F500", "$H", "$100=77", "$N0=G20", "G92X0", "$", "G10L2P1X1"]


def test_a_line_that_another_program_left_open_is_never_ended(port: Grbl) -> None:
    machine = stands_elsewhere(port)
    before, settings = list(port.steps), dict(port.settings)
    speak_as_other_program(port, "F600")
    for line, end in itertools.product(OPEN, ["", " ", "(", "(half a comment"]):
        port.write((line + end).encode())
        port.advance(0.1)
        again = GrblMachine(port, ARM)
        for _ in range(20):
            port.advance(0.02)
        assert (port.steps, port.settings) == (before, settings)
        assert (again.position(), again.counts()) == ("known", machine.counts())


def test_a_line_that_was_left_open_in_a_comment_without_an_end_is_stopped_and_told(port: Grbl) -> None:
    """GRBL alone: such a comment ends with its line; grblHAL drops the line."""
    stands_elsewhere(port)
    port.write(b"G1 X40 F600 ; to the other side")
    port.advance(0.2)
    before = port.steps[0]
    if port.hal:
        assert connect_grbl(port).position() == "known"
    else:
        with pytest.raises(LinkError, match="another program had left a line open"):
            connect_grbl(port)
        assert connect_grbl(port).position() == "lost"
    assert abs(port.steps[0] - before) < 60


def test_another_program_s_motion_is_told_and_left_alone(port: Grbl) -> None:
    stands_elsewhere(port)
    port.write(b"G91G1X20F300\n")
    port.advance(0.5)
    with pytest.raises(LinkError, match="another program drives it"):
        connect_grbl(port)
    speak_as_other_program(port, "")
    assert port.steps[0] == armkin.pulses(ARM, GOAL)[0] + round(20 * FITS[100])


@pytest.mark.parametrize("asks", [5, 20, 45])
@pytest.mark.parametrize("line", ["G91G1X9F900", "G0 X10 Y10 Z10", "G20", "$J=G91X9F900"])
def test_a_line_that_another_program_feeds_into_a_motion_is_told_or_harmless(port: Grbl, line: str, asks: int) -> None:
    count = itertools.count()

    def stop() -> bool:
        if next(count) == asks:
            port.write(line.encode() + b"\n")
        return False

    stands_elsewhere(port)
    machine = connect_grbl(port, stop)
    path = armkin.path(
        ARM,
        {"start": {"joints": [10, 80, -70]}, "blend": 8, "moves": [{"joint": [40, 60, -50]}, {"joint": [0, 90, -90]}]},
    )
    plan = machine.plan_trajectory(path.motion, np.array(machine.counts()))
    message = "another program"
    try:
        machine.run([plan])
    except LinkError as error:
        message = str(error)
    assert "another program" in message
    assert port.steps[:3] == plan.end.tolist() or machine.position() == "lost" or message != "another program"
    for _ in range(300):
        port.advance(0.02)
    assert machine.position() == "lost" or list(machine.counts()) == port.steps[:3]


@pytest.mark.parametrize("line", ["G92X0Y0Z0", "G10L2P1X10Y10Z10", "G55", "G43.1Z7"])
def test_an_offset_that_is_set_in_a_motion_is_found_at_its_end_and_at_its_stop(port: Grbl, line: str) -> None:
    for stopped in (False, True):
        machine = stands_elsewhere(port)
        count, origin = itertools.count(), np.array(port.steps[:3]) - machine.counts()

        def stop(count: Iterator[int] = count, stopped: bool = stopped) -> bool:
            poll = next(count)
            if poll == 20:
                port.write(line.encode() + b"\n")
            return stopped and poll > 40

        two = connect_grbl(port, stop)
        with pytest.raises((LinkError, StoppedError)):
            two.run([two.plan(two.counts(), np.deg2rad([30, 60, -60]), speed=0.5)])
        again = connect_grbl(port)
        assert again.position() == "lost" or (origin + again.counts()).tolist() == port.steps[:3]
        port.boot()
        speak_as_other_program(port, "G10L2P1X0Y0Z0", "G54", "G49", "G92.1")


def test_a_reset_in_the_motion_of_a_killed_sender_is_lost(port: Grbl) -> None:
    """grblHAL keeps G92 over a soft reset, and the motors have lost steps: the parser's modes tell."""

    class Killed(BaseException):
        pass

    count = itertools.count()

    def die() -> bool:
        if next(count) == 40:
            raise Killed
        return False

    stands_elsewhere(port)
    machine = connect_grbl(port, die)
    with pytest.raises(Killed):
        machine.run([machine.plan(machine.counts(), np.deg2rad([60, 20, -60]), speed=0.3)])
    port.write(b"\x18")
    speak_as_other_program(port, "$X")
    assert connect_grbl(port).position() == "lost"


def test_no_record_a_damaged_one_or_another_arm_s_is_lost(port: Grbl) -> None:
    stands_elsewhere(port)
    path = record_path(port.name)
    with open(path, encoding="ascii") as file:
        text = file.read()
    for wrong in ("", "{}", text[:-9], text.replace('"offset": [', '"offset": ["x", '), "[" * 100_000, "null"):
        with open(path, "w", encoding="ascii") as file:
            file.write(wrong)
        assert connect_grbl(port).position() == "lost"
    os.unlink(path)
    with pytest.raises(PositionLostError, match="nobody has told armkin on this computer where it stands"):
        connect_grbl(port).prepare()
    with open(path, "w", encoding="ascii") as file:
        file.write(text)
    assert connect_grbl(port).position() == "known"
    from dataclasses import replace

    other_arm = replace(ARM, home=ARM.home + 0.1)
    with pytest.raises(PositionLostError, match="the robot file's drives or home pose are others"):
        GrblMachine(port, other_arm).prepare()


def test_more_than_a_turn_outside_a_limit_is_lost(port: Grbl) -> None:
    machine = connect_grbl(port)
    machine.vouch([round(steps * FITS[100 + k]) for k, steps in enumerate((0, 1000, 0))])
    with pytest.raises(PositionLostError, match=r"q2 = 1090.* is outside -20 to 120 deg by more than a whole turn"):
        connect_grbl(port).prepare()


def test_grblhal_forgets_g92_with_its_power_or_moves_nothing() -> None:
    port = Grbl(4, f"foreign-hal-{os.getpid()}", FITS, hal=True)
    port.simulated = False
    port.settings |= {1: 25.0, 3: 8.0, 10: 511.0, 22: 9.0}
    machine = connect_grbl(port)
    with pytest.raises(LinkError, match=r"\$384 .* is 0: the robot file wants \$384=1"):
        machine.prepare(assume=ARM.home)
    assert {difference.number for difference in machine.setup()} >= {1, 384}
    assert (port.settings[1], port.settings[384]) == (255, 1)
    assert (port.settings[3], port.settings[10], port.settings[22]) == (8, 511, 9)  # bits that are not armkin's
    assert machine.prepare(assume=ARM.home)
    port.boot()
    assert connect_grbl(port).position() == "lost"
    os.unlink(record_path(port.name)) if os.path.exists(record_path(port.name)) else None
