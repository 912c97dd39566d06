"""armkin's sender on a bad line: 1 % of the bytes flipped and 1 % dropped, both ways, into the compiled firmware.

    python tests/bench/bench_send.py [SEED,SEED...]

Each seed sends about 1,000 segments (some 35 s of motion in real time: on an idle machine) and compares the
steps on the pins with the plan.
"""

from __future__ import annotations

import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "firmware"))

from emulator import EmulatedBoard

from armkin.board.firmware.configuration import configure
from armkin.board.firmware.firmware_machine import FirmwareMachine
from armkin.board.firmware.segments.trajectory_to_counts import plan_moves as plan_moves
from armkin.board.firmware.wire.session import probe_line
from armkin.board.ports import SerialPort
from armkin.errors import LinkError
from armkin.model import build_arm as arms

ROBOT = Path(__file__).parents[2] / "robots" / "three_dof.yaml"
SEGMENTS = 1000


def noisy_line(seed: int) -> str:
    """One run; a line of the table."""
    arm = arms.load_arm(ROBOT)
    rng = np.random.default_rng(seed)
    configuration = configure(arm)
    with EmulatedBoard(seed=seed, reset_on_open=False, patience=0) as board:
        port = SerialPort(board.port)
        machine = FirmwareMachine(port, arm, configuration)
        machine.prepare(assume=machine.arm.home)
        board.control(f"noise flip 0.01 drop 0.01 seed {seed}")
        probe_line(machine.session)
        plans: list[Any] = []
        counts, lowest = list(machine.counts()), [10**6]
        while sum(plan.segments for plan in plans) < SEGMENTS:
            goal = rng.uniform(np.deg2rad([-60, 20, -100]), np.deg2rad([60, 110, -10]))
            plans.append(plan_moves(arm, counts, goal))
            counts = plans[-1].end.tolist()
        segments = sum(plan.segments for plan in plans)
        total = sum(plan.duration for plan in plans)
        begin = time.monotonic()

        def watch(done: float, planned: float) -> None:
            if 1 < time.monotonic() - begin < total - 1:
                lowest[0] = min(lowest[0], machine.session.queued)

        try:
            machine.run(plans, watch)
            outcome = "arrived"
        except LinkError as error:
            outcome = f"held: {str(error).splitlines()[0]}"
        port.close()
        board.control("restore")
        net = [board.net()[axis] for axis in "XYZ"]
        exact = net == counts if outcome == "arrived" else net == list(machine.counts())
        line = board.stats()["line"]["in"]
    return (
        f"{seed:4d}  {segments:5d}  {total:6.1f} s  {line['flipped'] + line['dropped']:6d} bytes damaged  "
        f"queue never below {lowest[0]:4d} ms  {machine.session.line.resent:5d} resent  "
        f"counts {'exact' if exact else f'WRONG {net}'}  {outcome}"
    )


def main() -> None:
    """Print the table."""
    seeds = range(1, 21) if len(sys.argv) < 2 else [int(word) for word in sys.argv[1].split(",")]
    print("seed  segments  motion  (noise 1 % flips + 1 % drops, both ways)")
    with ThreadPoolExecutor(2) as pool:
        for row in pool.map(noisy_line, seeds):
            print(row, flush=True)


if __name__ == "__main__":
    main()
