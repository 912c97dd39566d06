"""Keep-outs held to their bars: distances against coal, motions against thousands of samples, branches, and speed.

    pip install -e '.[bench]'
    python tests/bench/bench_keep_out.py --pairs 1000000      # against coal, and formulas in extended precision
    python tests/bench/bench_keep_out.py --motions 10000      # joint moves, each sampled 3,000 times
    python tests/bench/bench_keep_out.py --targets 10000      # the best branch is free whenever one is
    python tests/bench/bench_keep_out.py --speed              # a posture in C and numpy, a path of 10,000 samples

Scenes and postures are drawn from `--seed`; times are the least of several, in seconds of the processor.
"""

from __future__ import annotations

import argparse
import itertools
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

import armkin
from armkin.formula.arrays import Array
from armkin.keep_out.bodies import segment_ends
from armkin.keep_out.body_pairs import Guard, guard
from armkin.keep_out.shapes.box import Box
from armkin.keep_out.shapes.capsule import Capsule
from armkin.keep_out.shapes.floor import Floor
from armkin.model.arm import Arm
from armkin.motion.joint_moves import plan_joint_moves
from armkin.motion.plan.trajectory_proof import prove_trajectory
from armkin.motion.timing.trajectory import Trajectory

ARMS = ("three_dof", "ur5e", "ar4", "cobra600")
SAMPLES = 3000
DEEP = 0.01  # mm


def random_scenes(name: str, rng: np.random.Generator) -> Iterator[Arm]:
    """The arm in random scenes in which it can stand; its own bodies and a floor are always among them."""
    reach = armkin.load(name).reach
    while True:
        lines = ["keep_out:", "  - self", f"  - floor: {-rng.uniform(0.0, 0.3) * reach:.3f}"]
        for _ in range(3):
            low, size = rng.uniform(-1.0, 1.0, 3) * reach, rng.uniform(0.05, 0.6, 3) * reach
            turn = ", ".join(f"{x:.3f}" for x in rng.uniform(-180, 180, 3) * rng.integers(0, 2))
            lines.append(f"  - box: {{size: {size.round(3).tolist()}, xyz: {low.round(3).tolist()}, rpy: [{turn}]}}")
        a, b = rng.uniform(-1.0, 1.0, (2, 3)) * reach
        radius = rng.uniform(0.01, 0.1) * reach
        lines.append(f"  - capsule: {{from: {a.round(3).tolist()}, to: {b.round(3).tolist()}, radius: {radius:.3f}}}")
        with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
            file.write("\n".join(lines) + "\n")
            file.flush()
            try:
                arm = armkin.load(name, scene=file.name)
            except armkin.ArmkinError:
                continue
        yield replace(arm, max_speed=np.ones(arm.n), max_accel=np.ones(arm.n))


def random_joints(arm: Arm, rng: np.random.Generator, count: int) -> Array:
    """Joint values within limits, an unlimited turn within one turn."""
    span = np.where(arm.prismatic, arm.reach, np.pi)
    return rng.uniform(np.maximum(arm.lower, -span), np.minimum(arm.upper, span), (count, arm.n))


# distances ---------------------------------------------------------------------------------------------------------


def _exact_points(p: Any, c: Any, d: Any) -> Any:
    """Distance of points to segments, (3, M), in extended precision."""
    v = d - c
    length = (v * v).sum(axis=0)
    t = np.clip(((p - c) * v).sum(axis=0) / np.where(length > 0, length, 1), 0, 1)
    return np.sqrt(((p - c - t * v) ** 2).sum(axis=0))


def exact_between(a: Any, b: Any, c: Any, d: Any) -> Any:
    """Distance of segments: of their four ends, or along the common normal u x v where both feet are inside."""
    ends_ = [_exact_points(a, c, d), _exact_points(b, c, d), _exact_points(c, a, b), _exact_points(d, a, b)]
    u, v, w = b - a, d - c, c - a
    normal = np.cross(u, v, axis=0)
    square = (normal * normal).sum(axis=0)
    safe = np.where(square > 0, square, 1)
    s = (np.cross(w, v, axis=0) * normal).sum(axis=0) / safe
    t = (np.cross(w, u, axis=0) * normal).sum(axis=0) / safe
    inside = (square > 0) & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    across = np.abs((w * normal).sum(axis=0)) / np.sqrt(safe)
    return np.minimum(np.min(ends_, axis=0), np.where(inside, across, np.inf))


def exact_box(box: Box, a: Any, b: Any) -> Any:
    """Apart: the least of the ends' distances and of those to the twelve edges; overlapping: the least of the greatest
    of six heights, over the ends and the places where two of them are equal.
    """
    axes, centre, h = (np.asarray(x, dtype=np.longdouble) for x in (box.axes, box.centre, box.half))
    p, q = (axes.T @ (x - centre[:, None]) for x in (a, b))
    h = h[:, None]
    way = q - p
    with np.errstate(divide="ignore", invalid="ignore"):
        near, far = np.sort(np.array([(-h - p) / way, (h - p) / way]), axis=0)
    still = way == 0
    near = np.where(still, np.where(np.abs(p) <= h, -np.inf, np.inf), near).max(axis=0)
    far = np.where(still, np.inf, far).min(axis=0)
    enters = np.maximum(near, 0) <= np.minimum(far, 1)
    least = np.min([np.sqrt((np.maximum(np.abs(x) - h, 0) ** 2).sum(axis=0)) for x in (p, q)], axis=0)
    for axis in range(3):
        for signs in itertools.product((-1, 1), repeat=2):
            corner = np.insert(np.array(signs, dtype=np.longdouble), axis, 1)[:, None] * h
            opposite = corner.copy()
            opposite[axis] *= -1
            least = np.minimum(least, exact_between(p, q, corner + 0 * p, opposite + 0 * p))
    heights, slopes = np.concatenate([p - h, -p - h]), np.concatenate([way, -way])
    depth = np.minimum(heights.max(axis=0), (heights + slopes).max(axis=0))
    for i, j in itertools.combinations(range(6), 2):
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (heights[j] - heights[i]) / (slopes[i] - slopes[j])
        t = np.clip(np.where(np.isfinite(t), t, 0), 0, 1)
        depth = np.minimum(depth, (heights + t * slopes).max(axis=0))
    return np.where(enters, np.minimum(depth, 0), least)


def exact_distances(held: Guard, q: Array) -> Array:
    """Distances of all pairs, as `Guard.distances`, by other formulas in extended precision: (N, pairs)."""
    a, b = (np.asarray(x, dtype=np.longdouble) for x in segment_ends(held.arm, q))
    form, columns = held.bodies, []
    for pair_ in held.pairs:
        least = np.full(len(q), np.inf, dtype=np.longdouble)
        for i in np.flatnonzero(form.owner == pair_.body):
            if pair_.other is not None:
                for j in np.flatnonzero(form.owner == pair_.other):
                    far = exact_between(a[:, i], b[:, i], a[:, j], b[:, j]) - form.radius[pair_.other]
                    least = np.minimum(least, far)
                continue
            shape = dict(held.obstacles)[pair_.name]
            if isinstance(shape, Floor):
                far = np.minimum(a[2, i], b[2, i]) - shape.height
            elif isinstance(shape, Capsule):
                begin, end = (np.asarray(x, np.longdouble)[:, None] + 0 * a[:, i] for x in (shape.begin, shape.end))
                far = exact_between(a[:, i], b[:, i], begin, end) - shape.radius
            else:
                assert isinstance(shape, Box)
                far = exact_box(shape, a[:, i], b[:, i])
            least = np.minimum(least, far)
        columns.append(least - form.radius[pair_.body])
    return np.array(columns).T


class Coal:
    """The same by coal: a capsule of coal's for each segment, a half-space, boxes and capsules."""

    def __init__(self, held: Guard) -> None:
        import coal

        self.coal, self.held = coal, held
        self.request = coal.DistanceRequest(True)
        self.request.gjk_tolerance = self.request.epa_tolerance = 1e-13
        self.request.gjk_max_iterations = 1000
        self.solids = {}
        for name, shape in held.obstacles:
            if isinstance(shape, Floor):
                solid = coal.Halfspace(np.array([0.0, 0.0, 1.0]), shape.height), coal.Transform3s()
            elif isinstance(shape, Capsule):
                solid = self.capsule(shape.begin, shape.end, shape.radius)
            else:
                assert isinstance(shape, Box)
                solid = coal.Box(*(2 * shape.half)), self.placed(shape.axes, shape.centre)
            self.solids[name] = solid

    def placed(self, R: Array, t: Array) -> Any:
        return self.coal.Transform3s(np.asarray(R), np.asarray(t))

    def capsule(self, a: Array, b: Array, radius: float) -> tuple[Any, Any]:
        way = b - a
        length = float(np.linalg.norm(way))
        if length < 1e-9:
            return self.coal.Sphere(radius), self.placed(np.eye(3), a)
        z = way / length
        x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
        x /= np.linalg.norm(x)
        return self.coal.Capsule(radius, length), self.placed(np.column_stack([x, np.cross(z, x), z]), (a + b) / 2)

    def distances(self, q: Array) -> Array:
        form, held = self.held.bodies, self.held
        a, b = segment_ends(held.arm, q)
        distances = np.empty((len(q), len(held.pairs)))
        for n in range(len(q)):
            bodies = [self.capsule(a[:, s, n], b[:, s, n], form.radius[o]) for s, o in enumerate(form.owner)]
            for k, pair_ in enumerate(held.pairs):
                of_body = [bodies[s] for s in np.flatnonzero(form.owner == pair_.body)]
                if pair_.other is None:
                    of_other = [self.solids[pair_.name]]
                else:
                    of_other = [bodies[s] for s in np.flatnonzero(form.owner == pair_.other)]
                distances[n, k] = min(self.one(x, y) for x in of_body for y in of_other)
        return distances

    def one(self, x: tuple[Any, Any], y: tuple[Any, Any]) -> float:
        answer = self.coal.DistanceResult()
        self.coal.distance(x[0], x[1], y[0], y[1], self.request, answer)
        return float(answer.min_distance)


def print_pairs(count: int, rng: np.random.Generator, oracle: bool) -> None:
    print("| arm | pairs | overlap | from exact | coal, apart | signs differ |")
    print("|---|---|---|---|---|---|")
    for name in ARMS:
        compared = hit = signs = 0
        worst = coal_error = 0.0
        for arm in random_scenes(name, rng):
            held, q = guard(arm), random_joints(arm, rng, 200)
            clearances, exact = held.distances(q), exact_distances(guard(arm), q)
            compared, hit = compared + clearances.size, hit + int((clearances < 0).sum())
            worst = max(worst, float(np.abs(clearances - exact).max()))
            signs += int(((clearances < 0) != (exact < 0)).sum())
            if oracle:
                coal = Coal(held).distances(q)
                apart = clearances > 0
                coal_error = max(coal_error, float(np.abs(clearances - coal)[apart].max()))
                signs += int((((clearances < 0) != (coal < 0)) & (np.abs(clearances) > 1e-9)).sum())
            if compared >= count / len(ARMS):
                break
        error_text = f"{coal_error:.1e}" if oracle else "-"
        print(f"| {name} | {compared} | {hit} | {worst:.1e} | {error_text} | {signs} |", flush=True)


# motions -----------------------------------------------------------------------------------------------------------


def print_motions(count: int, rng: np.random.Generator) -> None:
    """Joint moves from free postures to free ones, through one or two waypoints, each sampled."""
    print("| arm | motions | free | free, hit deeper | deepest mm | refused, none hit | postures: median, most |")
    print("|---|---|---|---|---|---|---|")
    share = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    for name in ARMS:
        count_done = free = wrong = needless = 0
        deepest, looked = 0.0, []
        for arm in random_scenes(name, rng):
            held, q = guard(arm), random_joints(arm, rng, 600)
            q = q[held.least_clearances(q)[0] >= 0]
            for a, b in zip(q[0::2][:125], q[1::2][:125], strict=False):
                b = b if rng.random() < 0.5 else np.clip(a + rng.uniform(0.02, 0.5) * (b - a), arm.lower, arm.upper)
                proof = prove_trajectory(plan_joint_moves(arm, a, b))
                assert proof is not None
                least = float(held.least_clearances(a + share * (b - a))[0].min())
                count_done, free = count_done + 1, free + proof.free
                looked.append(proof.postures)
                if proof.free:
                    deepest = min(deepest, least)
                    wrong += least < -DEEP
                else:
                    needless += least >= 0
            if count_done >= count / len(ARMS):
                break
        tally = f"{np.median(looked):.0f}, {max(looked)}"
        print(f"| {name} | {count_done} | {free} | {wrong} | {deepest:.4f} | {needless} | {tally} |", flush=True)


def print_targets(count: int, rng: np.random.Generator) -> None:
    """Targets of random postures: is the best branch free whenever one within limits is?"""
    print("| arm | targets | some branch free | best is not | best hits |")
    print("|---|---|---|---|---|")
    for name in ARMS:
        count_done = with_free = missed = hit = 0
        for arm in random_scenes(name, rng):
            q = random_joints(arm, rng, 250)
            solutions = armkin.ik(arm, goals_of(arm, q))
            rows = exact_distances(guard(arm), np.nan_to_num(solutions.q.reshape(-1, arm.n)))
            free = ((rows.min(axis=1) >= 0).reshape(solutions.valid.shape)) & solutions.within_limits & solutions.valid
            best = solutions.best
            taken = np.take_along_axis(free, np.maximum(best, 0)[:, None], axis=1)[:, 0]
            count_done, with_free = count_done + len(q), with_free + int(free.any(axis=1).sum())
            missed += int((free.any(axis=1) & (best < 0)).sum())
            hit += int(((best >= 0) & ~taken).sum())
            if count_done >= count / len(ARMS):
                break
        print(f"| {name} | {count_done} | {with_free} | {missed} | {hit} |", flush=True)


def goals_of(arm: Arm, q: Array) -> Array:
    """Targets of the arm's own task."""
    from armkin.forward import fk
    from armkin.inverse.tasks.choose_task import task_for
    from armkin.inverse.tasks.task import targets_of

    return targets_of(task_for(arm), fk(arm, q), q)


# speed -------------------------------------------------------------------------------------------------------------


def best_time(job: Callable[[], object], rounds: int = 7) -> float:
    """Seconds of the processor, the least of several."""
    times = []
    for _ in range(rounds):
        began = time.process_time()
        job()
        times.append(time.process_time() - began)
    return min(times)


BENCH = """keep_out:
  - self
  - floor: 0
  - box: {{min: [{0}, {1}, 0], max: [{2}, {3}, {4}]}}
  - box: {{size: [{4}, {3}, {2}], xyz: [{1}, {2}, {3}], rpy: [0, 0, 30]}}
  - box: {{size: [{4}, {4}, {2}], xyz: [{1}, {1}, {3}], rpy: [10, 20, 30]}}
"""


def print_speed() -> None:
    print("| arm, with self, floor, three boxes | C us | numpy us |")
    print("|---|---|---|")
    rng = np.random.default_rng(1)
    for name in (*ARMS, "so101", "parol6"):
        reach = armkin.load(name).reach
        with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
            file.write(BENCH.format(*(f"{x * reach:.1f}" for x in (0.5, -0.6, 0.9, 0.6, 0.15))))
            file.flush()
            arm = armkin.load(name, scene=file.name)
        q = random_joints(arm, rng, 20_000)
        fast = armkin.compile(arm)
        fast.clearance(q)
        c, plain = best_time(lambda: fast.clearance(q)), best_time(lambda: armkin.clearance(arm, q))
        print(f"| {name} | {c / len(q) * 1e6:.2f} | {plain / len(q) * 1e6:.2f} |", flush=True)
    _print_path()


def _print_path() -> None:
    """A path of 10,000 samples on a bench, proved."""
    for name in ("three_dof", "ur5e", "ar4"):
        arm = armkin.load(name, scene=f"examples/scenes/{name}.yaml")
        arm = replace(arm, max_speed=np.ones(arm.n), max_accel=np.ones(arm.n))
        guard(arm)
        rng = np.random.default_rng(3)
        for _ in range(200):
            q = random_joints(arm, rng, 400)
            mm = np.asarray(armkin.clearance(arm, q).mm)
            q = q[mm > 10]
            if len(q) < 13:
                continue
            way = _curve_through(arm, np.concatenate([q[:1], q[:1] + 0.25 * (q[1:13] - q[:1])]))
            proof = prove_trajectory(way, tight=True)
            if proof is not None and proof.free:
                break
        assert proof is not None
        took = best_time(lambda: prove_trajectory(way, tight=True))
        print(f"{name}: a path of 10,000 samples proved in {took * 1e3:.1f} ms, {proof.postures} postures")


def _curve_through(arm: Arm, corners: Array) -> Trajectory:
    """One curve of 10,000 cells through postures: smooth between them."""
    from armkin.motion.timing.cubic_knots import Knots
    from armkin.motion.timing.curved_stretch import Curve

    u = np.linspace(0.0, len(corners) - 1.0, 10_001)
    i = np.minimum(u.astype(int), len(corners) - 2)
    s = (u - i)[:, None]
    way = corners[i + 1] - corners[i]
    q = corners[i] + (3 * s**2 - 2 * s**3) * way
    d = (6 * s - 6 * s**2) * way
    path = Knots(u, q, d)
    return Trajectory(arm, corners[0], (Curve(path, np.ones(len(u))),))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("pairs", "motions", "targets"):
        parser.add_argument(f"--{name}", type=int, default=0)
    parser.add_argument("--no-coal", action="store_true")
    parser.add_argument("--speed", action="store_true")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    if arguments.pairs:
        print_pairs(arguments.pairs, np.random.default_rng(arguments.seed), not arguments.no_coal)
    if arguments.motions:
        print_motions(arguments.motions, np.random.default_rng(arguments.seed))
    if arguments.targets:
        print_targets(arguments.targets, np.random.default_rng(arguments.seed))
    if arguments.speed:
        os.environ.setdefault("OMP_NUM_THREADS", "1")
        print_speed()


if __name__ == "__main__":
    main()
