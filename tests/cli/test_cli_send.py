"""`armkin send` and its neighbours against the simulated board: in this process, and behind a real terminal."""

from __future__ import annotations

import csv
import json
import os
import pty
import select
import shutil
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

from armkin.board.firmware.protocol import State
from armkin.board.sim.board import SimBoard
from armkin.hardware import BOARDS
from command_line import ROOT, THREE_DOF, process, run
from pty_board import PtyBoard

POSE = (-30, 5, -5)
COUNTS = [-1067, -10144, 5667]


# ---- a board in this process


def test_the_first_command_just_works() -> None:
    done = run("send", THREE_DOF, *POSE, "--port", "sim")
    assert done.code == 0, done.err
    assert "-1067" in done.out
    assert "-10144" in done.out
    assert "5667" in done.out
    assert "starts with the arm in its home pose" in done.err
    assert done.out.endswith("read back: as planned, 1.917 s\n")


def test_json_tells_plan_and_arrival() -> None:
    answer = run("send", THREE_DOF, *POSE, "--port", "sim", "--json").json
    assert answer["robot_file"] == THREE_DOF
    assert len(answer["robot_sha256"]) == 64
    assert answer["pulses"] == COUNTS
    assert answer["moves"] == COUNTS
    assert answer["start_joints"] == pytest.approx([0, 90, -90])
    assert answer["joints"] == pytest.approx([-30.009375, 4.998371, -4.995], abs=1e-6)
    assert answer["position"] == "known"
    assert answer["duration_s"] == pytest.approx(1.917, abs=0.002)
    assert answer["top_speed"] == pytest.approx([21.18, 60, 60], abs=0.01)


def test_a_target_goes_through_ik() -> None:
    done = run("send", THREE_DOF, "--target", "390,80,300", "--port", "sim", "--json")
    assert done.json["position_mm"] == pytest.approx([390, 80, 300], abs=0.06)


def test_a_named_branch_is_taken() -> None:
    branches = run("ik", THREE_DOF, 390, 80, 300, "--all-branches", "--json").json["branches"]
    legal = [branch for branch in branches if branch["within_limits"]]
    assert len(legal) >= 2
    for branch in legal[:2]:
        done = run("send", THREE_DOF, "--target", "390,80,300", "--branch", branch["name"], "--port", "sim", "--json")
        assert done.json["joints"] == pytest.approx(branch["joints"], abs=0.02)


def test_a_target_out_of_reach_is_exit_3_and_moves_nothing() -> None:
    done = run("send", THREE_DOF, "--target", "3900,80,300", "--port", "sim", "--json")
    assert (done.code, done.out) == (3, "")
    assert "cannot reach" in done.err


@pytest.mark.parametrize("words", [("fk", *POSE), ("pulses", *POSE), ("ik", 390, 80, 300)])
def test_answers_can_be_piped_in(words: Sequence[object]) -> None:
    command, *numbers = words
    answer = run(command, THREE_DOF, *numbers, "--json")
    done = run("send", "--port", "sim", "--json", stdin=answer.out.encode())
    assert done.code == 0, done.err
    sent = answer.json if command != "ik" else answer.json["branches"][answer.json["best"]]
    assert done.json["joints"] == pytest.approx(sent["joints"], abs=0.02)


def test_many_answers_can_be_piped_in(tmp_path: Path) -> None:
    rows = tmp_path / "targets.csv"
    rows.write_text("390,80,300\n380,60,280\n")
    answers = run("ik", THREE_DOF, "--batch", rows, "--json")
    done = run("send", "--port", "sim", "--json", stdin=answers.out.encode())
    assert done.json["waypoints"] == 2
    assert done.json["position_mm"] == pytest.approx([380, 60, 280], abs=0.06)


def test_an_answer_without_a_best_branch_is_refused() -> None:
    answer = run("ik", THREE_DOF, 3900, 80, 300, "--json")
    done = run("send", "--port", "sim", stdin=answer.out.encode())
    assert (done.code, done.out) == (3, "")
    assert "no branch within limits" in done.err


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("best", False, "damaged"),
        ("branches", [1], "no joints to send"),
        ("branches", [None], "no joints to send"),
        ("pulses", [1, 2, 3.5], "damaged"),
        ("pulses", ["1", "2", "3"], "damaged"),
        ("pulses", [True, False, True], "damaged"),
        ("joints", [10**400, 0, 0], "finite"),
        ("joints", [float("nan"), 0, 0], "finite"),
    ],
)
def test_a_damaged_answer_is_refused(key: str, value: object, message: str) -> None:
    words = ("ik", THREE_DOF, 390, 80, 300) if key in ("best", "branches") else ("pulses", THREE_DOF, *POSE)
    answer = {**run(*words, "--json").json, key: value}
    if key == "joints":
        del answer["pulses"]
    done = run("send", "--port", "sim", stdin=json.dumps(answer).encode())
    assert (done.code, done.out) == (2, "")
    assert message in done.err


def test_an_answer_may_begin_with_a_byte_order_mark() -> None:
    answer = run("fk", THREE_DOF, *POSE, "--json")
    assert run("send", "--dry-run", stdin=b"\xef\xbb\xbf" + answer.out.encode()).code == 0


def test_a_changed_robot_file_is_noticed(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    shutil.copy(ROOT / THREE_DOF, mine)
    answer = run("fk", mine, *POSE, "--json")
    mine.write_text(mine.read_text() + "# a comment\n")
    done = run("send", "--port", "sim", stdin=answer.out.encode())
    assert (done.code, done.out) == (1, "")
    assert "has changed" in done.err


@pytest.mark.parametrize(
    ("stdin", "message"),
    [
        (b"", "standard input is empty"),
        (b"q1 = 5\n", "no JSON"),
        (b"[1, 2]", "names no robot_file"),
        (b'{"robot_file": "robots/three_dof.yaml", "robot_sha256": 5, "joints": [1, 2, 3]}', "names no robot_file"),
        (b"\xff\xfe{\x00}\x00", "no JSON"),
    ],
)
def test_what_is_no_answer_is_refused(stdin: bytes, message: str) -> None:
    done = run("send", "--port", "sim", stdin=stdin)
    assert (done.code, done.out) == (2, "")
    assert message in done.err


def test_nothing_to_send_and_a_terminal_as_input() -> None:
    master, slave = pty.openpty()
    try:
        done = process("send", "--port", "sim", stdin=slave)
    finally:
        os.close(master)
        os.close(slave)
    assert done.code == 2
    assert "nothing to send" in done.err


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ((THREE_DOF, 0, 130, 0, "--port", "sim"), 3, "q2 = 130 deg is outside -20 to 120 deg"),
        ((THREE_DOF, 0, 90, "--port", "sim"), 2, "takes 3 numbers"),
        ((THREE_DOF, *POSE), 2, "--port is missing"),
        ((THREE_DOF, *POSE, "--port", "/dev/ttyNOWHERE"), 5, "there is no port /dev/ttyNOWHERE"),
        ((THREE_DOF, *POSE, "--port", "/dev/null"), 5, "/dev/null is no serial port; armkin ports lists them"),
        ((THREE_DOF, *POSE, "--port", "robots"), 5, "robots is no serial port"),
        ((THREE_DOF, *POSE, "--port", "socket://127.0.0.1:1"), 5, "nobody listens there"),
        ((THREE_DOF, *POSE, "--port", "sim", "--speed", "0"), 2, "from 0.01 to 100"),
        ((THREE_DOF, *POSE, "--port", "sim", "--speed", "fast"), 2, "--speed: 'fast' is not a number"),
        ((THREE_DOF, *POSE, "--port", "sim", "--target", "1,2,3"), 2, "give one of them"),
        ((THREE_DOF, *POSE, "--port", "sim", "--branch", "left"), 2, "belong to --target"),
        ((THREE_DOF, *POSE, "--port", "sim", "--from", "0,0,0"), 2, "belongs to --dry-run"),
        (("robots/planar_2dof.yaml", 10, 10, "--port", "sim"), 2, "joints q1, q2 have no max_speed"),
        (("robots/puma560.yaml", 0, 0, 0, 0, 0, 0, "--port", "sim"), 2, "have no drive"),
    ],
)
def test_refusals(words: Sequence[object], code: int, message: str) -> None:
    done = run("send", *words)
    assert (done.code, done.out) == (code, "")
    assert message in done.err


def test_a_dry_run_moves_nothing_and_needs_no_port() -> None:
    done = run("send", THREE_DOF, *POSE, "--dry-run", "--json")
    assert done.code == 0
    assert done.json["dry_run"] is True
    assert done.json["moves"] == COUNTS
    text = run("send", THREE_DOF, *POSE, "--dry-run")
    assert "nothing moves" in text.out
    assert "-10144" in text.out
    back = run("send", THREE_DOF, 0, 90, -90, "--dry-run", "--from", "-30,5,-5", "--json")
    assert back.json["moves"] == [-count for count in COUNTS]


def test_half_the_speed() -> None:
    slow = run("send", THREE_DOF, *POSE, "--dry-run", "--speed", "50", "--json").json
    assert slow["top_speed"] == pytest.approx([10.59, 30, 30], abs=0.01)
    assert slow["duration_s"] > 3


def test_a_trace_is_the_path_as_csv(tmp_path: Path) -> None:
    path = tmp_path / "trace.csv"
    assert run("send", THREE_DOF, *POSE, "--dry-run", "--trace", path).code == 0
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert list(rows[0])[:5] == ["time_s", "q1", "q2", "q3", "q1_x_mm"]
    assert list(rows[0])[-1] == "tool_z_mm"
    times = [float(row["time_s"]) for row in rows]
    assert times == sorted(times)
    assert float(rows[0]["q2"]) == pytest.approx(90)
    assert float(rows[-1]["q2"]) == pytest.approx(4.99837, abs=1e-4)
    assert float(rows[-1]["tool_x_mm"]) == pytest.approx(398.357, abs=1e-3)
    assert float(rows[0]["q1_z_mm"]) == 170


def test_a_file_of_waypoints(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("q1,q2,q3\n10,80,-80\n# a comment\n-20,60,-60\n-30,5,-5\n")
    done = run("send", THREE_DOF, "--batch", path, "--port", "sim", "--json")
    assert done.code == 0, done.err
    assert done.json["waypoints"] == 3
    assert done.json["pulses"] == COUNTS


def test_a_file_with_one_row_outside_moves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("10,80,-80\n0,130,0\n")
    done = run("send", THREE_DOF, "--batch", path, "--port", "sim")
    assert (done.code, done.out) == (3, "")
    assert "row 2: q2 = 130" in done.err


@pytest.mark.parametrize(
    ("last", "code", "message"), [(b"x,5,-5\n", 2, "row 3"), (b"0,130,0\n", 3, "row 3: q2 = 130"), (b"", 0, "")]
)
def test_streamed_waypoints_stand_up_to_the_first_wrong_one(last: bytes, code: int, message: str) -> None:
    done = run("send", THREE_DOF, "--batch", "-", "--port", "sim", "--json", stdin=b"10,80,-80\n-30,5,-5\n" + last)
    assert done.code == code, done.err
    assert done.json["pulses"] == COUNTS
    assert message in done.err


def test_grip() -> None:
    closed = run("grip", THREE_DOF, "closed", "--port", "sim", "--json")
    assert closed.json["counts"] == 1833
    assert run("grip", THREE_DOF, 75, "--port", "sim", "--json").json["counts"] == 1333
    assert run("grip", THREE_DOF, 30, "--port", "sim").out == "gripper: 29.97 deg (833 us)\n"
    assert run("grip", THREE_DOF, 130, "--port", "sim").code == 2
    assert "have no max_speed" in run("grip", "robots/planar_2dof.yaml", "open", "--port", "sim").err


def test_jog() -> None:
    done = run("jog", THREE_DOF, "q1", -30, "--port", "sim", "--seconds", "0.5", "--json")
    assert done.code == 0, done.err
    assert -20 < done.json["joints"][0] < -13
    assert done.json["joints"][1:] == pytest.approx([90, -90])
    assert run("jog", THREE_DOF, "q9", 5, "--port", "sim").code == 2
    assert run("jog", THREE_DOF, "q1", 61, "--port", "sim").code == 2


def test_status_of_a_board_that_knows_nothing() -> None:
    answer = run("status", THREE_DOF, "--port", "sim", "--json").json
    assert (answer["position"], answer["joints"], answer["configured"]) == ("lost", None, False)
    assert answer["state"] == "idle"
    assert "its position is lost" in run("status", THREE_DOF, "--port", "sim").out


def test_home_without_switches_is_refused_by_name() -> None:
    done = run("home", THREE_DOF, "--port", "sim")
    assert done.code == 2
    assert "no homing: for q1, q2, q3" in done.err


def test_ports_and_stop() -> None:
    assert run("ports", "--json").json["ports"] is not None
    assert run("stop", "--port", "sim").code == 2


# ---- behind a terminal, in real time


def test_a_line_that_never_falls_silent_leaves_time_for_a_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    """One read gives back what it has; the clock and Ctrl-C are looked at between reads."""
    from armkin.board.ports import SerialPort

    class Flood:
        in_waiting, given = 1000, 0

        def read(self, size: int) -> bytes:
            self.given += size
            assert self.given < 100_000, "one read does not come to an end"
            return b"A" * size

        def close(self) -> None:
            pass

    monkeypatch.setattr("armkin.board.ports.serial_port._open_serial", lambda *given: Flood())
    port = SerialPort("flood")
    assert len(port.read(0.1)) >= 1000
    port.close()


@pytest.fixture
def board() -> Iterator[PtyBoard]:
    with PtyBoard() as one:
        yield one


def started(*words: object) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "armkin", *map(str, words)], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def moving(board: PtyBoard, *words: object) -> subprocess.Popen[bytes]:
    """A send that is well under way."""
    sender = started("send", THREE_DOF, *POSE, "--port", board.port, "--speed", 40, *words)
    board.wait(State.MOVING, 20)
    time.sleep(0.7)
    return sender


def on_the_path(net: Sequence[int]) -> None:
    """Between home and the pose, on the straight line."""
    share = net[1] / COUNTS[1]
    assert 0.02 < share < 0.98
    for count, end in zip(net, COUNTS, strict=False):
        assert abs(count - share * end) <= 2


def finish(board: PtyBoard) -> None:
    """The next command plans from where the arm stands."""
    done = process("send", THREE_DOF, *POSE, "--port", board.port, "--json")
    assert done.code == 0, done.err
    assert done.json["pulses"] == COUNTS
    assert board.net[:3] == COUNTS


def test_lost_then_assumed_then_known(board: PtyBoard) -> None:
    lost = process("send", THREE_DOF, *POSE, "--port", board.port)
    assert lost.code == 5
    assert "position is lost" in lost.err
    assert "--assume-home" in lost.err
    assert board.net[:3] == [0, 0, 0]
    first = process("send", THREE_DOF, 10, 80, -80, "--port", board.port, "--assume-home", "--json")
    assert first.code == 0, first.err
    again = process("send", THREE_DOF, *POSE, "--port", board.port, "--assume-home")
    assert again.code == 5
    assert "position is known" in again.err
    # From where it stands, and near to it: the other branch would be nearer to home.
    finish(board)
    status = process("status", THREE_DOF, "--port", board.port, "--json").json
    assert (status["position"], status["pulses"], status["drivers_on"]) == ("known", COUNTS, True)


def test_a_changed_file_means_a_lost_position(board: PtyBoard, tmp_path: Path) -> None:
    assert process("send", THREE_DOF, 10, 80, -80, "--port", board.port, "--assume-home").code == 0
    mine = tmp_path / "mine.yaml"
    mine.write_text((ROOT / THREE_DOF).read_text().replace("limits: [-20, 120]", "limits: [-10, 120]"))
    done = process("send", mine, *POSE, "--port", board.port)
    assert done.code == 5
    assert "has changed" in done.err
    assert process("status", THREE_DOF, "--port", board.port, "--json").json["position"] == "known"


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_stops_the_arm_first(board: PtyBoard, number: signal.Signals, code: int) -> None:
    sender = moving(board, "--assume-home")
    sender.send_signal(number)
    out, err = sender.communicate(timeout=20)
    assert sender.returncode == code
    assert out == b""
    assert b"stopped: the arm stands at" in err
    assert board.state == State.IDLE
    on_the_path(board.net)
    finish(board)


def test_a_killed_sender(board: PtyBoard) -> None:
    sender = moving(board, "--assume-home")
    sender.kill()
    sender.communicate()
    board.wait(State.IDLE)
    net = board.net
    on_the_path(net)
    time.sleep(0.5)
    assert board.net == net
    finish(board)


def test_a_cut_line(board: PtyBoard) -> None:
    sender = moving(board, "--assume-home")
    board.cut = True
    board.wait(State.IDLE)
    net = board.net
    on_the_path(net)
    board.cut = False  # nothing resumes by itself
    _, err = sender.communicate(timeout=20)
    assert sender.returncode == 5
    assert b"the arm stands at" in err or b"does not answer any more" in err
    assert board.net == net
    finish(board)


def test_stop_from_another_terminal(board: PtyBoard) -> None:
    sender = moving(board, "--assume-home", "--speed", 5)
    busy = process("send", THREE_DOF, *POSE, "--port", board.port)
    assert busy.code == 5
    assert f"process {sender.pid}" in busy.err
    stop = process("stop", "--port", board.port)
    assert stop.code == 0, stop.err
    sender.communicate(timeout=20)
    assert sender.returncode == 143
    assert board.state == State.IDLE
    assert "the arm stands" in stop.err  # the board itself was asked
    finish(board)


def test_stop_beside_a_suspended_sender(board: PtyBoard) -> None:
    sender = moving(board, "--assume-home", "--speed", 5)
    sender.send_signal(signal.SIGSTOP)
    began = time.monotonic()
    stop = process("stop", "--port", board.port)
    assert stop.code == 0, stop.err
    assert time.monotonic() - began < 6  # with both programs' start on a busy computer
    assert "the arm stands" in stop.err
    sender.communicate(timeout=20)
    assert sender.returncode == 143
    finish(board)


def test_stop_without_a_sender(board: PtyBoard) -> None:
    assert process("send", THREE_DOF, 10, 80, -80, "--port", board.port, "--assume-home").code == 0
    assert process("stop", "--port", board.port).code == 0
    finish(board)


def test_rows_that_trickle_in(board: PtyBoard) -> None:
    sender = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "armkin",
            "send",
            THREE_DOF,
            "--batch",
            "-",
            "--port",
            board.port,
            "--assume-home",
            "--json",
        ],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert sender.stdin is not None
    sender.stdin.write(b"1,89,-89\n")
    sender.stdin.flush()
    board.wait(State.MOVING, 20)  # the first row moves before the second one is written
    board.wait(State.IDLE)
    time.sleep(0.7)
    assert board.net[:3] == [36, -119, 67]
    out, _ = sender.communicate(b"2,88,-88\n", timeout=20)
    assert sender.returncode == 0
    assert json.loads(out)["waypoints"] == 2
    assert board.net[:3] == [71, -239, 133]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_noisy_line(seed: int) -> None:
    """1 % of the bytes flipped and 1 % dropped, both ways: exact counts, or the arm stands on its path."""
    with PtyBoard(noise=0.01, seed=seed) as board:
        done = process("send", THREE_DOF, *POSE, "--port", board.port, "--assume-home", "--json")
        if done.code == 0:
            assert board.net[:3] == COUNTS
        else:  # a machine too busy to keep the queue filled: held, known, and it ends
            assert done.code == 5
            assert "position is known" in done.err
            on_the_path(board.net)


def test_a_board_behind_a_socket() -> None:
    board = SimBoard(BOARDS["uno_cnc_shield"])
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = f"socket://127.0.0.1:{server.getsockname()[1]}"

        def serve() -> None:
            line, _ = server.accept()
            with line, suppress(ConnectionError):  # the host hangs up when it has heard enough
                last = time.monotonic()
                while True:
                    ready, _, _ = select.select([line], [], [], 0.002)
                    data = line.recv(4096) if ready else b""
                    if ready and not data:
                        return
                    now = time.monotonic()
                    board.advance(min(now - last, 0.2))
                    last = now
                    board.receive(data)
                    line.sendall(board.take())

        thread = threading.Thread(target=serve)
        thread.start()
        done = run("send", THREE_DOF, 10, 80, -80, "--port", port, "--assume-home", "--json")
        thread.join()
    assert done.code == 0, done.err
    assert board.net[:3] == done.json["pulses"] == [356, -1193, 667]


# ---- planning needs no board


def _movable() -> list[Path]:
    """Shipped and test robots with drives and rates, whatever their board."""
    found = []
    for path in sorted((ROOT / "robots").glob("*.yaml")) + sorted((ROOT / "tests" / "robots").glob("*.yaml")):
        text = path.read_text()
        if "full_steps" in text or "kind: servo" in text:
            found.append(path)
    return found


@pytest.mark.parametrize("path", _movable(), ids=lambda path: path.stem)
def test_every_robot_with_drives_is_rehearsed_or_told_all_that_is_missing(path: Path) -> None:
    import armkin
    from armkin.board.firmware.needs import missing

    arm = armkin.load(path)
    home = ",".join(str(x) for x in armkin.pulses(arm, arm.home))
    assert home
    values = [float(x) for x in (arm.home / [1.0 if slides else 0.0174532925199433 for slides in arm.prismatic])]
    goal = [value + 1 if value < 50 else value - 1 for value in values]
    for words in (("--dry-run",), ("--port", "sim")):
        done = run("send", path, *goal, "--json", *words)
        lacks = missing(arm, board=False)
        if lacks:
            assert done.code == 2
            assert all(lack in done.err for lack in lacks)
            assert "max_accel: 60 " in done.err
        else:
            assert done.code == 0, done.err
            assert done.json["joints"] == pytest.approx(goal, abs=0.2)


def test_a_real_port_still_needs_a_board_and_all_is_said_at_once(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    text = (ROOT / THREE_DOF).read_text()
    mine.write_text(text[: text.index("board: {kind")].replace("    max_accel: 120\n", "", 1))
    done = run("send", mine, *POSE, "--port", tmp_path / "none")
    assert done.code == 2
    for words in (
        "joint q1 has no max_accel",
        "it has no board",
        "max_accel: 60 ",
        "board: {kind: uno_cnc_shield, driver: A4988}",
    ):
        assert words in done.err


def test_a_redundant_arm_is_sent_to_a_target_with_a_joint_held(tmp_path: Path) -> None:
    lines = []
    for line in (ROOT / "robots/panda.yaml").read_text().splitlines():
        lines.append(line)
        if line.startswith("    max_speed:"):
            lines += ["    max_accel: 100", "    drive: {full_steps: 200, microsteps: 16, gear: 50}"]
    path = tmp_path / "panda.yaml"
    path.write_text("\n".join(lines))
    words = ("send", path, "--target", "400,0,400,180,0,0", "--dry-run", "--json")
    assert "--lock JOINT=VALUE" in run(*words).err
    done = run(*words, "--lock", "J3=20")
    assert done.code == 0, done.err
    assert done.json["joints"][2] == pytest.approx(20, abs=0.01)
    assert done.json["position_mm"] == pytest.approx([400, 0, 400], abs=0.1)
    alone = run("send", THREE_DOF, 0, 90, -90, "--lock", "q1=1", "--dry-run")
    assert (alone.code, alone.out) == (2, "")
    assert "--branch, --task, --near and --lock belong to --target" in alone.err


def test_a_ramp_of_many_segments_does_not_run_dry(tmp_path: Path) -> None:
    """27 segments of a ramp and frames of 6 left 26 in a queue of 32: DRY where the ramp began."""
    path = tmp_path / "path.csv"
    path.write_text("q1,q2,q3\n0.0258,24.2795,-38.6976\n43.2443,77.0574,-19.3756\n42.6755,76.9006,-18.9291\n")
    done = run("send", THREE_DOF, "--batch", path, "--port", "sim", "--speed", "70", "--json")
    assert done.code == 0, done.err
