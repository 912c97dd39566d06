"""Random commands, options in any order: nothing that a board carries out goes through a keep-out.

What boards are given is sampled with the scene that this file reads, not with what the command made of it.
`python tests/keep_out/test_fuzz_moves.py 2000 7` asks more of them, from another seed.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from unittest import mock

import numpy as np

sys.path.append(str(Path(__file__).parents[1]))

import armkin
from armkin.board.backend.starting import Laid
from armkin.keep_out.guard import guard
from armkin.motion.trajectory import Trajectory
from command_line import run

KINDS = ["three_dof", "tests/robots/three_dof_grbl.yaml", "tests/robots/three_dof_klipper.yaml"]
SCENE = """
clearance: 2
keep_out:
  - self
  - floor: -10
  - box: {min: [280, -400, -10], max: [700, 150, 180]}
    name: table
  - capsule: {from: [150, 300, 0], to: [150, 300, 500], radius: 40}
"""
DEEP = 0.01  # mm


def _joints(rng: np.random.Generator) -> list[str]:
    return [f"{x:.3f}" for x in rng.uniform((-120, -20, -120), (120, 120, 120))]


def _tip(rng: np.random.Generator) -> list[str]:
    r, turn = rng.uniform(150, 450), rng.uniform(-2, 2)
    return [f"{x:.2f}" for x in (r * np.cos(turn), r * np.sin(turn), rng.uniform(-50, 500))]


def _command(rng: np.random.Generator) -> tuple[str, list[list[str]], bytes]:
    """A command, its words in groups that may stand in any order, and what it is given on stdin."""
    kind = rng.integers(6)
    speed = [["--speed", f"{rng.uniform(20, 100):.0f}"]] if rng.random() < 0.5 else []
    if kind == 0:
        return "send", [["--target", ",".join(_tip(rng))], *speed], b""
    if kind == 1:
        return "send", [["--batch", "-"]], "\n".join(",".join(_joints(rng)) for _ in range(3)).encode()
    if kind == 2:
        vias = [["--via", ",".join(_tip(rng))] for _ in range(3)]
        blend = [["--blend", "10"]] if rng.random() < 0.5 else []
        return "path", [[word for via in vias for word in via], *blend], b""
    if kind == 3:
        moves = "\n".join(f"  - joint: [{', '.join(_joints(rng))}]" for _ in range(3))
        return "path", [["-"]], f"moves:\n{moves}\n".encode()
    if kind == 4:
        joint, rate = rng.integers(1, 4), rng.uniform(10, 60) * rng.choice([-1, 1])
        return "jog", [[f"q{joint}", f"{rate:.1f}"], ["--seconds", f"{rng.uniform(0.2, 9):.1f}"]], b""
    return "send", [_joints(rng), *speed], b""


def fuzz(count: int, seed: int) -> tuple[int, int]:
    """Carry out commands; how many moved, and how many were refused. AssertionError for a hit."""
    rng, moved, refused = np.random.default_rng(seed), 0, 0
    given: list[Trajectory] = []
    checked = Laid.__post_init__

    def note(laid: Laid) -> None:
        checked(laid)
        given.append(laid.trajectory)

    with tempfile.TemporaryDirectory() as folder, mock.patch.object(Laid, "__post_init__", note):
        scene = Path(folder) / "scene.yaml"
        scene.write_text(SCENE)
        held = guard(armkin.load("three_dof", scene=scene))
        home = np.deg2rad([0.0, 90.0, -90.0])
        assert held.least(home[None])[0] > 0
        for _ in range(count):
            name, groups, stdin = _command(rng)
            robot = KINDS[rng.integers(len(KINDS))]
            options = [["--port", "sim"], ["--scene", str(scene)], *groups[1:]] + ([["--json"]] * int(rng.integers(2)))
            if groups[0][0].startswith("--"):
                options.append(groups.pop(0))
            rng.shuffle(options)
            first = groups[0] if groups and not groups[0][0].startswith("--") and groups[0] not in options else []
            place = rng.integers(len(options) + 1)
            flat = [word for group in (*options[:place], [robot, *first], *options[place:]) for word in group]
            given.clear()
            said = run(name, *flat, stdin=stdin)
            words = f"armkin {name} {' '.join(flat)}: {said.code} {said.err}"
            assert said.code in (0, 3), words
            moved, refused = moved + (said.code == 0), refused + (said.code == 3)
            assert given or said.code == 3 or name == "jog", words
            for one in given:
                q = one.q(np.linspace(0.0, one.duration, 1500))
                assert held.least(q)[0].min() >= -DEEP, words
            if name == "jog" and said.code == 0 and "--json" in flat:
                end = np.deg2rad(said.json["joints"])
                way = home + np.linspace(0.0, 1.0, 1500)[:, None] * (end - home)
                assert held.least(way)[0].min() >= -DEEP, words
    return moved, refused


def test_no_command_takes_an_arm_through_a_keep_out() -> None:
    moved, refused = fuzz(36, 1)
    assert moved > 8
    assert refused > 8


if __name__ == "__main__":
    print("moved {}, refused {}: no hit".format(*fuzz(int(sys.argv[1]), int(sys.argv[2]))))
