"""The emulated board itself, with a program whose every edge is known (probe.c): steps, servos and inputs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from emulator import CLOCK_HZ, compile_program
from probing import MS, PROBE, start_probe, stepped_board


@pytest.mark.parametrize("kind", ["uno_cnc_shield", "mega_ramps14"])
def test_a_pulse_train_is_recorded_to_the_cycle(programs: Path, kind: str) -> None:
    with stepped_board(compile_program(PROBE, kind, programs), kind) as board:
        start_probe(board)
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
    with stepped_board(probe) as board:
        start_probe(board)
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
    with stepped_board(probe) as board:
        start_probe(board).run(10 * MS, b"f")
        (step,) = board.trace().rises("Y.STEP")
        (marked,) = board.trace().rises("X.DIR")
        assert 5 < step - marked < 30  # not at the next compare, 640 cycles on


def test_timing_that_a_driver_would_miss_is_counted(probe: Path) -> None:
    def violations(driver: str, wait: float) -> dict[str, int]:
        with stepped_board(probe, driver=driver) as board:
            board.run(wait)
            board.run(10 * MS, b"p\x05n\x05")
            counts: dict[str, int] = board.stats()["axes"]["X"]["violations"]
            return counts

    clean = {"high": 0, "low": 0, "dir_setup": 0, "dir_hold": 0, "disabled": 0, "waking": 0}
    assert violations("a4988", 2 * MS) == clean
    assert violations("a4988", 0.3 * MS) == clean | {"waking": 10}
    assert violations("tmc2209", 0.3 * MS) == clean


def test_a_step_against_a_disabled_driver_is_counted(programs: Path) -> None:
    with stepped_board(compile_program(PROBE, "mega_ramps14", programs), "mega_ramps14") as board:
        start_probe(board).run(10 * MS, b"t\x09")  # the probe enables X only
        axes = board.stats()["axes"]
        assert (axes["Y"]["violations"]["disabled"], axes["Y"]["enabled"]) == (9, False)
        assert axes["X"]["enabled"]


def test_servo_pulses_are_measured(probe: Path) -> None:
    with stepped_board(probe) as board:
        start_probe(board)
        for _ in range(3):
            board.run(20 * MS, b"g")
        servo = board.stats()["servos"]["A3"]
        assert servo["pulses"] == 3
        assert servo["width_us"] == pytest.approx(1500, abs=1)
        assert servo["period_min_us"] == pytest.approx(20_000, abs=10)
    with stepped_board(probe, "uno_servos") as board:
        start_probe(board).run(10 * MS, b"p\x0a")  # D2, the shield's X STEP, is a servo here
        assert board.stats()["servos"]["D2"]["width_max_us"] == 2.0
        assert board.stats()["axes"] == {}


@pytest.mark.parametrize("kind", ["uno_cnc_shield", "mega_ramps14"])
def test_pins_are_driven_and_released(programs: Path, kind: str) -> None:
    abort = "A3" if kind == "mega_ramps14" else "A0"
    with stepped_board(compile_program(PROBE, kind, programs), kind, commands=(f"pin {abort} 0",)) as board:
        start_probe(board)
        assert board.run(5 * MS, b"l") == b"1110\n"
        board.control(f"pin {abort} z")
        board.control("switch Y 1")
        assert board.run(5 * MS, b"l") == b"1011\n"
        board.control("reset external")  # drives outlast a reset
        assert start_probe(board).run(5 * MS, b"l") == b"1011\n"
        board.control("switch Y 0")
        assert board.run(5 * MS, b"l") == b"1111\n"


def test_an_axis_runs_into_its_limit_switch(probe: Path) -> None:
    with stepped_board(probe, commands=("set-switch X at -5 below", "set-switch Z at -100 below nc")) as board:
        start_probe(board)
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
    with stepped_board(probe, commands=("set-switch X at 1 above bounce 3ms",)) as board:
        start_probe(board)
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
