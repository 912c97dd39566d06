"""The emulated board itself, with a program whose every edge is known (probe.c)."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest
import serial
from emulator import CLOCK_HZ, BoardError, EmulatedBoard, build_simulator, compile_program

PROBE = Path(__file__).with_name("probe.c")
MS = 1e-3


@pytest.fixture(scope="session")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("probe")


@pytest.fixture(scope="session")
def probe(programs: Path) -> Path:
    return compile_program(PROBE, "uno_cnc_shield", programs)


def stepped(probe: Path, board: str = "uno_cnc_shield", **options: object) -> EmulatedBoard:
    return EmulatedBoard(board, elf=probe, speed="step", trace=True, **options)  # type: ignore[arg-type]


def started(board: EmulatedBoard) -> EmulatedBoard:
    """Let the probe set up its UART."""
    board.run(2 * MS)
    return board


# ---- pins ----


@pytest.mark.parametrize("kind", ["uno_cnc_shield", "mega_ramps14"])
def test_a_pulse_train_is_recorded_to_the_cycle(programs: Path, kind: str) -> None:
    with stepped(compile_program(PROBE, kind, programs), kind) as board:
        started(board)
        assert board.run(10 * MS, b"p\xc8") == b"\n"
        assert board.run(10 * MS, b"n\x07") == b"\n"
        x = board.stats()["axes"]["X"]
        assert (x["net"], x["positive"], x["negative"]) == (193, 200, 7)
        cycle, direction = board.trace().steps("X")
        assert np.all(np.diff(cycle[:200]) == 160)
        assert np.all(np.diff(cycle[200:]) == 160)
        assert direction.tolist() == [1] * 200 + [-1] * 7
        assert board.trace().positions("X")[1][-1] == 193
        edges, level = board.trace().edges("X.STEP")
        assert np.all((edges[1::2] - edges[::2]) == 32)
        assert level.tolist() == [1, 0] * 207
        assert (x["high_min_us"], x["high_max_us"], x["interval_min_us"]) == (2.0, 2.0, 10.0)
        assert x["max_rate_hz"] == 100_000
        assert x["first_step_cycle"] == cycle[0]
        assert x["last_step_cycle"] == cycle[-1]


def test_timer_interrupts_come_on_time_and_pay_their_entry(probe: Path) -> None:
    with stepped(probe) as board:
        started(board)
        board.run(10 * MS, b"t\xc8")
        cycle, _ = board.trace().steps("Y")
        assert len(cycle) == 200
        # an interrupt waits for the end of an instruction: 1 to 4 cycles of jitter, none lost
        assert np.max(np.abs(cycle - cycle[0] - 640 * np.arange(200))) <= 4
        stats = board.stats()
        assert stats["interrupts"]["11"]["count"] == 200
        # 4 cycles to the vector, 3 for its jump, then the routine's own start
        assert 7 / 16 <= stats["axes"]["Y"]["latency_min_us"] <= stats["axes"]["Y"]["latency_max_us"] < 2
        board.control("clear")
        stats = board.stats()
        assert stats["interrupts"] == {}
        assert stats["axes"]["Y"]["latency_min_us"] is None
        assert stats["axes"]["Y"]["net"] == 200


def test_an_old_flag_fires_when_its_interrupt_is_enabled(probe: Path) -> None:
    with stepped(probe) as board:
        started(board).run(10 * MS, b"f")
        (step,) = board.trace().rises("Y.STEP")
        (marked,) = board.trace().rises("X.DIR")
        assert 5 < step - marked < 30  # not at the next compare, 640 cycles on


def test_timing_that_a_driver_would_miss_is_counted(probe: Path) -> None:
    def violations(driver: str, wait: float) -> dict[str, int]:
        with stepped(probe, driver=driver) as board:
            board.run(wait)
            board.run(10 * MS, b"p\x05n\x05")
            counts: dict[str, int] = board.stats()["axes"]["X"]["violations"]
            return counts

    clean = {"high": 0, "low": 0, "dir_setup": 0, "dir_hold": 0, "disabled": 0, "waking": 0}
    assert violations("a4988", 2 * MS) == clean
    assert violations("a4988", 0.3 * MS) == clean | {"waking": 10}
    assert violations("tmc2209", 0.3 * MS) == clean


def test_a_step_against_a_disabled_driver_is_counted(programs: Path) -> None:
    with stepped(compile_program(PROBE, "mega_ramps14", programs), "mega_ramps14") as board:
        started(board).run(10 * MS, b"t\x09")  # the probe enables X only
        axes = board.stats()["axes"]
        assert (axes["Y"]["violations"]["disabled"], axes["Y"]["enabled"]) == (9, False)
        assert axes["X"]["enabled"]


def test_servo_pulses_are_measured(probe: Path) -> None:
    with stepped(probe) as board:
        started(board)
        for _ in range(3):
            board.run(20 * MS, b"g")
        servo = board.stats()["servos"]["A3"]
        assert servo["pulses"] == 3
        assert servo["width_us"] == pytest.approx(1500, abs=1)
        assert servo["period_min_us"] == pytest.approx(20_000, abs=10)
    with stepped(probe, "uno_servos") as board:
        started(board).run(10 * MS, b"p\x0a")  # D2, the shield's X STEP, is a servo here
        assert board.stats()["servos"]["D2"]["width_max_us"] == 2.0
        assert board.stats()["axes"] == {}


# ---- UART ----


def test_bytes_take_ten_bits_in_both_directions(probe: Path, programs: Path) -> None:
    slow = compile_program(PROBE, "uno_cnc_shield", programs, "-DDIVIDER=16", "-DDOUBLE")
    slow = slow.rename(programs / "slow.elf")
    compile_program(PROBE, "uno_cnc_shield", programs)
    for elf, host, device in ((probe, 640.0, 640.0), (slow, 16e6 / 11520, 17 * 8 * 10)):
        with stepped(elf) as board:
            started(board)
            sent = bytes(range(32, 132))
            assert board.run(30 * MS, b"e" + sent) == sent
            arrived, value = board.trace().edges("uart.in")
            assert bytes(value) == b"e" + sent
            assert np.max(np.abs(np.diff(arrived) - host)) <= 4
            left, _ = board.trace().edges("uart.out")
            assert np.min(np.diff(left)) >= device
            assert board.stats()["uart"]["overruns"] == 0


def test_a_program_that_does_not_read_overruns(probe: Path) -> None:
    with stepped(probe) as board:
        started(board)
        answers = board.run(20 * MS, b"s" + b"x" * 100)  # 2 ms, 50 bytes without interrupts
        uart = board.stats()["uart"]
        assert answers.count(b"?") == 100 - uart["overruns"]
        assert uart["overruns"] in (47, 48)  # the first two, in the buffer, survive, and the last
        assert board.run(20 * MS, b"x" * 100) == b"?\n" * 100
        assert board.stats()["uart"]["overruns"] == uart["overruns"]


def test_the_wrong_baud_rate_garbles(probe: Path) -> None:
    with stepped(probe, baud=115200) as board:
        started(board)
        assert b"\n" not in board.run(20 * MS, b"r")
        assert board.stats()["uart"]["garbled"] == 1
        board.control("baud auto")
        assert board.run(20 * MS, b"r").startswith(b"01 ")


def test_run_stops_at_a_byte(probe: Path) -> None:
    with stepped(probe) as board:
        started(board)
        assert board.run(1, b"r", until=b" ") == b"01 "
        assert board.stats()["seconds"] < 5 * MS
        assert board.run(1 * MS) == b"0001 1\n"


# ---- resets and memory ----


def test_resets_set_their_flag_and_only_power_clears_memory(probe: Path) -> None:
    with stepped(probe) as board:
        started(board)
        assert board.run(5 * MS, b"r") == b"01 0001 1\n"
        for kind, answer in (
            ("external", b"02 0002 0\n"),
            ("watchdog", b"08 0003 0\n"),
            ("brownout", b"04 0001 1\n"),
            ("external", b"02 0002 0\n"),
            ("power", b"01 0001 1\n"),
        ):
            board.control(f"reset {kind}")
            started(board)
            assert board.run(5 * MS, b"r") == answer, kind
        assert board.run(100 * MS, b"w") == b""  # it hangs until the watchdog bites
        assert board.run(5 * MS, b"r") == b"08 0002 0\n"
        assert board.stats()["last_reset"] == "watchdog"
        assert board.trace().edges("reset")[1].tolist() == [0, 2, 3, 1, 2, 0, 3]


def test_a_watchdog_that_is_not_turned_off_resets_for_ever(programs: Path) -> None:
    folder = programs / "forgetful"
    folder.mkdir()
    with stepped(compile_program(PROBE, "uno_cnc_shield", folder, "-DFORGETFUL")) as board:
        started(board)
        board.run(200 * MS, b"w")
        assert board.stats()["resets"] > 8


def test_a_bootloader_hides_the_cause_and_swallows_bytes(probe: Path) -> None:
    with stepped(probe, bootloader=300) as board:
        started(board)
        assert board.run(5 * MS, b"r") == b"00 0001 1\n"
        board.control("reset external")
        assert board.run(290 * MS, b"r") == b""
        assert board.stats()["state"] == "bootloader"
        assert board.stats()["lost_in_bootloader"] == 1
        board.run(20 * MS)
        assert board.run(5 * MS, b"r") == b"00 0002 0\n"


def test_the_eeprom_outlasts_every_reset(probe: Path) -> None:
    with stepped(probe) as board:
        started(board)
        assert board.run(20 * MS, b"v\xa7") == b"\n"
        for kind in ("external", "power", "watchdog"):
            board.control(f"reset {kind}")
            assert started(board).run(20 * MS, b"V") == b"a7\n"


def test_memory_figures_and_access_by_name(probe: Path) -> None:
    with stepped(probe) as board:
        started(board)
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
        assert started(board).run(5 * MS, b"r") == b"02 0001 1\n"  # its checksum does not fit


# ---- noise ----


def test_noise_has_its_rate_and_repeats_with_its_seed(probe: Path) -> None:
    sent = bytes(range(32, 232)) * 100

    def noisy(seed: int, way: str) -> tuple[bytes, dict[str, dict[str, int]]]:
        with stepped(probe) as board:
            started(board).run(1 * MS, b"e")
            board.control(f"noise flip 0.01 drop 0.02 seed {seed} dir {way}")
            got = board.run(0.85, sent)
            line: dict[str, dict[str, int]] = board.stats()["line"]
            board.control("restore")
            assert board.run(5 * MS, b"!!") == b"!!"
            return got, line

    first, line = noisy(7, "both")
    assert (first, line) == noisy(7, "both")
    assert first != noisy(8, "both")[0]
    for way, n in (("in", 20_000), ("out", 20_000 - line["in"]["dropped"])):
        for what, p in (("flipped", 0.01 * 0.98), ("dropped", 0.02)):
            assert abs(line[way][what] - n * p) < 5 * (n * p) ** 0.5, (way, what)
    assert len(first) == 20_000 - line["in"]["dropped"] - line["out"]["dropped"]
    _, line = noisy(7, "in")
    assert (line["out"]["flipped"], line["out"]["dropped"]) == (0, 0)
    assert line["in"]["dropped"] > 0


def test_a_cut_line_carries_nothing(probe: Path) -> None:
    with stepped(probe) as board:
        started(board).run(1 * MS, b"e")
        board.control("cut out")
        assert board.run(5 * MS, b"abc") == b""
        board.control("restore")
        board.control("cut in")
        assert board.run(5 * MS, b"def") == b""
        board.control("restore")
        assert board.run(5 * MS, b"ghi") == b"ghi"
        assert board.stats()["line"]["out"]["cut_off"] == 3
        assert board.stats()["line"]["in"]["cut_off"] == 3


# ---- inputs ----


@pytest.mark.parametrize("kind", ["uno_cnc_shield", "mega_ramps14"])
def test_pins_are_driven_and_released(programs: Path, kind: str) -> None:
    abort = "A3" if kind == "mega_ramps14" else "A0"
    with stepped(compile_program(PROBE, kind, programs), kind, commands=(f"pin {abort} 0",)) as board:
        started(board)
        assert board.run(5 * MS, b"l") == b"1110\n"
        board.control(f"pin {abort} z")
        board.control("switch Y 1")
        assert board.run(5 * MS, b"l") == b"1011\n"
        board.control("reset external")  # drives outlast a reset
        assert started(board).run(5 * MS, b"l") == b"1011\n"
        board.control("switch Y 0")
        assert board.run(5 * MS, b"l") == b"1111\n"


def test_an_axis_runs_into_its_limit_switch(probe: Path) -> None:
    with stepped(probe, commands=("set-switch X at -5 below", "set-switch Z at -100 below nc")) as board:
        started(board)
        assert board.run(5 * MS, b"l") == b"1101\n"  # the normally closed one reads low
        board.run(5 * MS, b"n\x04")
        assert board.run(5 * MS, b"l") == b"1101\n"
        board.run(5 * MS, b"n\x01")
        assert board.stats()["switches"]["D9"] == {"pressed": True, "closed": True}
        assert board.run(5 * MS, b"l") == b"0101\n"
        board.run(5 * MS, b"p\x01")
        assert board.run(5 * MS, b"l") == b"1101\n"
        board.control("set-switch X at 3 above pin D10")  # a second switch of the axis, at its other end
        board.run(5 * MS, b"p\x07")
        assert board.run(5 * MS, b"l") == b"1001\n"


def test_a_switch_bounces_and_settles(probe: Path) -> None:
    with stepped(probe, commands=("set-switch X at 1 above bounce 3ms",)) as board:
        started(board)
        board.run(10 * MS, b"p\x01")
        trace = board.trace()
        contact = 128 + 8 + 1  # PB1
        cycle = trace.cycle[trace.signal == contact]
        level = trace.value[trace.signal == contact]
        (step,) = trace.rises("X.STEP")
        chatter = cycle[cycle >= step] - step
        assert 5 <= len(chatter) <= 60
        assert 2 * MS * CLOCK_HZ < chatter[-1] < 5 * MS * CLOCK_HZ
        assert level[-1] == 0
        assert board.run(5 * MS, b"l") == b"0111\n"


# ---- the port and the clock ----


def ask(port: serial.Serial, command: bytes) -> bytes:
    port.write(command)
    return port.readline()


def test_the_port_is_a_serial_port_and_opening_it_resets(probe: Path) -> None:
    with EmulatedBoard(elf=probe) as board:
        assert Path(board.port).is_symlink()
        for boots in (2, 3, 4):  # power-on was the first
            with serial.Serial(board.port, 250000, timeout=5) as port:
                board.wait(2 * MS)
                assert ask(port, b"r") == b"02 %04x 0\n" % boots
                assert ask(port, b"p\x64") == b"\n"
        assert board.net()["X"] == 300
        for _ in range(5):  # faster than the emulator looks
            os.close(os.open(board.port, os.O_RDWR | os.O_NOCTTY))
        assert board.stats()["port"]["opened"] == 8
        board.control("reset-on-open off")
        board.wait(2 * MS)
        with serial.Serial(board.port, 250000, timeout=5) as port:
            assert board.stats()["resets"] == 9
            with serial.Serial(board.port, 250000, timeout=5):
                assert ask(port, b"p\x01") == b"\n"
            assert board.stats()["resets"] == 9
        where = Path(board.port)
    assert not where.parent.exists()


def test_a_long_transfer_keeps_every_byte(probe: Path) -> None:
    with EmulatedBoard(elf=probe) as board, serial.Serial(board.port, 250000, timeout=5) as port:
        board.wait(2 * MS)
        sent = bytes(range(5, 255)) * 20
        begin = time.monotonic()
        port.write(b"e" + sent)
        assert port.read(len(sent)) == sent
        assert time.monotonic() - begin > 0.9 * len(sent) * 10 / 250000
        assert board.stats()["uart"]["overruns"] == 0


def test_the_clock_follows_real_time_or_the_host(probe: Path) -> None:
    def rate(board: EmulatedBoard, seconds: float) -> float:
        begin, cycle = time.monotonic(), board.control("cycles")["cycle"]
        time.sleep(seconds)
        passed = board.control("cycles")["cycle"] - cycle
        return float(passed) / CLOCK_HZ / (time.monotonic() - begin)

    with EmulatedBoard(elf=probe) as board:
        assert 0.05 < rate(board, 0.3) < 1.1  # a busy machine may be slower, never faster
        board.control("speed 0.25")
        assert 0.05 < rate(board, 0.3) < 0.35
    with EmulatedBoard(elf=probe, speed="max", ahead_ms=2000) as board:
        with serial.Serial(board.port, 250000, timeout=5) as port:
            board.wait(2 * MS)
            assert ask(port, b"r").startswith(b"02 ")
            waited = board.stats()["pace"]["waited_ms"]
            board.wait(0.5)
            assert board.stats()["pace"]["waited_ms"] == waited  # free, as the host has just spoken
        board.wait(2)
        assert rate(board, 0.3) < 1.1  # and not when it is silent


def test_commands_wait_for_their_time(probe: Path) -> None:
    with stepped(probe) as board:
        started(board)
        board.control("after 5ms reset external")
        board.control("after 2ms mark 7")
        begin = board.control("cycles")["cycle"]
        board.run(20 * MS)
        for name, delay in (("mark", 2), ("reset", 5)):
            cycle, _ = board.trace().edges(name)
            assert abs(cycle[-1] - begin - delay * MS * CLOCK_HZ) <= 4, name


# ---- mistakes ----


def test_mistakes_are_answered(probe: Path, tmp_path: Path) -> None:
    with stepped(probe) as board:
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
        stepped(wrong).__enter__()


def test_a_crash_is_told(programs: Path) -> None:
    source = programs / "crash.c"
    source.write_text('int main(void) { for (;;) __asm__ volatile(".word 0x0001"); }\n')
    with stepped(compile_program(source, "uno_cnc_shield", programs)) as board:
        board.run(5 * MS)
        assert board.stats()["state"] == "crashed"
        assert board.run(5 * MS, b"x") == b""


def test_nothing_is_left_behind_when_a_test_fails(probe: Path) -> None:
    board = stepped(probe)

    def failing() -> None:
        with board:
            assert board.stats()["state"] == "running"
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        failing()
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
        with serial.Serial(str(link), 250000, timeout=5) as port:
            time.sleep(0.5)
            assert ask(port, b"l") == b"1110\n"
        with socket.socket(socket.AF_UNIX) as client, client.makefile("rw") as lines:
            client.connect(str(control))
            for sent, answer in (("pin A0 z", "true"), ("pin A0 2", "false")):
                lines.write(sent + "\n")
                lines.flush()
                assert ("ok" in json.loads(lines.readline())) is (answer == "true")
        process.send_signal(signal.SIGINT)
        assert process.wait(5) == 0
    assert json.loads(figures.read_text())["uart"]["received"] == 1
    assert list(folder.iterdir()) == []
    folder.rmdir()

    link.parent.mkdir()
    link.write_text("somebody's file")
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "no symbolic link" in done.stderr
    assert link.read_text() == "somebody's file"
    shutil.rmtree(folder)
