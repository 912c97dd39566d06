"""Every branch of every class of arms, by the thousand: hit rates, branch counts and accuracy as a table.

    python tests/bench/check_ik.py [--robots] [--classes] [--near] [--oracle] [--poses 10000] [--arms 50] [--only TEXT]
    python tests/bench/check_ik.py [--postures] [--surfaces] [--leaving] [--rounded] [--share 1.0] [--seed 0]

Without a choice all tables are made; `--only TEXT` are robots or classes whose name holds it. The second line asks what
people ask: round postures, singular surfaces, what is beside them, rounded targets; `--share 0.1` a tenth of them,
`--seed` other arms of the classes and of right angles. The oracle is a multi-start Newton iteration on screws that
shares no code with armkin; EAIK and ssik are compared as well where they are installed and fit the arm.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "inverse"))

import oracle
import truth
from geometries import CLASSES, random_case, right_angles
from geometries import case_of as case_of
from ik_checks import Array, Report, examine_answers, not_found, random_joints
from moved_axes import OFF, move_axes
from shipped_arms import NAMES, shipped_arm

import armkin
from armkin.errors import UsageError
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.model.arm import Arm

HEAD = "method | poses | lost | branches | mm | deg | twice | us/pose"


def print_row(name: str, reports: list[Report], seconds: float, extra: str = "") -> None:
    """One line of a table; lost: generating joints that are not among the branches."""
    poses = sum(len(r.q) for r in reports)
    methods = ", ".join(sorted({r.solutions.method for r in reports}))
    mean = np.mean([r.counts.mean() for r in reports])
    most = max(r.counts.max() for r in reports)
    print(
        f"| {name} | {methods} | {poses} | {sum(int(r.lost.sum()) for r in reports)} | {mean:.2f} / {most} "
        f"| {max(r.mm for r in reports):.0e} | {max(r.deg for r in reports):.0e} "
        f"| {sum(r.duplicates for r in reports)} | {1e6 * seconds / poses:.0f} |{extra}",
        flush=True,
    )


def peer_agreement(reports: list[Report], poses: int = 1000) -> str:
    """On how many poses the peers find as many branches, where they are installed and can solve the arm."""
    texts = []
    for name, peer in (("EAIK", eaik_counter), ("ssik", ssik_counter)):
        same = total = 0
        for report in reports:
            solve = peer(report)
            if solve is not None:
                part = range(min(len(report.q), max(poses // len(reports), 1)))
                same += sum(solve(report.goals.T[k]) == report.counts[k] for k in part)
                total += len(part)
        if total:
            texts.append(f"{name} agrees on {same} of {total}")
    return " " + ", ".join(texts) if texts else ""


def eaik_counter(report: Report) -> Callable[[Array], int] | None:
    """Its number of branches for poses of six revolute joints, if it knows a decomposition of the arm."""
    try:
        from eaik.IK_HP import HPRobot
    except ImportError:
        return None
    screw = report.screw
    if report.solutions.task.name != "pose" or len(screw.w) != 6 or screw.prismatic.any():
        return None
    points = np.concatenate([np.zeros((1, 3)), screw.p, screw.M[None, :3, 3]]) / 1000
    robot = HPRobot(screw.w, np.diff(points, axis=0))
    if not robot.hasKnownDecomposition() or "NO_PARALLEL_NO_INTERSECTING" in robot.getKinematicFamily():
        return None  # in that family it calls all its answers approximate

    def solve(T: Array) -> int:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = T[:3, :3] @ screw.M[:3, :3].T, T[:3, 3] / 1000
        answer = robot.IK(pose)
        return int((~np.array(answer.is_LS, dtype=bool)).sum())

    return solve


def ssik_counter(report: Report) -> Callable[[Array], int] | None:
    """Its number of branches for the arms that it is shipped with and that are general: Kinova's JACO."""
    try:
        from ssik.prebuilt.kinova import jaco2_ik
    except ImportError:
        return None
    if report.arm.name != "jaco_j2n6s300":
        return None

    def solve(T: Array) -> int:
        pose = T.copy()
        pose[:3, 3] /= 1000
        return len(jaco2_ik.solve(pose, respect_limits=False))

    return solve


def check_robots(poses: int, only: str) -> None:
    print(f"\n| shipped robot | {HEAD} |\n|---|---|---|---|---|---|---|---|---|")
    for name in NAMES:
        if only in name:
            arm, screw = shipped_arm(name)
            begin = time.perf_counter()
            report = examine_answers(arm, screw, None, random_joints(screw, poses, 1))
            print_row(name, [report], time.perf_counter() - begin, peer_agreement([report]))


def check_classes(poses: int, arms: int, only: str) -> None:
    print(f"\n| class, {arms} random arms | {HEAD} |\n|---|---|---|---|---|---|---|---|---|")
    for name in CLASSES:
        if only in name:
            begin, reports = time.perf_counter(), []
            for seed in range(arms):
                case = random_case(name, seed)
                q = random_joints(case.screw, max(poses // arms, 1), seed)
                reports.append(examine_answers(case.arm, case.screw, case.task, q))
            print_row(name, reports, time.perf_counter() - begin, peer_agreement(reports))


def check_near_classes(poses: int, only: str) -> None:
    print(f"\n| class, off by | {HEAD} |\n|---|---|---|---|---|---|---|---|---|")
    for name in CLASSES:
        if only in name and "general" not in name:
            for size in OFF:
                case = random_case(name, 1)
                arm, screw = move_axes(case.arm, size, 1)
                begin = time.perf_counter()
                report = examine_answers(arm, screw, case.task, random_joints(screw, max(poses, 1), 1))
                print_row(f"{name}, {size:.0e}", [report], time.perf_counter() - begin)


def against_oracle(poses: int, arms: int, only: str) -> None:
    """Branches that the oracle knows and armkin does not: poses on shipped robots, and over random arms of a class."""
    print("\n| robot or class | arms | poses | branches | oracle's branches missing | |\n|---|---|---|---|---|---|")
    for name in [*NAMES, *CLASSES]:
        if only in name:
            reports = []
            for seed in range(arms if name in CLASSES else 1):
                if name in CLASSES:
                    case = random_case(name, seed)
                    q = random_joints(case.screw, max(poses // arms, 1), seed + 1000)
                    reports.append(examine_answers(case.arm, case.screw, case.task, q))
                else:
                    arm, screw = shipped_arm(name)
                    reports.append(examine_answers(arm, screw, None, random_joints(screw, max(poses, 1), 2)))
            weak = []
            for report in reports:
                for begin in range(0, len(report.q), 50):
                    part = np.arange(begin, min(begin + 50, len(report.q)))
                    missing = not_found(report, part, 60 if report.arm.n < 4 else 250, 3)
                    weak += [oracle.weakness(report.screw, report.goals.take([k]), q[None])[0] for k, q in missing]
            count, branches = (
                sum(column) for column in zip(*((len(r.q), r.counts.sum()) for r in reports), strict=True)
            )
            weak_text = " ".join(f"{w:.0e}" for w in weak[:5])
            print(f"| {name} | {len(reports)} | {count} | {branches} | {len(weak)} | {weak_text} |", flush=True)


ASKED = "| robot or class | asked | targets | wrong | complete | singular | us/pose |\n|---|---|---|---|---|---|---|"


RIGHT_ANGLES = "6R right angles"


def asked_arms(only: str, first: int) -> Iterator[tuple[str, Arm, oracle.Screws, str | None, int, int]]:
    """Shipped robots, an arm of every class, right-angled ones; how many postures and how many targets each is asked.

    only: part of a name, "shipped" or "classes"; first: seed of a class's arm, and of the first right-angled one.
    """
    for name in NAMES:
        if only in name or only == "shipped":
            yield name, *shipped_arm(name), None, 4096, 1000
    for name in CLASSES:
        if only in name or only == "classes":
            case = random_case(name, first)
            yield name, case.arm, case.screw, case.task, 50, 50
    counts: dict[str, int] = {}
    for seed in range(first, first + (200 if only in RIGHT_ANGLES else 0)):
        made = case_of(right_angles(np.random.default_rng(seed)), "pose")
        with suppress(UsageError):  # it cannot reach poses at will
            method = solver(made.arm, "pose")[1].name
            counts[method] = counts.get(method, 0) + 1
            if counts[method] <= 5:
                yield f"{RIGHT_ANGLES} {seed}, {method}", made.arm, made.screw, "pose", 500, 500


def print_asked(
    name: str, label: str, arm: Arm, screw: oracle.Screws, task: str | None, q: Array, target: Array, check: int
) -> None:
    """A line: what is wrong with the answers to targets made from postures, near home and near the postures.

    check: how many of them the oracle is asked about; over all lines it is a hundred or more for an arm.
    """
    begin = time.perf_counter()
    armkin.ik(arm, target, task)
    seconds = time.perf_counter() - begin
    verdict = truth.judge(arm, screw, task, q, target)
    beside = truth.judge(arm, screw, task, q, target, near=q)
    few = np.unique(np.linspace(0, len(q) - 1, min(check, len(q))).astype(int))
    truth.ask_oracle(arm, screw, verdict, target, few, 60 if arm.n < 4 else 250, 3)
    s = verdict.solutions
    wrong = "; ".join(str(v).partition(": ")[2].rpartition("; ")[0] for v in (verdict, beside) if not v) or "none"
    print(
        f"| {name} | {label} | {len(q)} | {wrong} | {s.complete.mean():.3f} "
        f"| {(s.status == armkin.Status.SINGULAR).mean():.3f} | {1e6 * seconds / max(len(q), 1):.0f} |",
        flush=True,
    )


def check_postures(share: float, seed: int, only: str) -> None:
    print(f"\n{ASKED}")
    for name, arm, screw, task, count, _ in asked_arms(only, seed):
        for step in (90, 45):
            q = truth.round_postures(arm, step, max(int(count * share), 1))
            definition, _ = solver(arm, task)
            print_asked(
                name,
                f"multiples of {step}",
                arm,
                screw,
                task,
                q,
                oracle.goal_of_joints(definition, screw, q).array(),
                25,
            )


def check_surfaces(share: float, seed: int, only: str) -> None:
    print(f"\n{ASKED}")
    for name, arm, screw, task, _, count in asked_arms(only, seed):
        definition, _ = solver(arm, task)
        for label, q in truth.singular_postures(arm, screw, task, max(int(count * share), 1)).items():
            print_asked(name, label, arm, screw, task, q, oracle.goal_of_joints(definition, screw, q).array(), 5)


def check_leaving(share: float, seed: int, only: str) -> None:
    """Postures beside singular surfaces, and on them, but their poses rounded."""
    print(f"\n{ASKED}")
    for name, arm, screw, task, _, count in asked_arms(only, seed):
        definition, _ = solver(arm, task)
        surfaces = truth.singular_postures(arm, screw, task, max(int(count * share), 1), seed)
        q, rng = np.concatenate([np.zeros((0, arm.n)), *surfaces.values()]), np.random.default_rng(seed)
        way = rng.uniform(0.3, 1.0, q.shape) * rng.choice([-1.0, 1.0], q.shape)
        way *= 10.0 ** rng.uniform(-12, -2, (len(q), 1)) * np.where(arm.prismatic, arm.reach, 1.0)
        beside = oracle.goal_of_joints(definition, screw, q + way).array()
        print_asked(name, "off by 1e-12 to 1e-2", arm, screw, task, q + way, beside, 5)
        target = oracle.goal_of_joints(definition, screw, q).array()
        for digits in (7, 8) if definition.orientation == "full" else ():
            print_asked(
                name, f"{digits} digits, matrices", arm, screw, task, q, truth.printed_matrices(target, digits), 5
            )


def check_rounded(share: float, seed: int, only: str) -> None:
    print(f"\n{ASKED}")
    for name, arm, screw, task, _, count in asked_arms(only, seed):
        definition, _ = solver(arm, task)
        q = random_joints(screw, max(int(count * share), 1), 5)
        target = oracle.goal_of_joints(definition, screw, q).array()
        for digits in (3, 4, 5, 6, 7, 7.5, 8, 9, 10, 11, 12, 13, 14, 15, 16):
            what = "float32" if digits == 7.5 else f"{digits} digits"
            print_asked(name, what, arm, screw, task, q, truth.typed_targets(definition, target, digits), 2)
            if definition.orientation == "full" and digits >= 7:
                print_asked(name, f"{what}, matrices", arm, screw, task, q, truth.printed_matrices(target, digits), 2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    choices = ("robots", "classes", "near", "oracle", "postures", "surfaces", "leaving", "rounded")
    for choice in choices:
        parser.add_argument(f"--{choice}", action="store_true")
    parser.add_argument(
        "--poses", type=int, default=10_000, help="for each robot or class; a tenth for --near and --oracle"
    )
    parser.add_argument("--arms", type=int, default=50, help="random arms of a class, for --classes and --oracle")
    parser.add_argument("--share", type=float, default=1.0, help="of the postures, surfaces and rounded targets")
    parser.add_argument("--seed", type=int, default=0, help="of the arms that are asked round postures and surfaces")
    parser.add_argument("--only", default="", help="robots or classes whose name holds this")
    args = parser.parse_args()
    everything = not any(getattr(args, choice) for choice in choices)
    if args.robots or everything:
        check_robots(args.poses, args.only)
    if args.classes or everything:
        check_classes(args.poses, args.arms, args.only)
    if args.near or everything:
        check_near_classes(args.poses // 10, args.only)
    if args.oracle or everything:
        against_oracle(args.poses // 10, args.arms, args.only)
    tables = {
        "postures": check_postures,
        "surfaces": check_surfaces,
        "leaving": check_leaving,
        "rounded": check_rounded,
    }
    for choice, table in tables.items():
        if getattr(args, choice) or everything:
            table(args.share, args.seed, args.only)


if __name__ == "__main__":
    main()
