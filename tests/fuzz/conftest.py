"""Rounds of the fuzzers: a sample in the suite, a million inputs with --long, or as many as ARMKIN_FUZZ says.

`ARMKIN_FUZZ=2000 ARMKIN_FUZZ_SEED=7 pytest -n 0 tests/fuzz` gives 65,000 inputs that no other seed has given.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import lru_cache

import pytest
from attack import ATTACKS

from armkin import robot_file
from armkin.model import build_arm
from armkin.model.arm import Arm
from armkin.robot_file import RobotFile

KEPT = 64  # robot files and their arms
SAMPLE = 25
A_MILLION = 31_000  # rounds, of 32.7 inputs over all fuzzers: files 14.7, words 8, rows 4, answers 2, devices 4


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """How many inputs there were, of a run without workers (-n 0)."""
    if ATTACKS:
        counts = ", ".join(f"{command} {count:,}" for command, count in sorted(ATTACKS.items()))
        terminalreporter.write_line(f"{ATTACKS.total():,} inputs: {counts}")


@pytest.fixture
def rounds(request: pytest.FixtureRequest) -> int:
    """How often each fuzzer runs its loop."""
    if "ARMKIN_FUZZ" in os.environ:
        return int(os.environ["ARMKIN_FUZZ"])
    return A_MILLION if request.config.getoption("--long") else SAMPLE


@pytest.fixture(autouse=True, scope="session")
def _each_robot_file_is_read_once() -> Iterator[None]:
    """Nine commands on one file share its model and its arm: what they do with them is what differs."""
    arms: dict[int, tuple[RobotFile, Arm]] = {}  # the file beside its arm: as long as it lives, its id is its own
    build_anew = build_arm.arm_of_file

    def build_once(file: RobotFile) -> Arm:
        if id(file) not in arms:
            if len(arms) == KEPT:
                arms.clear()
            arms[id(file)] = file, build_anew(file)
        return arms[id(file)][1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(robot_file, "parse_robot_file", lru_cache(KEPT)(robot_file.parse_robot_file))
        patch.setattr(build_arm, "arm_of_file", build_once)
        yield
