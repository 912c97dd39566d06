"""What decides a word: SOLUTION and REACH; docs/solution.md derives the rest, and no word hangs on its size."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from importlib import import_module
from inspect import getsource
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import truth
from oracle import goal_of_joints
from shipped_arms import shipped_arm

import armkin
from armkin.inverse.numeric import tolerances
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.task import targets_of

PAGE = Path(__file__).parents[2] / "docs/solution.md"
TEXT = Path(tolerances.__file__).read_text()
ROOMS = ("singular", "answers", "run")
# What the rooms of edges compare or divide by besides: starts and stops of iterations, gates before them
STEPS = {
    *(
        "NEARBY",
        "SEED_RESIDUAL",
        "HOPELESS",
        "ARRIVED_STEP",
        "STALLED_RESIDUAL",
        "SMOOTH_ERROR",
        "FIRST_POINT",
    ),  # of Newton's method, polynomials
    *("STEP_VALUE_SQUARED", "OFF_CURVE_RESIDUAL", "CROSSING_VALUE", "SHORTEST_STEP"),  # of the walker
    *("FOLD_WAY", "FOLD_BEND", "APART_ROOTS"),  # gates: what they let pass is decided otherwise
    *("TINY", "NO_SIZE", "FAR_DISTANCE"),
    *("EQUAL_DECIMALS", "DECIMAL", "FLOAT32", "FEW_DIGITS"),  # of printed numbers
}
OFFSETS = np.array([0.0, 1e-12, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2])


def constants_below(head: str) -> dict[str, ast.expr]:
    """The constants below a heading, name to value."""
    lines = TEXT.split(f"# ---- {head}")[1].split("\n# ----")[0].split("\n", 1)[1]
    assignments = (node for node in ast.parse(lines).body if isinstance(node, ast.Assign))
    return {ast.unparse(node.targets[0]): node.value for node in assignments}


ALL = {*constants_below("what decides a word"), *constants_below("what follows from these")}


def deciding_modules() -> Iterator[ModuleType]:
    """Of the rooms that decide edges; `closest` minimises a distance, and says no word."""
    for room in ROOMS:
        package = import_module(f"armkin.inverse.{room}")
        yield from (
            import_module(f"{package.__name__}.{module.name}")
            for module in iter_modules(package.__path__)
            if module.name != "closest"
        )


def used_by(module: ModuleType) -> set[str]:
    """The tolerances that a module names."""
    attributes = (node for node in ast.walk(ast.parse(getsource(module))) if isinstance(node, ast.Attribute))
    return {node.attr for node in attributes if ast.unparse(node.value) == "tol"}


def changed_tolerances(**values: float) -> SimpleNamespace:
    """The tolerances, some with other values."""
    return SimpleNamespace(**{**vars(tolerances), **values})


def test_at_most_twelve_constants_decide_and_each_is_derived() -> None:
    """44 were imported by these rooms, each a number of its own."""
    deciding, following = constants_below("what decides a word"), constants_below("what follows from these")
    assert len(deciding) <= 12
    assert all(isinstance(value, ast.Constant) for value in deciding.values())
    for name, value in following.items():
        used = {node.id for node in ast.walk(value) if isinstance(node, ast.Name)}
        assert used, name
        assert used <= {*deciding, *following}, name
    assert {name for module in deciding_modules() for name in used_by(module)} <= {*deciding, *following, *STEPS}
    page = PAGE.read_text()
    assert all(f"| {name} |" in page for name in deciding)


def answer_words(sets: list[tuple[armkin.Arm, truth.Array, truth.Array | None]]) -> truth.Array:
    """Status, number of branches, completeness, number of free joints of each target."""
    answers = [armkin.ik(arm, target, near=near) for arm, target, near in sets]
    rows = [np.column_stack([s.status, s.valid.sum(axis=1), s.complete, s.free.sum(axis=1)]) for s in answers]
    return np.concatenate(rows).astype(float)


def typed_questions() -> list[tuple[armkin.Arm, truth.Array, truth.Array | None]]:
    """Typed targets, and some that leave each singular family."""
    sets: list[tuple[armkin.Arm, truth.Array, truth.Array | None]] = []
    for name, count in {"ur5e": 12, "puma560": 12, "thor": 8, "stanford": 8, "labvolt_5150": 8}.items():
        arm, screw = shipped_arm(name)
        task, _ = solver(arm, None)
        rng = np.random.default_rng(count)
        unit = np.where(arm.prismatic, arm.reach, 1.0)
        q = np.radians(45.0) * rng.integers(-4, 5, (count, arm.n))
        q = np.where(arm.prismatic, arm.reach / 8 * rng.integers(1, 4, q.shape), q)
        sets.append((arm, targets_of(task, armkin.fk(arm, q), q), None))
        for postures in truth.singular_postures(arm, screw, None, 1, seed=2).values():
            q = postures[0] + OFFSETS[:, None] * rng.uniform(0.3, 1.0, arm.n) * rng.choice([-1.0, 1.0], arm.n) * unit
            sets.append((arm, goal_of_joints(task, screw, q).array(), q))
    return sets


def test_no_word_hangs_on_the_others(monkeypatch: pytest.MonkeyPatch, sample: Callable[[int, int], int]) -> None:
    """All but SOLUTION and REACH three times as large or a third, at random, both ways round."""
    sets = typed_questions()
    before = answer_words(sets)
    assert {0, 1, 2} <= set(before[:, 0])
    fixed = {"SOLUTION", "REACH", "EQUAL_DECIMALS", "DECIMAL", "FLOAT32", "FEW_DIGITS", "TINY", "FAR_DISTANCE"}
    rooms = [module for module in deciding_modules() if used_by(module)]
    names = {*ALL, *STEPS} - fixed
    for seed in range(sample(4, 1)):
        sense = dict(zip(sorted({*ALL, *STEPS}), np.random.default_rng(seed).choice([-1, 1], 99), strict=False))
        for way in (1, -1):
            values = {name: getattr(tolerances, name) * 3.0 ** (way * sense[name]) for name in names}
            for module in rooms:
                monkeypatch.setattr(module, "tol", changed_tolerances(**values))
            np.testing.assert_array_equal(answer_words(sets), before)
    monkeypatch.undo()
    for module in rooms:
        monkeypatch.setattr(module, "tol", changed_tolerances(SOLUTION=3.0 * tolerances.SOLUTION))
    assert (answer_words(sets) != before).any()  # and on SOLUTION some do
