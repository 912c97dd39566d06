"""The emulated board itself, with a program whose every edge is known (probe.c): the serial line and the clock."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import serial
from emulator import CLOCK_HZ, EmulatedBoard, compile_program
from probing import MS, PROBE, ask_probe, start_probe, stepped_board


def test_bytes_take_ten_bits_in_both_directions(probe: Path, programs: Path) -> None:
    slow = compile_program(PROBE, "uno_cnc_shield", programs, "-DDIVIDER=16", "-DDOUBLE")
    slow = slow.rename(programs / "slow.elf")
    compile_program(PROBE, "uno_cnc_shield", programs)
    for elf, host, device in ((probe, 640.0, 640.0), (slow, 16e6 / 11520, 17 * 8 * 10)):
        with stepped_board(elf) as board:
            start_probe(board)
            sent = bytes(range(32, 132))
            assert board.run(30 * MS, b"e" + sent) == sent
            arrived, value = board.trace().edges("uart.in")
            assert bytes(value) == b"e" + sent
            assert np.max(np.abs(np.diff(arrived) - host)) <= 4
            left, _ = board.trace().edges("uart.out")
            assert np.min(np.diff(left)) >= device
            assert board.stats()["uart"]["overruns"] == 0


def test_a_program_that_does_not_read_overruns(probe: Path) -> None:
    with stepped_board(probe) as board:
        start_probe(board)
        answers = board.run(20 * MS, b"s" + b"x" * 100)  # 2 ms, 50 bytes without interrupts
        uart = board.stats()["uart"]
        assert answers.count(b"?") == 100 - uart["overruns"]
        assert uart["overruns"] in (47, 48)  # the first two, in the buffer, survive, and the last
        assert board.run(20 * MS, b"x" * 100) == b"?\n" * 100
        assert board.stats()["uart"]["overruns"] == uart["overruns"]


def test_the_wrong_baud_rate_garbles(probe: Path) -> None:
    with stepped_board(probe, baud=115200) as board:
        start_probe(board)
        assert b"\n" not in board.run(20 * MS, b"r")
        assert board.stats()["uart"]["garbled"] == 1
        board.control("baud auto")
        assert board.run(20 * MS, b"r").startswith(b"01 ")


def test_run_stops_at_a_byte(probe: Path) -> None:
    with stepped_board(probe) as board:
        start_probe(board)
        assert board.run(1, b"r", until=b" ") == b"01 "
        assert board.stats()["seconds"] < 5 * MS
        assert board.run(1 * MS) == b"0001 1\n"


def test_noise_has_its_rate_and_repeats_with_its_seed(probe: Path) -> None:
    sent = bytes(range(32, 232)) * 100

    def noisy(seed: int, way: str) -> tuple[bytes, dict[str, dict[str, int]]]:
        with stepped_board(probe) as board:
            start_probe(board).run(1 * MS, b"e")
            board.control(f"noise flip 0.01 drop 0.02 seed {seed} dir {way}")
            received = board.run(0.85, sent)
            line: dict[str, dict[str, int]] = board.stats()["line"]
            board.control("restore")
            assert board.run(5 * MS, b"!!") == b"!!"
            return received, line

    first, line = noisy(7, "both")
    assert (first, line) == noisy(7, "both")
    assert first != noisy(8, "both")[0]
    for way, n in (("in", 20_000), ("out", 20_000 - line["in"]["dropped"])):
        for fault, p in (("flipped", 0.01 * 0.98), ("dropped", 0.02)):
            assert abs(line[way][fault] - n * p) < 5 * (n * p) ** 0.5, (way, fault)
    assert len(first) == 20_000 - line["in"]["dropped"] - line["out"]["dropped"]
    _, line = noisy(7, "in")
    assert (line["out"]["flipped"], line["out"]["dropped"]) == (0, 0)
    assert line["in"]["dropped"] > 0


def test_a_cut_line_carries_nothing(probe: Path) -> None:
    with stepped_board(probe) as board:
        start_probe(board).run(1 * MS, b"e")
        board.control("cut out")
        assert board.run(5 * MS, b"abc") == b""
        board.control("restore")
        board.control("cut in")
        assert board.run(5 * MS, b"def") == b""
        board.control("restore")
        assert board.run(5 * MS, b"ghi") == b"ghi"
        assert board.stats()["line"]["out"]["cut_off"] == 3
        assert board.stats()["line"]["in"]["cut_off"] == 3


def test_the_port_is_a_serial_port_and_opening_it_resets(probe: Path) -> None:
    with EmulatedBoard(elf=probe) as board:
        assert Path(board.port).is_symlink()
        for boots in (2, 3, 4):  # power-on was the first
            with serial.Serial(board.port, 250000, timeout=60) as port:
                board.wait(2 * MS)
                assert ask_probe(port, b"r") == b"02 %04x 0\n" % boots
                assert ask_probe(port, b"p\x64") == b"\n"
        assert board.net()["X"] == 300
        for _ in range(5):  # faster than the emulator looks
            os.close(os.open(board.port, os.O_RDWR | os.O_NOCTTY))
        assert board.stats()["port"]["opened"] == 8
        board.control("reset-on-open off")
        board.wait(2 * MS)
        with serial.Serial(board.port, 250000, timeout=60) as port:
            assert board.stats()["resets"] == 9
            with serial.Serial(board.port, 250000, timeout=60):
                assert ask_probe(port, b"p\x01") == b"\n"
            assert board.stats()["resets"] == 9
        path = Path(board.port)
    assert not path.parent.exists()


def test_an_answer_knows_of_every_opening_before_its_question(probe: Path) -> None:
    with EmulatedBoard(elf=probe, speed="max") as board:
        for opened in range(1, 501):
            os.close(os.open(board.port, os.O_RDWR | os.O_NOCTTY))
            assert board.stats()["port"]["opened"] == opened


def test_a_long_transfer_keeps_every_byte(probe: Path) -> None:
    with EmulatedBoard(elf=probe) as board, serial.Serial(board.port, 250000, timeout=60) as port:
        board.wait(2 * MS)
        sent = bytes(range(5, 255)) * 20
        begin = time.monotonic()
        port.write(b"e" + sent)
        assert port.read(len(sent)) == sent
        assert time.monotonic() - begin > 0.9 * len(sent) * 10 / 250000
        assert board.stats()["uart"]["overruns"] == 0


def test_the_clock_follows_real_time_or_the_host(probe: Path) -> None:
    def rate(board: EmulatedBoard) -> float:
        begin, cycle = time.monotonic(), board.control("cycles")["cycle"]
        time.sleep(0.3)
        passed = board.control("cycles")["cycle"] - cycle
        return float(passed) / CLOCK_HZ / (time.monotonic() - begin)

    with EmulatedBoard(elf=probe) as board:
        assert 0.05 < rate(board) < 1.1  # a busy machine may be slower, never faster
        board.control("speed 0.25")
        assert 0.05 < rate(board) < 0.35
    with EmulatedBoard(elf=probe, speed="max", ahead_ms=2000) as board:
        with serial.Serial(board.port, 250000, timeout=60) as port:
            board.wait(2 * MS)
            assert ask_probe(port, b"r").startswith(b"02 ")
            waited = board.stats()["pace"]["waited_ms"]
            board.wait(0.5)
            assert board.stats()["pace"]["waited_ms"] == waited  # free, as the host has just spoken
        board.wait(2)
        assert rate(board) < 1.1  # and not when it is silent


def test_commands_wait_for_their_time(probe: Path) -> None:
    with stepped_board(probe) as board:
        start_probe(board)
        board.control("after 5ms reset external")
        board.control("after 2ms mark 7")
        begin = board.control("cycles")["cycle"]
        board.run(20 * MS)
        for name, delay in (("mark", 2), ("reset", 5)):
            cycle, _ = board.trace().edges(name)
            assert abs(cycle[-1] - begin - delay * MS * CLOCK_HZ) <= 4, name
