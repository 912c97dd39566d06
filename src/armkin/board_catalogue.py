"""The boards that armkin knows before one is connected: data of each board and driver, and which kinds are installed.

A new board for our firmware is a row of BOARDS; a new kind, with somebody else's firmware, is a file in `board/kinds/`
with KIND, a `ForeignBoard`, and BOARD, its class (`armkin.board.backend.board`), and is found by its name.
CONTRIBUTING.md has the walk. Another package offers a kind as an entry point of the group `armkin.boards`, looked up
when a file names a kind that armkin has not. The pin maps are the firmware's (`firmware/src/boards/`); a test holds
the two tables together.
"""

from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pkgutil import iter_modules
from typing import Any, NamedTuple

GROUP = "armkin.boards"  # name of the entry points that other packages' boards stand in
_KINDS = "armkin.board.kinds"  # package of the kinds, above this room: found by name, as other packages are
_FIRMWARE = "firmware"  # module of all of BOARDS


class Board(NamedTuple):
    """A board that the firmware supports."""

    kind: str  # as `board: {kind: ...}` in a robot file
    number: int  # as INFO says it
    steppers: tuple[str, ...]  # names of its stepper axes, in the protocol's order
    servos: tuple[str, ...]  # names of its servo axes, which follow
    switches: tuple[str, ...]  # names of its limit inputs
    queue: int  # segments
    frame: int  # [bytes] payload + CRC
    min_interval: int  # [cycles] between ticks
    clock: int = 16_000_000  # [1/s]
    receive: int = 127  # [bytes] that may follow a frame without an answer
    power: str = "A1"  # input that senses the motors' power
    chip: str = "atmega328p"

    @property
    def axes(self) -> tuple[str, ...]:
        """All axes, in the protocol's order."""
        return self.steppers + self.servos

    @property
    def servo_mask(self) -> int:
        """Bit i: axis i is a servo."""
        return ((1 << len(self.servos)) - 1) << len(self.steppers)

    @property
    def rows(self) -> int:
        """Joint-limit rows that its configuration may have."""
        return len(self.steppers) or len(self.axes) // 2


BOARDS = {
    board.kind: board
    for board in (
        Board(
            kind="uno_cnc_shield",
            number=1,
            steppers=("X", "Y", "Z", "A"),
            servos=("S0",),
            switches=("X", "Y", "Z"),
            queue=32,
            frame=152,
            min_interval=400,
            receive=167,
        ),
        Board(
            kind="mega_ramps14",
            number=2,
            steppers=("X", "Y", "Z", "E0", "E1"),
            servos=("S0", "S1", "S2", "S3"),
            switches=("X_MIN", "X_MAX", "Y_MIN", "Y_MAX", "Z_MIN", "Z_MAX"),
            queue=128,
            frame=240,
            min_interval=576,
            receive=255,
            power="A4",
            chip="atmega2560",
        ),
        Board(
            kind="uno_servos",
            number=3,
            steppers=(),
            servos=("S0", "S1", "S2", "S3", "S4", "S5"),
            switches=(),
            queue=32,
            frame=120,
            min_interval=1600,
        ),
        Board(
            kind="pico6",
            number=4,
            steppers=("X", "Y", "Z", "A", "B", "C"),
            servos=("S0", "S1"),
            switches=("X", "Y", "Z", "A", "B", "C"),
            queue=128,
            frame=250,
            min_interval=100,
            clock=25_000_000,
            receive=2047,
            power="GP27",
            chip="rp2040",
        ),
    )
}


def board_name(number: int) -> str:
    """A board that says its number, in words.

    >>> board_name(3), board_name(9)
    ('uno_servos', 'a board unknown to this armkin (number 9)')
    """
    kind = next((board.kind for board in BOARDS.values() if board.number == number), None)
    return f"a board unknown to this armkin (number {number})" if kind is None else kind


class ForeignBoard(NamedTuple):
    """A board with somebody else's firmware, or a bus of servos."""

    kind: str
    motors: str  # the kind of drive that it takes: stepper or bus
    gripper: str  # the kind of drive of a gripper that it moves: spindle or bus; none
    axes: tuple[str, ...]  # names of its axes; a bus goes by ids


class Driver(NamedTuple):
    """What a stepper driver's data sheet asks for; times in 0.1 us, `wake` in ms."""

    step_high: int
    step_low: int
    dir_setup: int
    wake: int


DRIVERS = {
    "A4988": Driver(10, 10, 2, 1),
    "DRV8825": Driver(19, 19, 7, 2),
    "TMC2208": Driver(1, 1, 1, 1),
    "TMC2209": Driver(1, 1, 1, 1),
}


@cache
def own_kinds() -> tuple[str, ...]:
    """Names of armkin's own kinds, as in a robot file: firmware's boards, then others."""
    folder = import_module(_KINDS).__path__
    return (*BOARDS, *sorted(name for _, name, _ in iter_modules(folder) if name != _FIRMWARE))


@cache
def _entry_points() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP) if point.name not in own_kinds()}


def kind_names() -> tuple[str, ...]:
    """Names of all kinds that are installed."""
    return (*own_kinds(), *sorted(_entry_points()))


def kind_exists(kind: str) -> bool:
    """Whether a kind is installed; other packages are asked only for what armkin has not."""
    return kind in own_kinds() or kind in _entry_points()


def kind_module(kind: str) -> Any:
    """The module of a kind with other firmware; `firmware`: of armkin's own."""
    ours = kind == _FIRMWARE or kind in own_kinds()
    return import_module(f"{_KINDS}.{kind}") if ours else _entry_points()[kind].load()


def foreign_board(kind: str) -> ForeignBoard | None:
    """The data of a kind with other firmware; None for armkin's own, and for what is not installed."""
    if kind in BOARDS or not kind_exists(kind):
        return None
    kind_data: ForeignBoard = kind_module(kind).KIND
    return kind_data
