"""Spoilt robot files: refused with words, or good for every command."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from attack import attack, random_generator, spoil_text

import armkin
from command_line import ROOT

EXPORTS = ("--json", "--dh", "--mdh", "--screws", "--urdf")
FILES = sorted((ROOT / "robots").glob("*.yaml")) + sorted((ROOT / "tests/robots").glob("*.yaml"))


@pytest.mark.parametrize("seed", range(4))
def test_whatever_passes_validation_works_in_every_command(seed: int, rounds: int, tmp_path: Path) -> None:
    rng = random_generator(seed)
    good = 0
    for i in range(rounds):
        path = tmp_path / f"arm{i}.yaml"
        path.write_text(spoil_text(rng, rng.choice(FILES).read_text()), encoding="utf-8")
        before = path.read_bytes()
        if attack("info", path, "--json").code != 0:
            continue
        good += 1
        use_robot(rng, path)
        assert path.read_bytes() == before
    assert good > rounds // 20


def use_robot(rng: random.Random, path: Path) -> None:
    """Every command that needs no board, at home and at a random pose."""
    arm = armkin.load(str(path))
    attack("fk", path, "home", "--json", "--frames")
    pose = [round(rng.uniform(-200, 200), 2) for _ in range(arm.n)]
    attack("fk", path, *pose, "--json")
    attack("ik", path, *[round(rng.uniform(-500, 500), 1) for _ in range(rng.choice((2, 3, 3, 4, 5, 6)))], "--json")
    attack("pulses", path, "home", "--json")
    attack("pulses", path, *pose, "--json")
    if rng.random() < 0.3:
        attack("workspace", path, "--samples", "20", "--json")
    else:
        attack("export", path, rng.choice(EXPORTS))
    attack("send", path, "home", "--dry-run", "--json")
    attack("send", path, *pose, "--dry-run", "--json")
