"""Signals end a command silently, with its exit code, and leave nothing behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from armkin.cli.parsing.csv_to_numbers import CsvColumns
from command_line import ROOT

ARMKIN = [sys.executable, "-m", "armkin"]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
@pytest.mark.parametrize(("number", "code"), [("SIGHUP", 129), ("SIGTERM", 143), ("SIGINT", 130)])
@pytest.mark.parametrize("times", [1, 2])
def test_a_file_that_is_half_written_is_none(number: str, code: int, times: int, tmp_path: Path) -> None:
    rows = tmp_path / "rows.csv"
    rows.write_text("1,2,3\n" * 1_500_000)  # 15 s: it is not done before it is told to end
    command = [*ARMKIN, "fk", str(ROOT / "robots/three_dof.yaml"), "--batch", str(rows), "--out", "out.csv"]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE)
    end = time.monotonic() + 60
    while not (tmp_path / "out.csv.parts" / "00000000").exists():
        assert time.monotonic() < end
        time.sleep(0.01)
    time.sleep(0.2)
    for _ in range(times):
        process.send_signal(getattr(signal, number))
    assert process.communicate(timeout=60)[1] == b""
    assert process.returncode == code
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.csv.parts", "rows.csv"]
    sizes = {path.stat().st_size for path in (tmp_path / "out.csv.parts").glob("0*")}
    assert len(sizes) == 1  # finished parts, with which --resume goes on; of the one in hand nothing is left


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
def test_signals_while_rows_are_read_are_not_lost() -> None:
    """pyarrow's reader lost one in twenty: a command that was told to end went on to its end, with exit code 0."""
    columns = CsvColumns(("q1", "q2", "q3"), "pose")
    columns.first_row_read = True
    text = b"1,2,3\n" * 16_000
    received: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: received.append(number))
    try:
        for delay in np.random.default_rng(7).uniform(0, 0.004, 100):
            sender = threading.Timer(delay, os.kill, (os.getpid(), signal.SIGTERM))
            sender.start()
            while sender.is_alive():
                assert columns.all_plain(text) is not None
    finally:
        signal.signal(signal.SIGTERM, before)
    assert len(received) == 100


@pytest.mark.skipif(sys.platform == "win32", reason="a POSIX shell")
@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ("--version >&-", 1, "standard output is closed"),
        ("fk three_dof 0 0 0 >&-", 1, "standard output is closed"),
        ("robots > /dev/full", 1, "No space left on device"),
        ("fk three_dof --batch - <&-", 1, "standard input is closed"),
    ],
)
def test_streams_that_are_not_there_are_named(words: str, code: int, message: str) -> None:
    completed = subprocess.run(["sh", "-c", f"exec {sys.executable} -m armkin {words}"], capture_output=True, text=True)
    assert completed.returncode == code
    assert message in completed.stderr
    assert "internal error" not in completed.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="a POSIX shell")
@pytest.mark.parametrize(
    "words",
    [
        "send three_dof --batch - --port sim",
        "send three_dof --batch - --dry-run",
        "send --port sim",
        "fk three_dof --batch -",
        "ik three_dof",
        "path three_dof -",
        "new x --convention standard --batch - --out x.yaml",
    ],
)
def test_standard_input_that_cannot_be_read_is_named(words: str, tmp_path: Path) -> None:
    """Opened for writing only: every read fails. A thread that reads must not leave its command waiting."""
    command = f"exec {sys.executable} -m armkin {words} 0>unreadable"
    completed = subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=180, cwd=tmp_path)
    assert completed.returncode == 1
    assert "standard input: cannot read: " in completed.stderr
    assert "Traceback" not in completed.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["unreadable"]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
def test_ctrl_c_while_modules_are_imported_is_silent() -> None:
    """Later and later, from the first own line on: nothing is printed, whatever is being imported."""
    began = time.monotonic()
    subprocess.run([*ARMKIN, "fk", "three_dof", "home"], check=True, capture_output=True)
    duration = time.monotonic() - began
    # the garbage collector's setting is the first thing that it does with signals taken
    program = "import armkin.cli, gc, types; tell = lambda *numbers: print(flush=True)\n"
    program += "armkin.cli.gc = types.SimpleNamespace(set_threshold=tell); armkin.cli.main()"
    for i in range(12):
        command = [sys.executable, "-c", program, "fk", "three_dof", "home"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(0.005 + duration * i / 12)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=60)
        assert error == b""
        assert process.returncode in (0, 130)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
@pytest.mark.parametrize(("number", "code"), [("SIGTERM", 143), ("SIGINT", 130)])
@pytest.mark.parametrize("where", ["class Half: late = Late()", "weakref.ref(Late(), Late.send)"])
def test_a_signal_while_a_class_is_made_in_an_import(where: str, number: str, code: int, tmp_path: Path) -> None:
    """Python 3.11 makes a RuntimeError of it there, and drops what a weak reference's callback raises."""
    (tmp_path / "numpy.py").write_text(f"""
import os, signal, sys, weakref
class Late:
    def __set_name__(self, owner, name): self.send()
    def send(self): os.kill(os.getpid(), signal.{number})
{where}
sys.path.remove({str(tmp_path)!r}); del sys.modules["numpy"]
import numpy
""")
    command = [*ARMKIN, "fk", str(ROOT / "robots/three_dof.yaml"), "--batch", "-"]  # waits for rows
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, env=environment, stdin=pipe, stderr=pipe) as process:
        assert process.wait(timeout=60) == code
        assert process.stderr is not None
        assert process.stderr.read() == b""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
def test_a_signal_while_a_plan_imports_a_module_with_a_port_open(tmp_path: Path) -> None:
    (tmp_path / "half.py").write_text("""
import os, signal
class Late:
    def __set_name__(self, owner, name): os.kill(os.getpid(), signal.SIGINT)
class Half: late = Late()
""")
    program = "import time; from armkin.board.stop_signals import planning, stoppable\n"
    program += "with stoppable(), planning():\n    import half\n    time.sleep(60)"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    completed = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, env=environment
    )
    assert (completed.returncode, completed.stderr) == (130, "")


def test_the_command_line_imports_next_to_nothing_before_it_takes_signals() -> None:
    program = "import sys; before = set(sys.modules); import armkin.cli; print(*sorted(set(sys.modules) - before))"
    program = f"import sys; sys.path.insert(0, {str(ROOT / 'src')!r}); {program}"
    completed = subprocess.run([sys.executable, "-S", "-c", program], capture_output=True, text=True, check=True)
    assert "typing" not in completed.stdout.split()
    assert len(completed.stdout.split()) < 20


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
def test_ctrl_c_while_a_board_waits_for_the_plan_of_20_000_waypoints(tmp_path: Path) -> None:
    """It took until the plan was whole, 16 s; nothing moves then, so that there is nothing to wait for."""
    turns = np.cumsum(np.random.default_rng(1).choice([-1.0, 1.0], 20_000)) % 90
    rows = "".join(f"{a:.1f},{90 - a / 3:.1f},{-90 + a / 5:.1f}\n" for a in turns)
    (tmp_path / "rows.csv").write_text(rows)
    command = [*ARMKIN, "send", str(ROOT / "robots/three_dof.yaml"), "--batch", "rows.csv", "--port", "sim"]
    process = subprocess.Popen([*command, "--blend", "3"], cwd=tmp_path, stderr=subprocess.PIPE)
    assert process.stderr is not None
    assert b"simulated board" in process.stderr.readline()  # the port is open, and planning begins
    time.sleep(0.3)
    began = processor_seconds(process.pid)
    process.send_signal(signal.SIGINT)
    with process.stderr:
        assert b"stopped" in process.stderr.read()
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 130
    assert used.ru_utime + used.ru_stime - began < 2.0


def processor_seconds(process: int) -> float:
    """What a process has used so far (proc(5): fields 14 and 15)."""
    words = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
