"""Conformance tests for every kind of board, run on an emulator of that kind.

    @pytest.mark.parametrize("case", conformance.CASES, ids=lambda case: case.__name__)
    def test_my_kind(case): case(start)

`start` gives an `Emulated`: a board with an arm at home, and the true positions of its motors. A case raises
AssertionError if the board reports a false position, reports success for an incomplete motion, or hangs. The argument
`times` of a case is its number of repetitions, which a slow emulator may reduce.
"""

from __future__ import annotations

import itertools
import os
import random
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field

import numpy as np

from armkin.board.backend import Backend, StoppedError
from armkin.board.backend.board import Board
from armkin.board.backend.motion_start import StartError
from armkin.board.ports import Port, note_path, record_path
from armkin.errors import ArmkinError, LinkError
from armkin.formula.arrays import Array
from armkin.motors import joints

PATIENCE = 120.0  # longest delay [s] of a motion beyond its plan
_numbers = itertools.count()


@dataclass
class Emulated:
    """An emulator of a kind's board on which the arm stands at home."""

    board: Board
    port: Port
    pins: Callable[[], Sequence[float]]  # true counts of the motors
    reset: Callable[[], None] | None = None  # resets the board
    foreign: Sequence[Callable[[], None]] = ()  # actions of another program on its port
    stall: Callable[[], None] | None = None  # blocks an axis, on kinds that detect it
    tolerance: int = 0  # [counts] between true and reported position at rest
    line: Line = field(init=False)

    def __post_init__(self) -> None:
        self.line = Line(self.port)


class Line:
    """The line to an emulator, which a test can cut, or on which it can lose, double or damage bytes."""

    simulated = False  # a real port: a lost position is not assumed

    def __init__(self, port: Port) -> None:
        self._port, self.baud = port, port.baud
        self.name = f"conformance-{os.getpid()}-{next(_numbers)}"
        self.spoil: Callable[[bytes], bytes] = bytes
        self.cut = False

    def write(self, data: bytes) -> None:
        """Send bytes."""
        self._check_cable()
        self._port.write(data)

    def read(self, timeout: float) -> bytes:
        """The bytes that have arrived, or arrive within `timeout` seconds."""
        self._check_cable()
        return self.spoil(self._port.read(timeout))

    def now(self) -> float:
        """Seconds on the clock."""
        return self._port.now()

    def close(self) -> None:
        """Do nothing, as the emulator is used again."""

    def _check_cable(self) -> None:
        if self.cut:
            raise LinkError(f"port {self.name} is gone")


Start = Callable[[], Emulated]


@contextmanager
def _start_emulator(start: Start) -> Iterator[Emulated]:
    emulated = start()
    try:
        yield emulated
    finally:
        for path in (note_path(emulated.line.name), record_path(emulated.line.name)):
            with suppress(OSError):
                os.unlink(path)


def _pin_counts(emulated: Emulated) -> list[int]:
    return [round(value) for value in emulated.pins()]


def _connect_and_settle(emulated: Emulated, stop: Callable[[], bool] = lambda: False) -> Backend:
    """Connect the arm, and set the true position if the board has lost it."""
    machine = emulated.board.connect(emulated.line, stop)
    is_lost = machine.position() == "lost"
    machine.prepare(assume=joints(machine.arm, _pin_counts(emulated)) if is_lost else None)
    return machine


def _is_near(emulated: Emulated, counts: Sequence[int]) -> bool:
    return bool(np.abs(np.array(counts) - emulated.pins()).max() <= emulated.tolerance)


def _check_truth(emulated: Emulated) -> str:
    """The board's position state after a check that it is true: known, lost, or an error in words."""
    emulated.line.spoil, emulated.line.cut = bytes, False
    _wait_for_rest(emulated)
    try:
        machine = emulated.board.connect(emulated.line)
    except LinkError as error:
        return str(error)
    is_known = machine.position() != "lost"
    assert not is_known or _is_near(emulated, machine.counts()), (
        f"a false position: {machine.counts()}, pins at {_pin_counts(emulated)}"
    )
    return "known" if is_known else "lost"


def _wait_for_rest(emulated: Emulated) -> None:
    """Wait until no motor moves."""
    deadline, last_counts = emulated.line.now() + PATIENCE, list[int]()
    while last_counts != (counts := _pin_counts(emulated)) and emulated.line.now() < deadline:
        last_counts = counts
        wait_end = emulated.line.now() + 1.0
        while emulated.line.now() < wait_end:
            emulated.port.read(0.05)


def _carry_out_motion(emulated: Emulated, machine: Backend, goal: Array, speed: float = 1.0) -> bool:
    """Run a motion and check its end; False if it was refused or ended with an error."""
    start_time = emulated.line.now()
    plan = machine.plan(machine.counts(), goal, speed=speed)
    try:
        machine.run([plan])
    except (ArmkinError, StoppedError):
        has_succeeded = False
    else:
        has_succeeded = True
        assert _is_near(emulated, plan.end.tolist()), (
            f"said to be done: {plan.end.tolist()}, pins at {_pin_counts(emulated)}"
        )
    assert emulated.line.now() - start_time < plan.duration + PATIENCE, "a hang"
    return has_succeeded


def _random_goals(emulated: Emulated, seed: int, size: float = 0.15) -> Iterator[Array]:
    rng, arm = np.random.default_rng(seed), emulated.board.arm
    span = np.where(np.isfinite(arm.upper - arm.lower), arm.upper - arm.lower, 1.0)
    while True:
        yield np.clip(arm.home + rng.uniform(-size, size, arm.n) * np.minimum(span, 1.0), arm.lower, arm.upper)


def moves_are_read_back_exactly(start: Start, times: int = 200) -> None:
    """The board reports the true position of its motors after each of many moves."""
    with _start_emulator(start) as emulated:
        machine = _connect_and_settle(emulated)
        for goal in itertools.islice(_random_goals(emulated, 3), times):
            assert _carry_out_motion(emulated, machine, goal)
            assert _is_near(emulated, machine.counts())


def answers_that_are_lost_doubled_or_damaged_make_nothing_false(start: Start, times: int = 36) -> None:
    """No position is false while a share of the answers is lost, doubled or damaged in one bit."""
    variants = list(itertools.product((0.1, 0.01), ("damaged", "lost", "doubled")))
    for number, (share, kind) in enumerate(variants[:times]):
        rng = random.Random(f"{kind} {share}")

        def spoil(data: bytes, kind: str = kind, share: float = share, rng: random.Random = rng) -> bytes:
            if not data or rng.random() > share:
                return data
            position = rng.randrange(len(data))
            changed = data[:position] + bytes([data[position] ^ 1 << rng.randrange(8)]) + data[position + 1 :]
            return {"lost": b"", "doubled": data + data, "damaged": changed}[kind]

        with _start_emulator(start) as emulated:
            _connect_and_settle(emulated)
            for goal in itertools.islice(_random_goals(emulated, 5), len(range(number, times, len(variants)))):
                with suppress(ArmkinError):
                    emulated.line.spoil = spoil
                    machine = emulated.board.connect(emulated.line)
                    if machine.position() != "lost":
                        machine.prepare()
                        _carry_out_motion(emulated, machine, goal)
                if _check_truth(emulated) != "known":
                    with suppress(ArmkinError):
                        _connect_and_settle(emulated)


def _while_moving(emulated: Emulated, asks: int, act: Callable[[], object] | None) -> bool:
    """Run a motion, and call `act`, or hold it (None), at the poll number `asks` of the stop function."""
    count, moving = itertools.count(), list[bool]()

    def stop() -> bool:
        is_due = bool(moving) and next(count) >= asks
        if is_due and act is not None:
            moving.clear()
            act()
        return is_due and act is None

    machine = _connect_and_settle(emulated, stop)
    moving.append(True)
    return _carry_out_motion(emulated, machine, _distant_goal(emulated), 0.5)


def _distant_goal(emulated: Emulated) -> Array:
    """A goal far from the arm's present position."""
    present = joints(emulated.board.arm, _pin_counts(emulated))
    return max(itertools.islice(_random_goals(emulated, 7, 0.4), 20), key=lambda q: float(np.abs(q - present).max()))


def a_reset_in_a_motion_is_told(start: Start, times: int = 5) -> None:
    """After a reset during a motion the board reports no success and no false position."""
    for trial in range(times):
        with _start_emulator(start) as emulated:
            if emulated.reset is not None:
                _while_moving(emulated, 1 + 6 * trial, emulated.reset)
                _check_truth(emulated)


def another_program_makes_nothing_false(start: Start, times: int | None = None) -> None:
    """No position is false after another program has used the line before, between and during motions."""
    variants = itertools.product((8, None, 1, 25), range(len(start().foreign)))
    for asks, number in itertools.islice(variants, times):
        with _start_emulator(start) as emulated:
            act = emulated.foreign[number]
            if asks is None:
                act()
                _check_truth(emulated)
                with suppress(ArmkinError):
                    _carry_out_motion(emulated, _connect_and_settle(emulated), next(_random_goals(emulated, 1)))
                act()
            else:
                with suppress(ArmkinError):
                    _while_moving(emulated, asks, act)
            _check_truth(emulated)


def a_cable_that_is_pulled_makes_nothing_false(start: Start, times: int = 20) -> None:
    """After a cable was pulled at any moment of a motion the next program reports a true position or a lost one."""

    with _start_emulator(start) as emulated:

        def pull() -> None:
            emulated.line.cut = True

        for trial in range(times):
            with suppress(ArmkinError):
                assert not _while_moving(emulated, 2 * trial, pull) or not emulated.line.cut
            _check_truth(emulated)


def a_stalled_axis_is_told(start: Start, times: int = 3) -> None:
    """Kinds that detect a stall report no success for a motion in which an axis stalls."""
    for trial in range(times):
        with _start_emulator(start) as emulated:
            if emulated.stall is not None:
                assert not _while_moving(emulated, 1 + 6 * trial, emulated.stall)
                _check_truth(emulated)


def a_hold_keeps_the_position_and_the_next_motion_goes_on(start: Start, times: int = 20) -> None:
    """The position is kept after a hold at any place of a motion, and the next motion starts from there."""
    with _start_emulator(start) as emulated:
        for trial in range(times):
            _while_moving(emulated, 1 + 3 * trial, None)
            assert _check_truth(emulated) == "known", "a hold has lost the position"
            assert _carry_out_motion(emulated, _connect_and_settle(emulated), _distant_goal(emulated))


def a_plan_that_begins_elsewhere_moves_nothing(start: Start, times: int = 1) -> None:
    """A plan that begins at other counts raises StartError and moves nothing."""
    with _start_emulator(start) as emulated:
        machine = _connect_and_settle(emulated)
        start_counts, first_plan = _pin_counts(emulated), machine.plan(machine.counts(), _distant_goal(emulated))
        plan = machine.plan(first_plan.end.tolist(), machine.arm.home)
        try:
            machine.run([plan])
        except StartError:
            pass
        else:
            raise AssertionError("a plan that begins elsewhere was carried out")
        _wait_for_rest(emulated)
        assert np.abs(np.array(start_counts) - emulated.pins()).max() <= emulated.tolerance


CASES: tuple[Callable[..., None], ...] = (
    moves_are_read_back_exactly,
    answers_that_are_lost_doubled_or_damaged_make_nothing_false,
    a_reset_in_a_motion_is_told,
    another_program_makes_nothing_false,
    a_cable_that_is_pulled_makes_nothing_false,
    a_stalled_axis_is_told,
    a_hold_keeps_the_position_and_the_next_motion_goes_on,
    a_plan_that_begins_elsewhere_moves_nothing,
)
