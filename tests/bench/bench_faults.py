"""Faults at random moments of a send: `python tests/bench/bench_faults.py [--seed 1] [--jobs 2] [KIND...]`.

Real processes and the compiled firmware, in real time. Every fault meets a fresh board on whose home `armkin send` has
begun, a moment before the first step or after it. A fault was answered truthfully if the pins stand still on the line
to the goal, and what `armkin status` says next is so: the counts of the pins, or `lost` where a reset in motion makes
them worthless. Where the position is known, `send --resume` (or a plain send, if nothing was held) must end at the goal
to the step; where it is lost, send must be refused. Half of the boards have a bootloader that hides the reset's cause.
"""

from __future__ import annotations

import argparse
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
sys.path.insert(0, str(Path(__file__).parents[1] / "firmware"))

from emulator import EmulatedBoard
from pins import at_rest, net_steps, on_the_line

from command_line import COUNTS, POSE, ROOT, THREE_DOF, run_process

START = [0, 0, 0]
SECONDS = 2.3  # from the first step to the last
SIGNALS = {"SIGINT": 130, "SIGTERM": 143, "SIGHUP": 129}
RESETS = ("external", "watchdog", "brownout", "power")
# What strikes, and how often.
FAULTS = {
    "kill -9": ["kill"] * 58,
    "signals, pauses": [*SIGNALS, "pause"] * 8,
    "resets": RESETS * 6,
    "cable cuts": ["cut in", "cut out", "cut both"] * 6,
}


class Struck(NamedTuple):
    """What became of one fault: faults found, the position that the board then tells, how it went on."""

    wrong: list[str]
    position: str
    onward: str


def send_command(board: EmulatedBoard, *words: str) -> tuple[object, ...]:
    """The words of the motion."""
    return ("send", THREE_DOF, *POSE, "--port", board.port, *words)


def begin_sender(board: EmulatedBoard, moment: float) -> subprocess.Popen[bytes]:
    """A sender, `moment` seconds after the first step; negative: so long after its start."""
    command = [sys.executable, "-m", "armkin", *map(str, send_command(board, "--assume-home"))]
    sender = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    if moment < 0:
        time.sleep(-moment)
        return sender
    while net_steps(board) == START and sender.poll() is None:
        time.sleep(0.005)
    time.sleep(moment)
    return sender


def strike_fault(board: EmulatedBoard, sender: subprocess.Popen[bytes], fault: str, rng: random.Random) -> None:
    """The fault itself."""
    if fault == "kill":
        sender.kill()
    elif fault in SIGNALS:
        sender.send_signal(getattr(signal, fault))
    elif fault == "pause":
        sender.send_signal(signal.SIGSTOP)
        time.sleep(rng.uniform(0.1, 3))
        sender.send_signal(signal.SIGCONT)
    elif fault in RESETS:
        board.control(f"reset {fault}")
    else:
        board.control(fault)


def allowed_codes(fault: str) -> set[int]:
    """Exit codes that a sender may end with, as a shell tells them; 0 only at the goal."""
    return {0, 137 if fault == "kill" else SIGNALS.get(fault, 5)}


def run_fault(fault: str, seed: int) -> Struck:
    """One fault on a fresh board."""
    rng = random.Random(f"{fault} {seed}")
    moment = rng.uniform(-0.2, 1.05) * SECONDS
    wrong: list[str] = []
    with EmulatedBoard(seed=seed + 1, bootloader=200 if seed % 2 else None, patience=0) as board:
        sender = begin_sender(board, moment)
        moving = net_steps(board) != START
        strike_fault(board, sender, fault, rng)
        try:
            _, err = sender.communicate(timeout=30)
        except subprocess.TimeoutExpired:
            sender.kill()
            return Struck([f"{fault} {seed}: the sender hangs"], "", "")
        board.wait(0.7)  # it takes the silence for the host's end after half a second
        stopped = at_rest(board)
        code = sender.returncode if sender.returncode >= 0 else 128 - sender.returncode
        # before that, Python's own start may meet the signal
        if moment > 0 and (b"Traceback" in err or code not in allowed_codes(fault)):
            wrong.append(f"exit {code}: {err.decode()[-200:]}")
        if code == 0 and stopped != COUNTS:
            wrong.append("exit 0 before the goal")
        if not on_the_line(stopped, START, COUNTS):
            wrong.append("not on the line")
        board.control("restore")
        completed = run_process("status", THREE_DOF, "--port", board.port, "--json")
        if completed.code:
            return Struck([*wrong, f"{fault} {seed}: status: {completed.err}"], "", "")
        position, counts = completed.json["position"], completed.json["pulses"]
        if position != "lost" and counts != stopped:
            wrong.append(f"{position} at {counts}")
        if position == "lost" and moving and fault not in RESETS:
            wrong.append("lost")
        onward = _go_on(board, position, wrong)
        return Struck([f"{fault} {seed} at {moment:.2f} s: {w}; pins {stopped}" for w in wrong], position, onward)


def _go_on(board: EmulatedBoard, position: str, wrong: list[str]) -> str:
    """The next commands, and what they show to be wrong. What a busy computer holds is resumed, five times at most."""
    before = net_steps(board)
    if position == "lost":
        if run_process(*send_command(board)).code != 5 or at_rest(board) != before:
            wrong.append("a lost position was gone on from")
        return "refused"
    how = "resumed"
    completed = run_process(*send_command(board, "--resume"))
    if completed.code == 2:
        how, completed = "sent again", run_process(*send_command(board))
    for _ in range(5):
        if completed.code == 5:
            how, completed = "resumed twice", run_process(*send_command(board, "--resume"))
    if completed.code or at_rest(board) != COUNTS:
        wrong.append(f"it does not go on: {completed.code} {completed.err}")
    return how


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("kinds", nargs="*", metavar="KIND", help=f"of {', '.join(FAULTS)}")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--jobs", type=int, default=2)
    arguments = options.parse_args()
    for kind in arguments.kinds or FAULTS:
        faults = FAULTS[kind]
        seeds = range(1000 * arguments.seed, 1000 * arguments.seed + len(faults))
        with ThreadPoolExecutor(arguments.jobs) as pool:
            struck = list(pool.map(run_fault, faults, seeds))
        good = sum(not s.wrong for s in struck)
        positions = ", ".join(f"{n} {outcome}" for outcome, n in Counter(s.position for s in struck).most_common())
        onward = ", ".join(f"{n} {outcome}" for outcome, n in Counter(s.onward for s in struck).most_common())
        print(f"{kind:16} truthful {good} of {len(faults)}; position {positions}; then {onward}", flush=True)
        for line in (w for s in struck for w in s.wrong):
            print("   ", line, flush=True)


if __name__ == "__main__":
    main()
