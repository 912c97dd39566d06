"""From the first byte of MOTION to the first step, and short moves on a loaded computer, in the emulator, in real time.

    python tests/bench/bench_first_step.py [--runs 40] [--moves 1000] [--load 6]

The sender is armkin's own over a pseudo-terminal, the board the compiled firmware at 250000 baud; times are the board's
own cycles. The time law has its first step after a time of its own: a fast joint's half step from rest.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import os
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "firmware"))

from emulator import EmulatedBoard

import armkin
from armkin.board.firmware import streaming
from armkin.board.firmware.configuration import configure
from armkin.board.firmware.firmware_machine import FirmwareMachine
from armkin.board.ports import SerialPort
from armkin.errors import LinkError


def first_steps(runs: int) -> tuple[list[float], float]:
    """To the first step of a move, and of that the law's own [ms]."""
    arm = armkin.load("three_dof")
    delays, law_delay = [], 0.0
    for _ in range(runs):
        with EmulatedBoard(trace=True, reset_on_open=False, patience=0) as board:
            port = SerialPort(board.port)
            machine = FirmwareMachine(port, arm, configure(arm))
            machine.prepare(assume=arm.home)
            plan = machine.plan(machine.counts(), np.deg2rad([-3, 0.5, -0.5]))
            law = plan.trajectory.stretches[0].law  # type: ignore[attr-defined]
            law_delay = 1e3 * math.sqrt(law.length / law.accel / int(np.abs(plan.end - plan.start).max()))
            time.sleep(0.03)
            begin = board.control("cycles")["cycle"]
            try:
                machine.run([plan])
            except LinkError as error:  # with --idle on a computer that is not
                print(str(error).splitlines()[0], flush=True)
                continue
            finally:
                port.close()
            trace = board.trace()
            arrived, _ = trace.edges("uart.in")
            step = min(int(trace.rises(f"{axis}.STEP")[0]) for axis in "XYZ")
            delays.append(float(step - arrived[arrived > begin][0]) / 16e3)
    return delays, law_delay


def short_moves(moves: int, load: int) -> tuple[int, int, float]:
    """Moves of a few degrees, each from rest, with `load` busy processes: how many arrived, were held, and seconds."""
    arm = armkin.load("three_dof")
    busy = [multiprocessing.Process(target=_keep_core_busy, daemon=True) for _ in range(load)]
    for process in busy:
        process.start()
    arrived = held = 0
    begin = time.monotonic()
    try:
        with EmulatedBoard(reset_on_open=False, patience=0) as board:
            port = SerialPort(board.port)
            machine = FirmwareMachine(port, arm, configure(arm))
            machine.prepare(assume=arm.home)
            rng = np.random.default_rng(1)
            for _ in range(moves):
                goal = arm.home + np.deg2rad(rng.uniform(-2, 2, 3))
                try:
                    machine.run([machine.plan(machine.counts(), np.clip(goal, arm.lower, arm.upper))])
                    arrived += 1
                except LinkError as error:
                    print(str(error).splitlines()[0], flush=True)
                    held += 1
                    machine.session.reopen()
                    machine.refresh()
            port.close()
    finally:
        for process in busy:
            process.terminate()
    return arrived, held, time.monotonic() - begin


def _keep_core_busy() -> None:
    os.nice(0)
    while True:
        sum(range(10_000))


def main() -> None:
    """Print the figures."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--runs", type=int, default=40)
    options.add_argument("--moves", type=int, default=1000)
    options.add_argument("--load", type=int, default=6)
    options.add_argument("--idle", action="store_true", help="lead as on an idle computer, whatever the load is")
    args = options.parse_args()
    if args.idle:
        streaming._processor_load = lambda session: 0.0
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    if args.runs:
        delays, law_delay = first_steps(args.runs)
        figures = " / ".join(f"{np.quantile(delays, q):.1f}" for q in (0.0, 0.5, 0.9, 1.0))
        print(f"first step after the first byte of MOTION, {args.runs} runs: {figures} ms (least, median, 90 %, most)")
        print(f"  of these the law's own {law_delay:.1f} ms")
    if args.moves:
        arrived, held, seconds = short_moves(args.moves, args.load)
        print(f"{args.moves} short moves beside {args.load} busy ones: {arrived} arrived, {held} held, {seconds:.0f} s")


if __name__ == "__main__":
    main()
