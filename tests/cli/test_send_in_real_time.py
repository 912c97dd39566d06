"""`armkin send` and `stop` against the simulated board behind a terminal or a socket, in real time."""

from __future__ import annotations

import json
import math
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

import pytest

from armkin.board.firmware.wire.protocol import State
from armkin.board.sim.sim_board import SimBoard
from armkin.board_catalogue import BOARDS
from command_line import COUNTS, POSE, ROOT, THREE_DOF, run, run_patiently, run_process
from pty_board import PtyBoard
from pty_port import Patient


@pytest.fixture
def board() -> Iterator[PtyBoard]:
    with PtyBoard() as board:
        yield board


def start_command(*words: object, stdin: int | None = None) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "armkin", *map(str, words)]
    return subprocess.Popen(command, cwd=ROOT, stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def start_moving(board: PtyBoard, speed: int = 10) -> subprocess.Popen[bytes]:
    """A send that is well under way, and takes 14 s: on a busy machine, too, it is disturbed before its end."""
    sender = start_command("send", THREE_DOF, *POSE, "--port", board.port, "--speed", speed, "--assume-home")
    board.until(lambda: board.net[1] < -400, "under way")
    return sender


def on_the_path(net: Sequence[int]) -> None:
    """Between home and the pose, on the straight line."""
    assert 0.02 < net[1] / COUNTS[1] < 0.98
    on_the_line(net)


def on_the_line(net: Sequence[int]) -> None:
    """On the straight line from home to the pose, its ends included."""
    share = net[1] / COUNTS[1]
    assert 0 <= share <= 1
    for count, end in zip(net, COUNTS, strict=False):
        assert abs(count - share * end) <= 2


def finish_motion(board: PtyBoard) -> None:
    """The next command plans from where the arm stands."""
    completed = run_patiently("send", THREE_DOF, *POSE, "--port", board.port, "--json", run=run_process)
    assert completed.code == 0, completed.err
    assert completed.json["pulses"] == COUNTS
    assert board.net[:3] == COUNTS


def test_lost_then_assumed_then_known(board: PtyBoard) -> None:
    lost = run_process("send", THREE_DOF, *POSE, "--port", board.port)
    assert lost.code == 5
    assert "position is lost" in lost.err
    assert "--assume-home" in lost.err
    assert board.net[:3] == [0, 0, 0]
    first = run_process("send", THREE_DOF, 10, 80, -80, "--port", board.port, "--assume-home", "--json")
    assert first.code == 0, first.err
    again = run_process("send", THREE_DOF, *POSE, "--port", board.port, "--assume-home")
    assert again.code == 5
    assert "position is known" in again.err
    # From where it stands, and near to it: the other branch would be nearer to home.
    finish_motion(board)
    status = run_process("status", THREE_DOF, "--port", board.port, "--json").json
    assert (status["position"], status["pulses"], status["drivers_on"]) == ("known", COUNTS, True)


def test_a_changed_file_means_a_lost_position(board: PtyBoard, tmp_path: Path) -> None:
    assert run_process("send", THREE_DOF, 10, 80, -80, "--port", board.port, "--assume-home").code == 0
    mine = tmp_path / "mine.yaml"
    mine.write_text((ROOT / THREE_DOF).read_text().replace("limits: [-20, 120]", "limits: [-10, 120]"))
    completed = run_process("send", mine, *POSE, "--port", board.port)
    assert completed.code == 5
    assert "has changed" in completed.err
    assert run_process("status", THREE_DOF, "--port", board.port, "--json").json["position"] == "known"


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_stops_the_arm_first(board: PtyBoard, number: signal.Signals, code: int) -> None:
    sender = start_moving(board)
    sender.send_signal(number)
    output, err = sender.communicate(timeout=60)
    assert sender.returncode == code, err
    assert output == b""
    assert b"stopped: the arm stands at" in err
    assert board.state == State.IDLE
    on_the_path(board.net)
    finish_motion(board)


def test_a_killed_sender(board: PtyBoard) -> None:
    sender = start_moving(board)
    sender.kill()
    sender.communicate()
    board.wait(State.IDLE)
    net = board.net
    on_the_path(net)
    time.sleep(0.5)
    assert board.net == net
    finish_motion(board)


def test_a_cut_line(board: PtyBoard) -> None:
    sender = start_moving(board)
    board.cut = True
    board.wait(State.IDLE)
    net = board.net
    on_the_path(net)
    board.cut = False  # nothing resumes by itself
    _, err = sender.communicate(timeout=60)
    assert sender.returncode == 5, err
    assert b"the arm stands at" in err or b"does not answer any more" in err
    assert board.net == net
    finish_motion(board)


def test_stop_from_another_terminal(board: PtyBoard) -> None:
    sender = start_moving(board, speed=5)
    busy = run_process("send", THREE_DOF, *POSE, "--port", board.port)
    assert busy.code == 5
    assert f"process {sender.pid}" in busy.err
    stop = run_process("stop", "--port", board.port)
    assert stop.code == 0, stop.err
    _, err = sender.communicate(timeout=60)
    assert sender.returncode == 143, err
    assert board.state == State.IDLE
    assert "the arm stands" in stop.err  # the board itself was asked
    finish_motion(board)


def test_stop_beside_a_suspended_sender() -> None:
    seconds: list[float] = []
    while not seconds or (min(seconds) > 6 and len(seconds) < 5):  # a busy computer may be slow, once
        with PtyBoard() as board:
            sender = start_moving(board, speed=5)
            board.time.patience = math.inf  # the board, too, notices
            sender.send_signal(signal.SIGSTOP)
            began = time.monotonic()
            stop = run_process("stop", "--port", board.port)
            seconds.append(time.monotonic() - began)
            assert stop.code == 0, stop.err
            assert "the arm stands" in stop.err
            _, err = sender.communicate(timeout=60)
            if b"Write timeout" in err:  # suspended amid a write, whose time is over when it goes on
                seconds[-1] = math.inf
                continue
            assert sender.returncode == 143, err
            board.time.patience = 0.12
            finish_motion(board)
    assert min(seconds) < 6


def test_stop_without_a_sender(board: PtyBoard) -> None:
    assert run_process("send", THREE_DOF, 10, 80, -80, "--port", board.port, "--assume-home").code == 0
    assert run_process("stop", "--port", board.port).code == 0
    finish_motion(board)


def test_rows_that_trickle_in(board: PtyBoard) -> None:
    words = ("send", THREE_DOF, "--batch", "-", "--port", board.port, "--assume-home", "--json")
    sender = start_command(*words, stdin=subprocess.PIPE)
    assert sender.stdin is not None
    sender.stdin.write(b"1,89,-89\n")
    sender.stdin.flush()
    board.until(lambda: board.net[:3] == [36, -119, 67], "at the first row")  # before the second one is written
    time.sleep(0.7)
    assert board.net[:3] == [36, -119, 67]
    output, _ = sender.communicate(b"2,88,-88\n", timeout=60)
    assert sender.returncode == 0
    assert json.loads(output)["waypoints"] == 2
    assert board.net[:3] == [71, -239, 133]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_noisy_line(seed: int) -> None:
    """1 % of the bytes flipped and 1 % dropped, both ways: exact counts, or the arm stands on its path."""
    with PtyBoard(noise=0.01, seed=seed) as board:
        completed = run_process("send", THREE_DOF, *POSE, "--port", board.port, "--assume-home", "--json")
        if completed.code == 0:
            assert board.net[:3] == COUNTS
        else:  # a machine too busy to keep the queue filled: held, known, and it ends
            assert completed.code == 5
            assert "position is known" in completed.err
            on_the_line(board.net)


def test_a_board_behind_a_socket() -> None:
    board = SimBoard(BOARDS["uno_cnc_shield"])
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = f"socket://127.0.0.1:{server.getsockname()[1]}"

        def serve() -> None:
            line, _ = server.accept()
            with line, suppress(ConnectionError):  # the host hangs up when it has heard enough
                clock = Patient()
                while True:
                    ready, _, _ = select.select([line], [], [], 0.002)
                    data = line.recv(4096) if ready else b""
                    if ready and not data:
                        return
                    board.advance(clock.passed(heard=bool(data)))
                    board.receive(data)
                    line.sendall(board.take())

        thread = threading.Thread(target=serve)
        thread.start()
        completed = run("send", THREE_DOF, 10, 80, -80, "--port", port, "--assume-home", "--json")
        thread.join()
    assert completed.code == 0, completed.err
    assert board.net[:3] == completed.json["pulses"] == [356, -1193, 667]
