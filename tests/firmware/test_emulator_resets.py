"""The emulated board itself, with a program whose every edge is known (probe.c): resets, memory, mistakes."""

from __future__ import annotations

import json
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import pytest
import serial
from emulator import CLOCK_HZ, BoardError, build_simulator, compile_program
from probing import MS, PROBE, ask_probe, start_probe, stepped_board


def test_resets_set_their_flag_and_only_power_clears_memory(probe: Path) -> None:
    with stepped_board(probe) as board:
        start_probe(board)
        assert board.run(5 * MS, b"r") == b"01 0001 1\n"
        for kind, answer in (
            ("external", b"02 0002 0\n"),
            ("watchdog", b"08 0003 0\n"),
            ("brownout", b"04 0001 1\n"),
            ("external", b"02 0002 0\n"),
            ("power", b"01 0001 1\n"),
        ):
            board.control(f"reset {kind}")
            start_probe(board)
            assert board.run(5 * MS, b"r") == answer, kind
        assert board.run(100 * MS, b"w") == b""  # it hangs until the watchdog bites
        assert board.run(5 * MS, b"r") == b"08 0002 0\n"
        assert board.stats()["last_reset"] == "watchdog"
        assert board.trace().edges("reset")[1].tolist() == [0, 2, 3, 1, 2, 0, 3]


def test_a_watchdog_that_is_not_turned_off_resets_for_ever(programs: Path) -> None:
    folder = programs / "forgetful"
    folder.mkdir()
    with stepped_board(compile_program(PROBE, "uno_cnc_shield", folder, "-DFORGETFUL")) as board:
        start_probe(board)
        board.run(200 * MS, b"w")
        assert board.stats()["resets"] > 8


def test_a_bootloader_hides_the_cause_and_swallows_bytes(probe: Path) -> None:
    with stepped_board(probe, bootloader=300) as board:
        start_probe(board)
        assert board.run(5 * MS, b"r") == b"00 0001 1\n"
        board.control("reset external")
        assert board.run(290 * MS, b"r") == b""
        assert board.stats()["state"] == "bootloader"
        assert board.stats()["lost_in_bootloader"] == 1
        board.run(20 * MS)
        assert board.run(5 * MS, b"r") == b"00 0002 0\n"


def test_the_eeprom_outlasts_every_reset(probe: Path) -> None:
    with stepped_board(probe) as board:
        start_probe(board)
        assert board.run(20 * MS, b"v\xa7") == b"\n"
        for kind in ("external", "power", "watchdog"):
            board.control(f"reset {kind}")
            assert start_probe(board).run(20 * MS, b"V") == b"a7\n"


def test_memory_figures_and_access_by_name(probe: Path) -> None:
    with stepped_board(probe) as board:
        start_probe(board)
        before = board.stats()["memory"]
        assert before["ram"] == 2048
        assert 900 < before["flash"] < 2000
        board.run(5 * MS, b"d")
        used = before["stack_never_touched"] - board.stats()["memory"]["stack_never_touched"]
        assert 290 <= used <= 320
        board.control("poke survivor 3412")
        assert board.control("peek survivor 2")["bytes"] == "3412"
        assert board.run(5 * MS, b"r") == b"01 1234 1\n"
        board.control("reset external")
        assert start_probe(board).run(5 * MS, b"r") == b"02 0001 1\n"  # its checksum does not fit


def test_mistakes_are_answered(probe: Path, tmp_path: Path) -> None:
    with stepped_board(probe) as board:
        for command, part in (
            ("jump", "no command 'jump'"),
            ("pin A9 0", "no pin 'A9'"),
            ("set-switch A at 5", "no limit pin"),
            ("set-switch X", "at STEPS"),
            ("noise flip 2", "noise"),
            ("reset hard", "not 'hard'"),
            ('peek "nothing" 2', "peek"),
            ("run 5 parsecs", "hexadecimal"),
        ):
            with pytest.raises(BoardError, match=part):
                board.control(command)
        with pytest.raises(BoardError, match="no signal 'B"):
            board.trace().edges("B.STEP")
    with pytest.raises(BoardError, match="not running"):
        board.stats()
    wrong = tmp_path / "wrong.elf"
    wrong.write_bytes(b"no program")
    with pytest.raises(BoardError, match="exit code 2"):
        stepped_board(wrong).__enter__()


def test_a_crash_is_told(programs: Path) -> None:
    source = programs / "crash.c"
    source.write_text('int main(void) { for (;;) __asm__ volatile(".word 0x0001"); }\n')
    with stepped_board(compile_program(source, "uno_cnc_shield", programs)) as board:
        board.run(5 * MS)
        assert board.stats()["state"] == "crashed"
        assert board.run(5 * MS, b"x") == b""


def test_nothing_is_left_behind_when_a_test_fails(probe: Path) -> None:
    board = stepped_board(probe)

    def fail_with_board() -> None:
        with board:
            assert board.stats()["state"] == "running"
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_with_board()
    assert not Path(board.port).parent.exists()
    with pytest.raises(BoardError, match="not running"):
        board.control("cycles")
    board.close()  # again does no harm


def test_it_runs_for_people_too(probe: Path, tmp_path: Path) -> None:
    """Without Python: a link, a control socket, Ctrl-C, the figures in a file."""
    folder = Path(tempfile.mkdtemp(prefix="armkin-"))  # socket paths must be short
    link, control, figures = folder / "board", folder / "control", tmp_path / "figures.json"
    link.symlink_to("/nowhere")  # left by an emulator that was killed
    command = [*build_simulator(), "--board", "uno_cnc_shield", "--elf", str(probe)]
    command += ["--link", str(link), "--control", str(control), "--stats", str(figures), "--do", "pin A0 0"]
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
    with process:
        assert process.stdout is not None
        assert f"--port {link}" in "".join(process.stdout.readline() for _ in range(4))
        with socket.socket(socket.AF_UNIX) as client, client.makefile("rw") as lines:
            client.connect(str(control))

            def say(command: str) -> dict[str, Any]:
                lines.write(command + "\n")
                lines.flush()
                answer: dict[str, Any] = json.loads(lines.readline())
                return answer

            with serial.Serial(str(link), 250000, timeout=60) as port:
                while not say("stats")["port"]["opened"]:
                    time.sleep(0.01)
                ready = say("cycles")["cycle"] + 5 * MS * CLOCK_HZ
                while say("cycles")["cycle"] < ready:
                    time.sleep(0.01)
                assert ask_probe(port, b"l") == b"1110\n"
            for sent, good in (("pin A0 z", True), ("pin A0 2", False)):
                assert ("ok" in say(sent)) is good
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 0
    assert json.loads(figures.read_text())["uart"]["received"] == 1
    assert list(folder.iterdir()) == []
    folder.rmdir()

    link.parent.mkdir()
    link.write_text("somebody's file")
    completed = subprocess.run(command, capture_output=True, text=True, check=False)
    assert completed.returncode == 2
    assert "no symbolic link" in completed.stderr
    assert link.read_text() == "somebody's file"
    shutil.rmtree(folder)
