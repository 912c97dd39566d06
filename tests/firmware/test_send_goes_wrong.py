"""`armkin send` against the compiled firmware in the emulator: resets, signals, cables, noise, power."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from emulator import EmulatedBoard
from pins import at_rest, net_steps, on_the_line

from armkin.board.firmware.configuration import configure
from armkin.board.firmware.firmware_machine import FirmwareMachine
from armkin.board.firmware.segments.trajectory_to_counts import plan_moves as plan_moves
from armkin.board.ports import SerialPort
from armkin.errors import HeldError
from armkin.model import build_arm as arms
from command_line import BUSY, COUNTS, POSE, ROOT, THREE_DOF, run, run_patiently


def start_moving(board: EmulatedBoard) -> subprocess.Popen[bytes]:
    """A send to the pose that is at its full speed, a fifth of the joints', and has 6 s to go.

    One that the machine was too busy for goes on from where the arm stands, as `patiently` does.
    """
    send = ("send", THREE_DOF, *map(str, POSE), "--port", board.port, "--speed", "20")
    sender, end = start_command(*send, "--assume-home"), time.monotonic() + 60
    while net_steps(board)[1] > -1500:
        if sender.poll() is not None:
            told = sender.communicate()[1].decode()
            assert any(busy in told for busy in BUSY), told
            stands = run_patiently("status", THREE_DOF, "--port", board.port, "--json").json["position"]
            sender = start_command(*send, *(["--assume-home"] if stands == "lost" else []))
        assert time.monotonic() < end, "it does not move"
        time.sleep(0.01)
    return sender


def start_command(*words: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "armkin", *words]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def finish_motion(board: EmulatedBoard) -> None:
    """The next command plans from where the arm stands, to exact counts on the pins."""
    completed = run_patiently("send", THREE_DOF, *POSE, "--port", board.port, "--json")
    assert completed.code == 0, completed.err
    assert completed.json["pulses"] == net_steps(board) == COUNTS


def test_a_position_is_kept_through_a_reset_at_rest_and_no_other(board: EmulatedBoard) -> None:
    assert run_patiently("send", THREE_DOF, 10, 80, -80, "--port", board.port, "--assume-home").code == 0
    board.control("reset external")
    status = run_patiently("status", THREE_DOF, "--port", board.port, "--json").json
    assert status["position"] == "retained"
    assert status["pulses"] == net_steps(board)
    finish_motion(board)
    board.control("reset power")
    lost = run("send", THREE_DOF, 10, 80, -80, "--port", board.port)
    assert lost.code == 5
    assert "position is lost" in lost.err
    assert net_steps(board) == COUNTS


def test_a_reset_in_motion_is_a_lost_position(board: EmulatedBoard) -> None:
    sender = start_moving(board)
    board.control("reset external")
    _, err = sender.communicate(timeout=60)
    assert sender.returncode == 5
    assert b"the board was reset" in err
    assert b"position is lost" in err
    stopped = at_rest(board)
    again = run("send", THREE_DOF, *POSE, "--port", board.port)
    assert again.code == 5
    assert "position is lost" in again.err
    assert net_steps(board) == stopped


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_stops_on_the_path(board: EmulatedBoard, number: signal.Signals, code: int) -> None:
    sender = start_moving(board)
    sender.send_signal(number)
    _, err = sender.communicate(timeout=60)
    assert sender.returncode == code, err
    stopped = net_steps(board)
    assert on_the_line(stopped, [0, 0, 0], COUNTS)
    assert at_rest(board) == stopped
    finish_motion(board)


def test_a_killed_process(board: EmulatedBoard) -> None:
    sender = start_moving(board)
    sender.kill()
    sender.communicate()
    stopped = at_rest(board)
    assert on_the_line(stopped, [0, 0, 0], COUNTS)
    finish_motion(board)


def test_a_boot_loader_hides_the_cause_and_the_position_is_retained() -> None:
    """The stock Uno: it swallows what comes in its first second and a half, and clears MCUSR."""
    with EmulatedBoard(bootloader=1500, patience=0) as board:  # it does not wait for a host that waits for it
        assert run_patiently("send", THREE_DOF, 10, 80, -80, "--port", board.port, "--assume-home").code == 0
        status = run_patiently("status", THREE_DOF, "--port", board.port, "--json").json
        assert (status["position"], status["reset_cause"]) == ("retained", 0)
        assert status["boots"] >= 2
        finish_motion(board)


class _KilledError(Exception):
    pass


@contextmanager
def connected_machine(board: EmulatedBoard, dies_after: float | None = None) -> Iterator[FirmwareMachine]:
    """The three-joint arm on this board; a sender that dies falls silent in the middle of whatever it does."""
    arm = arms.load_arm(ROOT / THREE_DOF)
    port = SerialPort(board.port)
    born = time.monotonic()

    def dead() -> bool:
        if dies_after is not None and time.monotonic() - born > dies_after:
            raise _KilledError
        return False

    try:
        yield FirmwareMachine(port, arm, configure(arm), dead)
    finally:
        port.close()


def _killed_often(seed: int, times: int) -> list[str]:
    """Send back and forth, die at random moments; what went wrong."""
    rng = random.Random(seed)
    wrong: list[Any] = []
    goals = np.deg2rad([[-30, 5, -5], [25, 85, -60]])
    with EmulatedBoard(seed=seed) as board:
        with connected_machine(board) as first:
            first.prepare(assume=first.arm.home)
        for i in range(times):
            start = end = at_rest(board)
            try:
                with connected_machine(board, rng.uniform(0.15, 1.6)) as machine:
                    if machine.position() == "lost" or list(machine.counts()) != start:
                        return [
                            *wrong,
                            f"kill {i}: the board says {machine.position()} {machine.counts()}, pins {start}",
                        ]
                    machine.prepare()
                    plan = plan_moves(machine.arm, start, goals[rng.randrange(2)])
                    end = plan.end.tolist()
                    machine.run([plan])
            except _KilledError:
                board.wait(0.6)  # the board notices after half a second, at rest or not
            except HeldError:
                board.wait(0.1)  # a machine too busy to keep the queue filled ends it, too
            stopped = at_rest(board)
            if stopped != start if end == start else not on_the_line(stopped, start, end):
                wrong.append(f"kill {i}: {start} to {end} stopped at {stopped}")
            board.wait(0.3)
            if net_steps(board) != stopped:
                wrong.append(f"kill {i}: moved again")
    return wrong


def test_a_sender_killed_at_random_moments(sample: Callable[[int, int], int]) -> None:
    kills = sample(50, 8)
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(lambda seed: _killed_often(seed, kills // 2), (1, 2))) == [[], []]


def test_a_cut_cable(board: EmulatedBoard) -> None:
    sender = start_moving(board)
    board.control("cut both")
    stopped = at_rest(board)
    assert on_the_line(stopped, [0, 0, 0], COUNTS)
    _, err = sender.communicate(timeout=60)
    assert sender.returncode == 5
    assert b"does not answer any more" in err
    board.control("restore")
    board.wait(0.3)
    assert net_steps(board) == stopped
    finish_motion(board)


def test_the_abort_input(board: EmulatedBoard) -> None:
    sender = start_moving(board)
    board.control("pin A0 0")
    _, err = sender.communicate(timeout=60)
    assert sender.returncode == 5
    assert b"the abort input is active" in err
    stopped = net_steps(board)
    assert on_the_line(stopped, [0, 0, 0], COUNTS)
    blocked = run("send", THREE_DOF, *POSE, "--port", board.port)
    assert blocked.code == 5
    assert "abort input" in blocked.err
    assert net_steps(board) == stopped
    board.control("pin A0 z")
    finish_motion(board)


def _a_short_move(board: EmulatedBoard) -> None:
    """After it the position is known."""
    completed = run_patiently("send", THREE_DOF, 1, 89, -89, "--port", board.port, "--assume-home")
    assert completed.code == 0, completed.err


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_noisy_line_ends_at_exact_counts(seed: int) -> None:
    """1 % of the bytes flipped and 1 % dropped, in both directions."""
    with EmulatedBoard(seed=seed) as board:
        _a_short_move(board)
        start = net_steps(board)
        board.control(f"noise flip 0.01 drop 0.01 seed {seed}")
        completed = run("send", THREE_DOF, *POSE, "--port", board.port, "--json")
        now = at_rest(board)
        if completed.code == 0:
            assert now == COUNTS
        else:  # too busy a machine to keep the queue filled: it must end, on the path, and know where
            assert "its position is known" in completed.err
            assert on_the_line(now, start, COUNTS)
        board.control("restore")
        finish_motion(board)


def test_after_a_cut_of_the_power_the_position_is_declared_lost() -> None:
    with EmulatedBoard(reset_on_open=False) as board:
        _a_short_move(board)
        assert run("status", THREE_DOF, "--port", board.port, "--json").json["position"] == "known"
        completed = run("stop", "--power-cut", "--port", board.port)
        assert (completed.code, completed.err) == (
            0,
            "note: the arm stands; its position is lost: home it, or say --assume-home\n",
        )
        assert run("status", THREE_DOF, "--port", board.port, "--json").json["position"] == "lost"
        assert run("send", THREE_DOF, 0, 90, -90, "--port", board.port).code == 5
