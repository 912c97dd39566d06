"""A stand-in for Klipper behind its API server, in simulated time, written from Klipper's public documentation.

It keeps what armkin relies on: requests and answers (API_Server.md), MANUAL_STEPPER with its axes, limits and places
(G-Codes.md), status fields (Status_Reference.md), a queue that is one second long. Moves go on at their feed, without
ramps; LIMIT_VELOCITY slows them down, and a jump of speed beyond INSTANTANEOUS_CORNER_VELOCITY is counted.
"""

import json
import math
import re
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from armkin.board.sim.clock import SimulatedTime

END = b"\x03"  # byte that ends a message
QUEUE_TIME = 1.0  # motion [s] that the queue holds


class Refused(Exception):  # noqa: N818
    """A command that Klipper answers with an error."""


@dataclass
class Stepper:
    """A manual stepper."""

    place: float = 0.0  # place as commanded
    enabled: bool = False
    letter: str = ""  # letter of the G-code axis that it is
    velocity: float = math.inf
    corner: float = 1.0


@dataclass
class Move:
    """A move of X and extra axes, by their names; X stands under its own letter."""

    start: dict[str, float]
    end: dict[str, float]
    seconds: float
    seconds_done: float = 0.0


@dataclass
class Klipper(SimulatedTime):
    """The port of a simulated Klipper."""

    settings: Mapping[str, Mapping[str, Any]]  # settings in printer.cfg: section -> option -> value
    name: str = "sim"
    baud: int = 0

    def __post_init__(self) -> None:
        super().__init__()
        self._heard = b""
        self.dead = False  # unplugged
        self.restart()

    def restart(self) -> None:
        """FIRMWARE_RESTART: axes, places and the queue are gone."""
        names = [name.partition(" ")[2] for name in self.settings if name.startswith("manual_stepper ")]
        self.steppers = {name: Stepper() for name in names}
        self.axes: list[str] = []  # names of steppers that are G-code axes, in their order
        self.state = "ready"
        self.at = {"X": 0.0, **dict.fromkeys(names, 0.0)}  # where the motors are
        self.x, self.x_base = 0.0, 0.0
        self.feed, self.factor, self.relative = 1500.0, 1.0, False
        self.jumps = 0  # changes of speed beyond the corner's
        self._speeds: dict[str, float] = {}
        self._moves = deque[Move]()
        self._requests = deque[dict[str, Any]]()
        self._lines: deque[str] | None = None  # lines of the script that is run

    # The port

    def write(self, data: bytes) -> None:
        """Send bytes."""
        self._heard += b"" if self.dead else data
        *messages, self._heard = self._heard.split(END)
        for part in messages:
            with suppress(ValueError):  # Klipper logs what is no request, and goes on
                self._requests.append(json.loads(part))

    def read(self, timeout: float) -> bytes:
        """What Klipper has said, requests that wait for no time answered first."""
        self.advance(0.0)
        return super().read(timeout)

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        self._now += seconds
        if self.dead:
            return
        self._run_moves(seconds)
        while self._requests and self._serve(self._requests[0]):
            self._requests.popleft()

    def shutdown(self) -> None:
        """An MCU error: all motion ends at once."""
        self.state = "shutdown"
        self._moves.clear()

    # Requests

    def _serve(self, request: dict[str, Any]) -> bool:
        """Answer a request; False while it has to wait."""
        methods = {"gcode/script": self._run_script, "objects/query": self._query_objects, "info": self._info_json}
        try:
            if request["method"] not in methods:
                raise Refused("webhooks: No registered callback")
            answer = methods[request["method"]](request.get("params", {}))
        except Refused as error:
            self._lines = None
            self._send({"id": request["id"], "error": {"error": "CommandError", "message": str(error)}})
            return True
        if answer is None:
            return False
        self._send({"id": request["id"], "result": answer})
        return True

    def _run_script(self, params: dict[str, Any]) -> dict[str, Any] | None:
        """Run a script as far as its lines have room; None while one has to wait."""
        if self._lines is None:
            self._lines = deque(params["script"].splitlines())
        while self._lines:
            if self.state != "ready":
                raise Refused("Printer is shutdown" if self.state == "shutdown" else "Printer is not ready")
            if not self._has_room(self._lines[0]):
                return None
            self._obey(self._lines.popleft())
        self._lines = None
        return {}

    def _query_objects(self, params: dict[str, Any]) -> dict[str, Any]:
        status = self._status_json()
        return {"eventtime": self._now, "status": {name: status.get(name, {}) for name in params["objects"]}}

    def _info_json(self, params: dict[str, Any]) -> dict[str, Any]:
        return {"state": self.state, "state_message": f"Printer is {self.state}", "software_version": "sim"}

    def _send(self, message: dict[str, Any]) -> None:
        self._out += json.dumps(message).encode() + END

    def _status_json(self) -> dict[str, Any]:
        """The objects that Klipper's API tells the state of."""
        letters = {self.steppers[name].letter: 4 + k for k, name in enumerate(self.axes)}
        return {
            "webhooks": {"state": self.state, "state_message": f"Printer is {self.state}"},
            "configfile": {"settings": self.settings},
            "toolhead": {"position": [self.x, 0.0, 0.0, 0.0, *(self.steppers[name].place for name in self.axes)]},
            "gcode_move": {"axis_map": {"X": 0, "Y": 1, "Z": 2, "E": 3, **letters}},
            "stepper_enable": {
                "steppers": {f"manual_stepper {n}": stepper.enabled for n, stepper in self.steppers.items()}
            },
        }

    # G-code

    def _has_room(self, line: str) -> bool:
        """Whether a line can be run now: M400 waits for the queue, a move for room in it."""
        if line.startswith(("M400", "MANUAL_STEPPER", "M84")):
            return not self._moves
        return sum(move.seconds - move.seconds_done for move in self._moves) <= QUEUE_TIME

    def _obey(self, line: str) -> None:
        head, *words = line.split()
        if head not in _COMMANDS:
            raise Refused(f'Unknown command:"{head}"')
        _COMMANDS[head](self, words)

    def _manual_stepper(self, words: list[str]) -> None:
        options = {key: value for key, _, value in (word.partition("=") for word in words)}
        name = options.get("STEPPER", "")
        if name not in self.steppers:
            raise Refused(f"The value '{options.get('STEPPER')}' is not valid for STEPPER")
        stepper = self.steppers[name]
        if "GCODE_AXIS" in options:
            self._register_axis(name, options)
            return
        if stepper.letter:
            raise Refused("Must unregister from gcode axis first")
        if "ENABLE" in options:
            stepper.enabled = options["ENABLE"] == "1"
        if "SET_POSITION" in options:
            stepper.place = self.at[name] = float(options["SET_POSITION"])

    def _register_axis(self, name: str, options: dict[str, str]) -> None:
        """A stepper as a G-code axis by its letter; without a letter: no longer."""
        letter, stepper = options["GCODE_AXIS"], self.steppers[name]
        if not letter:
            self.axes = [axis for axis in self.axes if axis != name]
            stepper.letter = ""
            return
        if stepper.letter:
            raise Refused("Must unregister axis first")
        if not re.fullmatch("[A-Z]", letter) or letter in "XYZEFN":
            raise Refused("Not a valid GCODE_AXIS")
        if letter in (self.steppers[axis].letter for axis in self.axes):
            raise Refused(f"Axis '{letter}' already registered")
        stepper.letter = letter
        stepper.velocity = float(options.get("LIMIT_VELOCITY", 999_999.9))
        stepper.corner = float(options.get("INSTANTANEOUS_CORNER_VELOCITY", 1.0))
        self.axes.append(name)

    def _zero_x(self, words: list[str]) -> None:
        if words != ["X0"]:
            raise Refused(f"the stand-in knows no {' '.join(['G92', *words])}")
        self.x_base = self.x

    def _motors_off(self, words: list[str]) -> None:
        for stepper in self.steppers.values():
            stepper.enabled = False

    def _use_absolute(self, words: list[str]) -> None:
        self.relative = False

    def _use_relative(self, words: list[str]) -> None:
        self.relative = True

    def _scale_feed(self, words: list[str]) -> None:
        self.factor = float(words[0][1:]) / 100

    def _carry_out_gcode(self, words: list[str]) -> None:
        self._move({word[0]: float(word[1:]) for word in words})

    def _wait(self, words: list[str]) -> None:
        """M400 is run when the queue is empty: see `_has_room`."""

    def _move(self, words: dict[str, float]) -> None:
        """Plan a G1 of these words within the steppers' velocities, and count jumps of speed at its start."""
        self.feed = words.pop("F") * self.factor if "F" in words else self.feed
        start = {"X": self.x, **{name: self.steppers[name].place for name in self.axes}}
        end = self._end_places(start, words)
        change = {key: end[key] - start[key] for key in end}
        length = abs(change["X"]) or max(map(abs, change.values()))
        if length < 1e-9:
            return
        allowed = (self.steppers[name].velocity * length / abs(change[name]) for name in self.axes if change[name])
        seconds = length / min([self.feed / 60, *allowed])
        speeds = {name: change[name] / seconds for name in self.axes}
        if change["X"] and self._moves:
            changes = {motor: abs(speed - self._speeds.get(motor, 0.0)) for motor, speed in speeds.items()}
            self.jumps += sum(change > self.steppers[motor].corner for motor, change in changes.items())
        self._speeds = speeds if change["X"] else {}
        self._moves.append(Move(start, end, seconds))
        self.x = end["X"]
        for name in self.axes:
            self.steppers[name].place = end[name]
            self.steppers[name].enabled = True

    def _end_places(self, start: dict[str, float], words: dict[str, float]) -> dict[str, float]:
        """The places behind a line, by axis."""
        letters = {self.steppers[name].letter: name for name in self.axes}
        if unknown := words.keys() - letters.keys() - {"X"}:
            raise Refused(f"the stand-in has no axis {', '.join(sorted(unknown))}")
        goals = {letters.get(letter, "X"): value for letter, value in words.items()}
        base = start if self.relative else {"X": self.x_base}
        return start | {name: base.get(name, 0.0) + value for name, value in goals.items()}

    def _run_moves(self, seconds: float) -> None:
        """Advance the planned moves by a time [s]."""
        while self._moves and seconds > 0.0:
            move = self._moves[0]
            part = min(seconds, move.seconds - move.seconds_done)
            move.seconds_done += part
            seconds -= part
            share = move.seconds_done / move.seconds
            for key, a in move.start.items():
                self.at[key] = a + share * (move.end[key] - a)
            if move.seconds_done >= move.seconds - 1e-12:
                self.at |= move.end
                self._moves.popleft()


_COMMANDS: dict[str, Callable[[Klipper, list[str]], None]] = {
    "G0": Klipper._carry_out_gcode,
    "G1": Klipper._carry_out_gcode,
    "G90": Klipper._use_absolute,
    "G91": Klipper._use_relative,
    "G92": Klipper._zero_x,
    "M84": Klipper._motors_off,
    "M220": Klipper._scale_feed,
    "M400": Klipper._wait,
    "MANUAL_STEPPER": Klipper._manual_stepper,
}
