"""Random commands, options in any order, on arms that stay where they are left: nothing goes through a keep-out.

Every kind of board, examples/board_plugin's among them. What boards are given, and what their motors then count, is
held against the scene that this file reads, not against what the command made of it.
`python tests/keep_out/test_fuzz_moves.py 2000 7` asks more of them, from another seed.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import yaml

sys.path.append(str(Path(__file__).parents[1] / "helpers"))

import armkin
from armkin import board_catalogue
from armkin.board.backend.board import Board
from armkin.board.backend.motion_start import StartedTrajectory
from armkin.board.firmware.wire.protocol import State
from armkin.board.kinds import board_of
from armkin.board.kinds.firmware import FirmwareBoard
from armkin.board.kinds.klipper import KlipperBoard
from armkin.board.sim.sim_board import SimBoard
from armkin.board.sim.sim_port import SimPort
from armkin.board.stop_signals import Stop
from armkin.board_catalogue import BOARDS
from armkin.keep_out.body_pairs import Guard, guard
from armkin.motion.timing.trajectory import Trajectory
from command_line import ROOT, Result, run
from simulated_starts import KINDS, watch_counts

SCENE = """
clearance: 2
keep_out:
  - self
  - floor: -10
  - box: {min: [280, -400, -10], max: [700, 150, 180]}
    name: table
  - capsule: {from: [150, 300, 0], to: [150, 300, 500], radius: 40}
"""
DEEP = 0.01  # mm of a trajectory
CLEARANCE = 2.0  # mm: what steps and servos may take of it, so that no body is ever touched
SWITCHES = (-121, 121, -121)  # degrees: a degree beyond the limits
GRIPPERS = {
    "grbl": "{kind: spindle, open: 0, closed: 200}",
    "feetech": "{kind: bus, id: 6, counts: 4096, zero: 2048, open: 60, closed: 0}",
}
OURS = "uno_cnc_shield"
STOPPED = 128  # and the signal, of which there is none here
BUSES = ("feetech", "dynamixel")


def _robot_text(kind: str) -> str:
    """three_dof on a kind of board: with switches, or a gripper, where that kind has them."""
    document = yaml.safe_load(KINDS["feetech" if kind == "dynamixel" else kind])
    document["board"] = {**document["board"], "kind": kind}
    if kind == OURS:
        for joint, switch_value in zip(document["joints"], SWITCHES, strict=True):
            way, axis = int(np.sign(switch_value)), joint["drive"]["axis"]
            joint["homing"] = {
                "switch": axis,
                "at": switch_value,
                "direction": way,
                "normally": "closed",
                "speed": 40,
                "backoff": 3,
            }
    if kind in GRIPPERS:
        document["gripper"] = yaml.safe_load(GRIPPERS[kind])
    return str(yaml.safe_dump(document, sort_keys=False))


def _switch_levels(arm: armkin.Arm) -> Callable[[int, Sequence[int]], bool]:
    """Levels of the switches of the arm on X, Y and Z: as `homing.switch_levels`, for one motor a joint, and quick."""
    turns = [(float(arm.home[k]), 1 / float(arm.motor_gain[k, k]), np.deg2rad(SWITCHES[k])) for k in range(3)]

    def level(number: int, net: Sequence[int]) -> bool:
        if number >= 3:
            return True
        home, turn, switch_value = turns[number]
        return bool((home + turn * net[number] - switch_value) * switch_value >= 0)

    return level


class Arms:
    """Arms on simulated boards that outlive each command, as real ones do."""

    def __init__(self, folder: Path) -> None:
        self.scene = folder / "scene.yaml"
        self.scene.write_text(SCENE)
        self.given: list[Trajectory] = []
        self.moving: Any = None  # the port of the command that is carried out
        self.made = 0.0  # [rad] how far it moved a joint
        self.until = np.inf  # [s] of a board's time, when somebody presses Ctrl-C
        self.files, self.ports, self.seen = dict[str, Path](), dict[str, Any](), dict[str, list[list[float]]]()
        self.arms = dict[str, armkin.Arm]()
        for number, kind in enumerate((OURS, "grbl", "klipper", *BUSES), 20):
            file = folder / f"{kind}.yaml"
            file.write_text(_robot_text(kind))
            arm = armkin.load(file, scene=self.scene)
            port: Any = (
                SimPort(SimBoard(BOARDS[OURS], _switch_levels(arm))) if kind == OURS else board_of(arm).simulated()
            )
            port.simulated, port.name, port.step = False, f"COM{number}", 0.005
            self.seen[kind] = []
            watch_counts(arm, kind, port, self.seen[kind])
            self.files[kind], self.ports[kind], self.arms[kind] = file, port, arm
        self.held: Guard = guard(arm)

    def begin(self) -> None:
        """Every arm stands in its home pose, known: no motion, and before it counts mean nothing."""
        for kind, robot in self.files.items():
            assume = [] if kind in BUSES else ["--assume-home"]
            words = ["send", robot, "home", "--scene", self.scene, *assume, "--port", self.ports[kind].name]
            assert run(*words).code == 0

    def open(self, board: Board, name: str, baud: int | None = None, *, reset: bool = True) -> Any:
        """In place of `Board.open`."""
        return next(port for port in self.ports.values() if port.name == name)

    def stops(self, stop: Stop) -> bool:
        """In place of `Stop`: whether somebody has pressed Ctrl-C."""
        return any(port.now() > self.until for port in self.ports.values() if port is self.moving)

    def ask(self, kind: str, name: str, *words: object, stdin: bytes = b"", until: float = np.inf) -> Result:
        """A command on the arm of a kind, held after some seconds; what it did is held against the scene."""
        self.given.clear()
        self.seen[kind].clear()
        self.moving, self.made = self.ports[kind], 0.0
        self.until = self.moving.now() + until
        if name == "home":
            self.search()
        completed = run(name, *words, "--port", self.moving.name, stdin=stdin)
        line = f"{kind}: armkin {name} {' '.join(map(str, words))}: {completed.code} {completed.err}"
        assert completed.code in ((0, 2, 3) if until == np.inf else (0, 3, STOPPED)), line
        for trajectory in self.given:
            apart = self.held.least_clearances(trajectory.q(np.linspace(0.0, trajectory.duration, 1500)))[0]
            assert apart.min() >= min(apart[0], 0.0) - DEEP, line
        if self.seen[kind]:
            counts = np.unique(np.array(self.seen[kind]), axis=0)
            q = np.asarray(armkin.joints(self.arms[kind], counts))
            assert self.held.least_clearances(q)[0].min() >= -CLEARANCE, line
            self.made = float(np.ptp(q, axis=0).max())
        return completed

    def search(self) -> None:
        """What is counted before the last switch is found is a search, which nobody proves."""
        counts, board = self.seen[OURS], self.ports[OURS].board
        self.noted = noted = getattr(self, "noted", board.advance)

        def advance(seconds: float) -> None:
            noted(seconds)
            if board.motors.state == State.HOMING:
                counts.clear()

        board.advance = advance


@contextmanager
def fuzzed_arms() -> Iterator[Arms]:
    """The arms, with the plug-in found as if it was installed."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        offered = folder / "packages/armkin_dynamixel-0.dist-info"
        offered.mkdir(parents=True)
        (offered / "METADATA").write_text("Metadata-Version: 2.1\nName: armkin-dynamixel\nVersion: 0\n")
        (offered / "entry_points.txt").write_text("[armkin.boards]\ndynamixel = armkin_dynamixel\n")
        packages = [str(offered.parent), str(ROOT / "examples/board_plugin/src"), *sys.path]
        stack.enter_context(mock.patch.object(sys, "path", packages))
        board_catalogue._entry_points.cache_clear()
        stack.callback(board_catalogue._entry_points.cache_clear)
        stack.enter_context(mock.patch.dict("os.environ", XDG_STATE_HOME=str(folder)))
        fuzzed, checked = Arms(folder), StartedTrajectory.__post_init__

        def note(laid: StartedTrajectory) -> None:
            checked(laid)
            fuzzed.given.append(laid.trajectory)

        stack.enter_context(mock.patch.object(StartedTrajectory, "__post_init__", note))
        stack.enter_context(mock.patch.object(Stop, "__call__", lambda stop: fuzzed.stops(stop)))
        for board_class in (Board, FirmwareBoard, KlipperBoard):
            stack.enter_context(
                mock.patch.object(board_class, "open", lambda *words, **more: fuzzed.open(*words, **more))
            )
        yield fuzzed


def _random_joints(rng: np.random.Generator) -> list[str]:
    return [f"{x:.3f}" for x in rng.uniform((-120, -20, -120), (120, 120, 120))]


def _random_tip(rng: np.random.Generator) -> list[str]:
    r, turn = rng.uniform(150, 450), rng.uniform(-2, 2)
    return [f"{x:.2f}" for x in (r * np.cos(turn), r * np.sin(turn), rng.uniform(-50, 500))]


def _random_motion(rng: np.random.Generator, folder: Path) -> tuple[str, list[list[str]], bytes]:
    """A command, its words in groups that may stand in any order, and what it is given on stdin."""
    kind = rng.integers(7)
    speed = [["--speed", f"{rng.uniform(20, 100):.0f}"]] if rng.random() < 0.5 else []
    rows = "\n".join(",".join(_random_joints(rng)) for _ in range(3))
    if kind == 0:
        return "send", [["--target", ",".join(_random_tip(rng))], *speed], b""
    if kind == 1:
        return "send", [["--batch", "-"]], rows.encode()
    if kind == 2:
        (folder / "rows.csv").write_text(rows)
        return "send", [["--batch", str(folder / "rows.csv")], ["--blend", "5"], *speed], b""
    if kind == 3:
        vias = [["--via", ",".join(_random_tip(rng))] for _ in range(3)]
        return "path", [[word for via in vias for word in via], ["--blend", "10"]], b""
    if kind == 4:
        moves = "\n".join(f"  - joint: [{', '.join(_random_joints(rng))}]" for _ in range(3))
        (folder / "path.yaml").write_text(f"moves:\n{moves}\n")
        return "send", [["--path", str(folder / "path.yaml")], *speed], b""
    if kind == 5:
        joint, rate = rng.integers(1, 4), rng.uniform(10, 60) * rng.choice([-1, 1])
        return "jog", [[f"q{joint}", f"{rate:.1f}"], ["--seconds", f"{rng.uniform(0.2, 4):.1f}"]], b""
    return "send", [_random_joints(rng), *speed], b""


def _shuffled_words(rng: np.random.Generator, robot: Path, groups: list[list[str]]) -> list[str]:
    """Options in any order, the robot and what belongs behind it among them."""
    options = groups + ([["--json"]] if rng.random() < 0.5 else [])
    first = [] if options[0][0].startswith("--") else options.pop(0)
    rng.shuffle(options)
    place = rng.integers(len(options) + 1)
    return [word for group in (*options[:place], [str(robot), *first], *options[place:]) for word in group]


def fuzz_commands(count: int, seed: int) -> Counter[str]:
    """Carry out commands; how many of what came of them. AssertionError for a hit."""
    rng, tally = np.random.default_rng(seed), Counter[str]()
    with fuzzed_arms() as fuzzed:
        scene = ["--scene", str(fuzzed.scene)]
        fuzzed.begin()
        for number in range(count):
            kind = list(fuzzed.files)[number % len(fuzzed.files)]
            _fuzz_command(fuzzed, kind, rng, scene, tally)
    return tally


def _fuzz_command(fuzzed: Arms, kind: str, rng: np.random.Generator, scene: list[str], tally: Counter[str]) -> None:
    """A command on a kind's arm, and what belongs to it."""
    robot, dice = fuzzed.files[kind], rng.random()
    if dice < 0.12 and kind == OURS:
        if fuzzed.ask(kind, "send", robot, "home", *scene).code == 0:
            assert fuzzed.ask(kind, "home", robot, *scene).code == 0
            tally["home"] += 1
        return
    if dice < 0.12 and kind != "klipper":
        name, words = ("relax", []) if kind in BUSES and dice < 0.06 else ("grip", [rng.choice(["open", "closed"])])
        assume = ["--assume", "open"] * (kind == OURS and name == "grip" and not tally["grip " + kind])
        completed = fuzzed.ask(kind, name, robot, *words, *assume)
        assert completed.code == (2 if (kind, name) == ("dynamixel", "grip") else 0), completed.err
        assert fuzzed.made < np.deg2rad(0.2)
        tally[f"{name} {kind}"] += 1
        return
    name, groups, stdin = _random_motion(rng, fuzzed.scene.parent)
    if rng.random() < 0.08:  # without the scene that the port remembers
        completed = fuzzed.ask(kind, name, *_shuffled_words(rng, robot, groups), stdin=stdin)
        assert (completed.code, "was last used with the scene" in completed.err) == (2, True), completed.err
        assert not fuzzed.given or not fuzzed.seen[kind] or fuzzed.made < np.deg2rad(0.2)
        tally["without scene"] += 1
        return
    words = _shuffled_words(rng, robot, [*groups, scene])
    until = rng.uniform(0.1, 3.0) if rng.random() < 0.3 and name != "jog" else np.inf
    completed = fuzzed.ask(kind, name, *words, stdin=stdin, until=until)
    assert completed.code != 2, completed.err
    tally[f"{completed.code} {kind}"] += 1
    if completed.code == STOPPED and kind == OURS and not stdin:
        completed = fuzzed.ask(kind, name, *words, "--resume")
        assert completed.code == 0, completed.err
        tally["resume"] += 1


def test_no_command_takes_an_arm_through_a_keep_out() -> None:
    tally = fuzz_commands(15, 2)
    for kind in (OURS, "grbl", "klipper", *BUSES):
        assert sum(tally[f"{code} {kind}"] for code in (0, 3, STOPPED)), tally
    assert sum(tally[key] for key in tally if key.startswith("3 ")) > 1, tally
    assert sum(tally[key] for key in tally if key.startswith("0 ")) > 4, tally


def test_grip_home_and_a_motion_that_is_gone_on_with() -> None:
    with fuzzed_arms() as fuzzed:
        robot, scene = fuzzed.files[OURS], ["--scene", fuzzed.scene]
        fuzzed.begin()
        assert fuzzed.ask(OURS, "grip", robot, "closed", "--assume", "open").code == 0
        assert fuzzed.made == 0.0
        assert fuzzed.ask(OURS, "send", robot, -60, 80, -80, *scene, until=0.6).code == STOPPED
        assert 0.05 < fuzzed.made < 1.0
        assert fuzzed.ask(OURS, "send", robot, -60, 80, -80, *scene, "--resume").code == 0
        assert fuzzed.made > 0.5
        assert fuzzed.ask(OURS, "jog", robot, "q2", -60, "--seconds", 1, *scene).code == 0


def test_after_the_search_for_switches_the_move_is_proved() -> None:
    with fuzzed_arms() as fuzzed:
        robot, port = fuzzed.files[OURS], fuzzed.ports[OURS].name
        fuzzed.begin()
        post = fuzzed.scene.with_name("post.yaml")
        post.write_text("keep_out:\n  - capsule: {from: [0, -190, 0], to: [0, -190, 600], radius: 30}\n    name: post")
        fuzzed.given.clear()
        completed = run("home", robot, "--scene", post, "--port", port)
        assert (completed.code, "would hit post" in completed.err, fuzzed.given) == (3, True, []), completed.err
        stands = np.rad2deg(armkin.joints(fuzzed.arms[OURS], fuzzed.seen[OURS][-1]))
        assert np.abs(stands - SWITCHES).max() < 1.5  # where the search ended
        completed = fuzzed.ask(OURS, "home", robot, "--scene", fuzzed.scene)
        assert (completed.code, "the move after it is" in completed.err) == (0, True)
        assert fuzzed.made > 2.0  # q1 comes back from its switch


if __name__ == "__main__":
    print("no hit:", dict(fuzz_commands(int(sys.argv[1]), int(sys.argv[2]))))
