"""`export --js` in node beside `export --c` at -O2, one target at a time, and beside `armkin.ik`, list by list.

    python tests/bench/bench_js.py [ROBOT...]                  # microseconds a target, of the processor
    python tests/bench/bench_js.py --agree SEED [ROBOT...]     # 200 random and 100 typed poses: lists that differ

A joint to spare is held at home; for lists at five more values, too. For speed: random postures within limits (for
others the module looks for the nearest legal pose, which C does not), but for those that C leaves, at an edge: 0 to 5
of 1,000, which take the module up to a millisecond. Both programs answer the same targets in the same order, in turn,
the best round counts. The bars: 3 times C's time for closed forms, 3 ms for the general arms; no list that differs.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "export"))

from exported_js import ask_module, differences, goals_of

import armkin
from armkin.errors import UsageError
from armkin.export.c.c_program import identifier, program
from armkin.export.js.es_module import module_text
from armkin.inverse.solvers.choose_redundant_joint import redundancy
from armkin.model.arm import actual_arm
from armkin.robot_file import catalogue

ROUNDS, TURNS = 15, 5
_C = """
#include <stdio.h>
#include <time.h>
#include "arm.h"
static double goals[{count} * {size}];
int main(void) {{
  static {name}_solution found[64];
  double near[] = {{ {near} }}, best = 1e9;
  int edge, total = 0;
  FILE *file = fopen("goals.bin", "rb");
  if (!file || fread(goals, sizeof(double), {count} * {size}, file) != {count} * {size}) return 1;
  FILE *edges = fopen("edges.bin", "wb");
  for (int k = 0; k < {count}; k++) {{
    total += {name}_ik(goals + k * {size}, near, found, &edge);
    fputc(edge != 0, edges);
  }}
  fclose(edges);
  for (int round = 0; round < {rounds}; round++) {{
    clock_t began = clock();
    for (int k = 0; k < {count}; k++) total += {name}_ik(goals + k * {size}, near, found, &edge);
    double used = (double)(clock() - began) / CLOCKS_PER_SEC;
    if (used < best) best = used;
  }}
  printf("%.9f %d\\n", best, total);
}}
"""
_JS = """
import * as arm from './arm.mjs';
import {{ readFileSync }} from 'node:fs';
const raw = readFileSync('goals.bin');
const flat = new Float64Array(raw.buffer, raw.byteOffset, raw.length / 8);
const goals = Array.from({{ length: {count} }}, (_, k) => {{
  const one = Array.from(flat.subarray(k * {size}, (k + 1) * {size}));
  return one.length === 16 ? [0, 4, 8, 12].map((i) => one.slice(i, i + 4)) : one;
}});
const held = arm.redundant ? arm.home[arm.names.indexOf(arm.redundant)] : undefined;
let [best, total] = [1e9, 0];
for (let round = 0; round < {rounds}; round++) {{
  const began = process.cpuUsage();
  for (const goal of goals) total += arm.ik(goal, arm.home, held).branches.length;
  const used = process.cpuUsage(began);
  best = Math.min(best, (used.user + used.system) / 1e6);
}}
console.log(best.toFixed(9), total);
"""


def postures(arm: armkin.Arm, random: int, typed: int, seed: int) -> np.ndarray:
    """Joint values (random + typed, n): random ones, and multiples of 15, 30, 45 or 90 degrees."""
    rng = np.random.default_rng(seed)
    turn = np.where(arm.prismatic, arm.reach / 4, np.pi)
    step = rng.choice([15.0, 30.0, 45.0, 90.0], (typed, 1))
    values = np.round(rng.uniform(-180, 180, (typed, arm.n)) / step) * step
    round_values = np.where(arm.prismatic, 120.0 + values / 4, np.deg2rad(values))
    return np.concatenate([rng.uniform(-turn, turn, (random, arm.n)), round_values])


def speed_line(arm: armkin.Arm, folder: Path) -> str:
    """Microseconds a target in node and in C."""
    javascript = module_text(arm)
    general = "general elimination" in javascript.split("export", 1)[0]
    turn = np.where(arm.prismatic, arm.reach, np.pi)
    low, high = np.maximum(arm.lower, -turn), np.minimum(arm.upper, turn)
    q = np.random.default_rng(1).uniform(low, high, (200 if general else 2000, arm.n))
    if spare := redundancy(actual_arm(arm), None):  # both hold the joint to spare where `near` has it
        q[:, spare.joint] = arm.home[spare.joint]
    goals = armkin.fk(arm, q) if spare else goals_of(arm, q)
    texts = program(arm, "arm.c")
    (folder / "arm.c").write_text(texts.source)
    (folder / "arm.h").write_text(texts.header)
    (folder / "arm.mjs").write_text(javascript, encoding="utf-8")
    near = ", ".join(map(repr, arm.home.tolist()))

    def prepare(rounds: int) -> None:
        goals.tofile(folder / "goals.bin")
        fills = {"count": len(goals), "size": goals[0].size, "rounds": rounds}
        (folder / "ask.mjs").write_text(_JS.format(**fills))
        (folder / "main.c").write_text(_C.format(name=identifier(arm.name), near=near, **fills))
        subprocess.run(["gcc", "-std=c99", "-O2", "arm.c", "main.c", "-o", "ask", "-lm"], cwd=folder, check=True)

    def once(*command: str) -> float:
        completed = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
        return float(completed.stdout.split()[0]) / len(goals) * 1e6

    prepare(1)
    once("./ask")
    edges = np.fromfile(folder / "edges.bin", np.uint8) != 0
    goals = goals[~edges]
    prepare(ROUNDS)
    ours, theirs = np.min([[once("node", "ask.mjs"), once("./ask")] for _ in range(TURNS)], axis=0)
    return f"JS {ours:.2f} us, C {theirs:.2f} us, {ours / theirs:.2f} times; {edges.sum()} of {len(edges)} at an edge"


def agreement_line(arm: armkin.Arm, folder: Path, seed: int) -> str:
    """How many answers differ from Python's, and which."""
    q = postures(arm, 200, 100, seed)
    if spare := redundancy(actual_arm(arm), None):
        different = _held_differences(arm, folder, q, spare.joint)
    else:
        different = differences(arm, ask_module(arm, folder, q)["ik"], armkin.ik(arm, goals_of(arm, q)))
    return "\n".join([f"{len(different)} of {len(q)} differ", *(f"    {line}" for line in different)])


def _held_differences(arm: armkin.Arm, folder: Path, q: np.ndarray, joint: int) -> list[str]:
    """`differences` of an arm with a joint to spare, at home and at five more values of it."""
    low, high = max(arm.lower[joint], -np.pi), min(arm.upper[joint], np.pi)
    values = np.append(arm.home[joint], low + (high - low) * np.array([0.13, 0.37, 0.5, 0.71, 0.94]))
    q[:, joint] = values[np.arange(len(q)) % len(values)]
    near = np.tile(arm.home, (len(q), 1))
    near[:, joint] = q[:, joint]
    targets = armkin.fk(arm, q)
    answers = ask_module(arm, folder, q, near, targets, held=near[:, joint])["ik"]
    different = []
    for k, value in enumerate(values):
        mine = answers[k :: len(values)]
        for row in (row for answer in mine for row in answer["branches"]):
            del row["joints"][joint]
        locked_arm = armkin.lock(arm, {arm.joint_names[joint]: value})
        differing = differences(locked_arm, mine, armkin.ik(locked_arm, targets[k :: len(values)]))
        different += [f"held at {value:.4f}: {line}" for line in differing]
    return different


def main(words: list[str]) -> None:
    seed = int(words[1]) if words[:1] == ["--agree"] else None
    names = words[2:] if seed is not None else words
    for name in names or catalogue.robot_names():
        arm = armkin.load(name)
        with tempfile.TemporaryDirectory() as folder:
            try:
                line = speed_line(arm, Path(folder)) if seed is None else agreement_line(arm, Path(folder), seed)
            except UsageError as error:
                line = str(error).splitlines()[0]
        print(f"{name:14} {line}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
