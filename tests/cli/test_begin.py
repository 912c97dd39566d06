"""`armkin begin`: the first hour of an arm, by somebody whose keys are written here, and once through a terminal."""

from __future__ import annotations

import os
import pty
import re
import select
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import armkin
from armkin.board.kinds.firmware import FirmwareBoard
from command_line import ROOT, Result, run
from scripted_operator import ENTER, ScriptedOperator, keys_for_direction


@pytest.fixture
def begin(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., tuple[Result, ScriptedOperator, Path]]:
    """Runs the command on a copy of a shipped robot, with keys: its result, who pressed them, the file."""

    def go(
        robot: str, keys: Sequence[str], *options: object, looks: int = 10_000
    ) -> tuple[Result, ScriptedOperator, Path]:
        path = tmp_path / "mine.yaml"
        if not path.exists():
            shutil.copy(ROOT / "robots" / f"{robot}.yaml", path)
            path.chmod(0o644)
        person = ScriptedOperator(keys, looks)

        @contextmanager
        def keys_of() -> Iterator[ScriptedOperator]:
            yield person

        monkeypatch.setattr("armkin.cli.commands.begin.keys", keys_of)
        return run("begin", path, "--port", "sim", *options), person, path

    return go


def test_the_file_is_corrected_and_its_comments_stay(
    begin: Callable[..., tuple[Result, ScriptedOperator, Path]],
) -> None:
    keys = [
        *keys_for_direction("y"),
        *keys_for_direction("n"),
        *keys_for_direction("y"),
        "y",
        "3",
        "-",
        "[",
        ENTER,
        "y",
        "y",
        "y",
    ]
    before = (ROOT / "robots/three_dof.yaml").read_text()
    completed, person, path = begin("three_dof", keys, looks=100)
    assert completed.code == 0, completed.err
    after = path.read_text()
    changed = [(a, b) for a, b in zip(before.splitlines(), after.splitlines(), strict=True) if a != b]
    assert len(changed) == 2
    assert changed[0][1] == changed[0][0].replace("pulley: 1}", "pulley: 1, invert: true}")
    assert re.fullmatch(r" *limits: \[-9[0-9.]+, 120\].*", changed[1][1]), changed
    assert f"+{changed[1][1]}" in completed.out, "the diff comes first"
    assert "#" in after
    assert armkin.load(path).motors[1].invert != armkin.load("three_dof").motors[1].invert
    assert any("the tool goes" in text and "towards +y" in text for text in person.heard)


def test_before_the_first_move_a_joint_jogs_slowly_and_never_by_more_than_two_degrees(
    begin: Callable[..., tuple[Result, ScriptedOperator, Path]], monkeypatch: pytest.MonkeyPatch
) -> None:
    jogs: list[tuple[float, float]] = []
    jog = FirmwareBoard.jog

    def note_and_call(board: FirmwareBoard, joint: int, rate: float, seconds: float, more: Callable[[], bool]) -> None:
        before = float(board.machine.joints()[joint])
        jog(board, joint, rate, seconds, more)
        board.machine.refresh()
        moved = float(board.machine.joints()[joint]) - before
        jogs.append((abs(rate) / float(board.arm.max_speed[joint]), moved))

    monkeypatch.setattr(FirmwareBoard, "jog", note_and_call)
    first = ["+", "+", "-", "-", ENTER, "a", "+", "-", ENTER, "y"]
    completed, person, _ = begin(
        "three_dof", [*first, *keys_for_direction("s"), *keys_for_direction("s"), "y", ENTER, "s"]
    )
    assert completed.code == 0, completed.err
    assert "nothing to correct" in completed.err
    assert {round(share, 6) for share, _ in jogs} == {0.1}
    two = 2 * 3.14159265 / 180
    places = np.cumsum([moved for _, moved in jogs[:4]])
    assert [round(float(place / two), 1) for place in places] == [1.0, 0.0, -1.0, 0.0], "out, back, out, back"
    assert "has moved by 2" in " ".join(person.heard)


def test_no_is_no_and_a_shipped_robot_stays(
    begin: Callable[..., tuple[Result, ScriptedOperator, Path]], tmp_path: Path
) -> None:
    keys = [*keys_for_direction("n"), *keys_for_direction("y"), *keys_for_direction("y"), "y", ENTER, "s", "n"]
    completed, _, path = begin("three_dof", keys)
    assert completed.code == 0, completed.err
    assert "nothing was written" in completed.err
    assert path.read_text() == (ROOT / "robots/three_dof.yaml").read_text()
    completed = run("begin", "three_dof", "--port", "sim")
    assert (completed.code, "--out MINE.yaml" in completed.err) == (2, True)
    assert run("begin", path, "--port", "sim", "--out", path).code == 1, "it is there already"


def test_limits_leave_home_in_and_a_failed_check_is_told(
    begin: Callable[..., tuple[Result, ScriptedOperator, Path]],
) -> None:
    keys = [*keys_for_direction("y") * 3, "y", "1", "]", "2", "+", "]", "q", ENTER, "y", "n", "y"]
    completed, _, path = begin("three_dof", keys, looks=50)
    assert completed.code == 0, completed.err
    assert "the check was not passed" in completed.err
    assert armkin.load(path).upper[0] == 0.0, "where it stands, at home, is the limit itself"
    assert 0 < armkin.load(path).upper[1] < armkin.load("three_dof").upper[1] or armkin.load(path).upper[1] > 1.5


def test_a_table_without_drives_moves_on_named_assumptions_and_on_no_board(
    begin: Callable[..., tuple[Result, ScriptedOperator, Path]],
) -> None:
    completed, _, path = begin(
        "puma560", [*keys_for_direction("n"), *keys_for_direction("y") * 5, "y", ENTER, "y", "y"]
    )
    assert completed.code == 0, completed.err
    assert completed.err.count("assumed for the simulation alone") == 1
    assert "nothing to correct" in completed.err, "what is assumed is no file's"
    refused = run("begin", path, "--port", "/dev/null")
    assert (refused.code, "have no drive" in refused.err) == (2, True)


def test_bus_servos_are_put_to_their_zeros_by_hand(begin: Callable[..., tuple[Result, ScriptedOperator, Path]]) -> None:
    joints = armkin.load("so101").n
    completed, person, _ = begin(
        "so101", [*keys_for_direction("y") * joints, "y", ENTER, ENTER, "y", "y", "y"], looks=3
    )
    assert completed.code == 0, completed.err
    assert any("servos will be switched off" in text for text in person.heard)
    assert "zero" in completed.out or "nothing to correct" in completed.err


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("three_dof", "--port", "sim", "-o", "/tmp/no/where.yaml"), 2, "asks at a terminal"),
        (("nobody", "--port", "sim"), 1, "nobody"),
        (("robots/robot.schema.json", "--port", "sim"), 4, "is text to YAML"),
        (("robots/three_dof.yaml", "--port", "/dev/nothing"), 2, "asks at a terminal"),
    ],
)
def test_refusals(words: Sequence[str], code: int, message: str) -> None:
    completed = run("begin", *words)
    assert (completed.code, completed.out) == (code, "")
    assert message in completed.err


def test_at_a_terminal_a_joint_moves_while_its_key_comes_again_and_again(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    shutil.copy(ROOT / "robots/three_dof.yaml", path)
    path.chmod(0o644)
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "armkin", "begin", "mine.yaml", "--port", "sim"]
    process = subprocess.Popen(command, cwd=tmp_path, stdin=slave, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    os.close(slave)
    assert process.stderr is not None
    assert process.stdout is not None
    heard = b""

    def until(words: str) -> None:
        nonlocal heard
        end = time.monotonic() + 120
        while words.encode() not in heard:
            assert process.stderr is not None
            assert time.monotonic() < end, heard
            if select.select([process.stderr], [], [], 0.1)[0]:
                heard += os.read(process.stderr.fileno(), 4096)
        heard = heard[heard.index(words.encode()) + len(words) :]

    def hold(key: bytes, words: str) -> None:
        """Send a key again and again until something is said."""
        finished = threading.Event()

        def again() -> None:
            while not finished.wait(0.03):
                os.write(master, key)

        thread = threading.Thread(target=again)
        thread.start()
        until(words)
        finished.set()
        thread.join()

    def press(key: bytes) -> None:
        time.sleep(0.3)  # what was held is read by then, or answers no question
        os.write(master, key)

    try:
        until("q1, +:")
        hold(b"\x1b[C", "q1 has moved by 2")
        for name, answer in (("q1", b"n"), ("q2", b"y"), ("q3", b"y")):
            press(b"\n")
            until(f"{name}: did + move it so?")
            until("[y/n/a/s]")
            press(answer)
        until("Does it stand so?")
        until("[y/n]")
        press(b"y")
        until("q1 is chosen")
        press(b"\n")
        until("First move")
        until("[y/s]")
        press(b"s")
        until("Write this to")
        until("[y/n]")
        press(b"y")
        assert process.wait(60) == 0
    finally:
        process.kill()
        process.wait()
        os.close(master)
    assert b"+" in process.stdout.read()
    assert armkin.load(path).motors[0].invert != armkin.load("three_dof").motors[0].invert
    process.stdout.close()
    process.stderr.close()


@pytest.mark.parametrize(
    ("robot", "j", "words"),
    [
        ("cobra600", 3, "the tool turns clockwise about z (the tool's own z), seen with z pointing at you"),
        ("iiwa7", 0, "the tool turns counter-clockwise about z (the tool's own z), seen with z pointing at you"),
        ("cobra600", 2, "the tool goes 2.0 mm, mostly towards -z"),
    ],
)
def test_what_shall_be_seen_is_what_the_joint_does(robot: str, j: int, words: str) -> None:
    from armkin.board.commissioning import _expected_motion

    arm = armkin.load(robot)
    assert _expected_motion(arm, arm.home, j) == words
    q = arm.home.copy()
    q[j] += 0.01
    turned = armkin.fk(arm, q)[:3, :3] @ armkin.fk(arm, arm.home)[:3, :3].T  # about z of the base
    assert np.sign(np.round(turned[1, 0], 6)) == {"clockwise": -1, "counter-clockwise": 1}.get(words.split()[3], 0)


def test_a_key_that_comes_while_another_was_held_counts() -> None:
    """Enter straight after a tap of + was taken for the end of the tap, and lost."""
    from armkin.cli.terminal_keys import Keys

    coming = list("+\n" + "+++\ny")
    keys = Keys(lambda seconds: coming.pop(0) if coming else "")
    assert keys.key() == "+"
    assert keys.held("+") is None
    assert keys.key() == ENTER
    assert keys.key() == "+"
    more = keys.held("+")
    assert more is not None
    assert more()
    assert not more(), "another key ends it"
    assert keys.key() == ENTER
    assert keys.key() == "y"
