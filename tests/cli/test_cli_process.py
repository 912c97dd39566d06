"""What only a process of its own shows: pipes, signals, full disks, exit codes of the interpreter."""

import os
import pty
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from command_line import ROOT, THREE_DOF, run, run_process

ARMKIN = [sys.executable, "-m", "armkin"]
MANY = b"1,2,3\n" * 20_000


def test_a_process_ends_with_the_exit_code() -> None:
    assert run_process("fk", THREE_DOF, -30, 5, -5).code == 0
    assert run_process("fk", THREE_DOF, -30, 5).code == 2
    assert run_process("ik", THREE_DOF, 900, 0, 0).code == 3


def test_head_has_seen_enough(tmp_path: Path) -> None:
    (tmp_path / "in.csv").write_bytes(MANY)
    command = [*ARMKIN, "fk", THREE_DOF, "--batch", str(tmp_path / "in.csv")]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as p:
        assert p.stdout is not None
        assert p.stderr is not None
        assert p.stdout.readline().startswith(b"q1,q2,q3,x,y,z")
        p.stdout.close()
        assert p.wait(60) == 0
        assert p.stderr.read() == b""


@pytest.mark.parametrize("words", [["fk", THREE_DOF, "1", "2", "3"], ["schema"], ["--help"], ["--version"]])
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_full_disk(words: list[str], unbuffered: str) -> None:
    with open("/dev/full", "wb") as full:
        settings = {"stdout": full, "stderr": subprocess.PIPE, "capture_output": False}
        completed = run_process(*words, env={**os.environ, "PYTHONUNBUFFERED": unbuffered}, **settings)
    assert completed.code == 1
    assert completed.err == "error: standard output: No space left on device\n"


def test_a_closed_stdout() -> None:
    completed = run_process("fk", THREE_DOF, 1, 2, 3, preexec_fn=lambda: os.close(1))
    assert completed.code == 1
    assert "standard output is closed" in completed.err


def test_a_closed_stderr_and_stdin() -> None:
    def close() -> None:
        os.close(0)
        os.close(2)

    assert run_process("fk", THREE_DOF, 1, 2, preexec_fn=close).code == 2
    assert run_process("fk", THREE_DOF, "--batch", "-", preexec_fn=close).code == 1


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signals(number: int, code: int, tmp_path: Path) -> None:
    command = [*ARMKIN, "fk", THREE_DOF, "--batch", "-", "--out", str(tmp_path / "out")]
    with subprocess.Popen(
        command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as p:
        assert p.stdin is not None
        assert p.stderr is not None
        p.stdin.write(b"1,2,3\n" * 100_000)  # several chunks
        p.stdin.flush()
        end = time.monotonic() + 60
        while not (tmp_path / "out.parts" / "00000000").exists():  # it has begun to write
            assert time.monotonic() < end
            time.sleep(0.01)
        p.send_signal(number)
        assert p.wait(60) == code
        assert p.stderr.read() == b""
        p.stdin.close()
    assert [path.name for path in tmp_path.iterdir()] == ["out.parts"]  # what is finished, to go on with


def on_a_terminal(words: list[str], stdin: bytes, **environment: str) -> str:
    """What a command writes to stderr if that is a terminal."""
    master, slave = pty.openpty()
    env = {**os.environ, "TERM": "xterm", **environment}
    with subprocess.Popen(
        [*ARMKIN, *words], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=slave, env=env
    ) as p:
        os.close(slave)
        p.communicate(stdin)
    shown = b""
    while True:
        try:
            part = os.read(master, 65536)
        except OSError:
            break
        if not part:
            break
        shown += part
    os.close(master)
    return shown.decode()


def test_colours_and_progress_on_a_terminal_only() -> None:
    batch = ["fk", THREE_DOF, "--batch", "-"]
    plain = run_process(*batch, input=MANY, env={**os.environ, "NO_COLOR": ""})
    assert plain.err == ""
    shown = on_a_terminal(batch, 10 * MANY, NO_COLOR="")
    assert " rows" in shown
    assert "100 %  8 of 8 samples" in on_a_terminal(["workspace", "robots/pan_tilt.yaml", "--grid", "2,4"], b"")
    moving = on_a_terminal(["send", THREE_DOF, "-30", "5", "-5", "--port", "sim"], b"")
    percent = [int(figure) for figure in re.findall(r"(\d+) %", moving)]
    assert percent == sorted(percent)
    assert percent[-1] == 100  # what takes less than 0.2 s shows no more
    assert "\x1b[31merror:" in on_a_terminal(["fk", THREE_DOF, "1"], b"", NO_COLOR="")
    assert "\x1b[31m" not in on_a_terminal(["fk", THREE_DOF, "1"], b"", NO_COLOR="1")


def test_an_ascii_terminal_can_show_everything() -> None:
    env = {**os.environ, "PYTHONIOENCODING": "ascii", "LC_ALL": "C"}
    assert run_process("info", THREE_DOF, env=env).code == 0
    assert run_process("fk", "\u00e9\udcff.yaml", 1, env=env).code == 1


@pytest.mark.parametrize("words", [[], ["help"], ["--help"], ["help", "fk"], ["info", THREE_DOF]])
def test_nobody_reads(words: list[str]) -> None:
    read, write = os.pipe()
    os.close(read)
    try:
        completed = run_process(*words, stdout=write, stderr=subprocess.PIPE, capture_output=False)
    finally:
        os.close(write)
    assert (completed.code, completed.err) == (0, "")


def test_bare_and_help_print_the_help() -> None:
    bare = run_process()
    assert "Commands:" in bare.out
    assert bare == run() == run("help") == run("--help")
    assert bare.code == 0
    assert run("help", "fk") == run("fk", "--help")


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-8"])
def test_a_terminal_of_any_encoding(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.yaml"
    text = (ROOT / THREE_DOF).read_text().replace("name: three_dof", "name: Ωmega → 3")
    path.write_text(text, encoding="utf-8")
    environment = {**os.environ, "PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    for words in (["info", path], ["fk", path, 0, 0, 0], ["--help"]):
        completed = run_process(*words, env=environment)
        assert (completed.code, completed.err) == (0, "")
    name = run_process("fk", path, 0, 0, 0, "--json", env=environment).json["robot"]
    assert name == "Ωmega → 3"


def test_out_dash_is_standard_output(tmp_path: Path) -> None:
    for words in (["fk", "1", "2", "3", "--json"], ["pulses", "1", "2", "3"], ["info"]):
        words.insert(1, str(ROOT / THREE_DOF))
        assert run(*words, "--out", "-", cwd=tmp_path) == run(*words, cwd=tmp_path)
    assert run_process("schema", "-o", "-", cwd=tmp_path).out.startswith("{")
    assert not list(tmp_path.iterdir())
