"""The public names: all there, found lazily, cheap to import, and firm about what they are given."""

import ast
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armkin
from command_line import ROOT, THREE_DOF

HEAVY = ("numpy", "pydantic", "yaml", "serial", "rich", "matplotlib")


@pytest.mark.parametrize("name", armkin.__all__)
def test_every_public_name_is_there_and_documented(name: str) -> None:
    value = getattr(armkin, name)
    assert name in dir(armkin)
    assert name == "__version__" or (value.__doc__ or "").strip()


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse((ROOT / "src/armkin/__init__.py").read_text())
    [block] = [node for node in tree.body if isinstance(node, ast.If)]
    seen = {
        alias.asname: (node.module, alias.name)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == {name: (f"armkin.{module}", name) for name, module in armkin._HOME.items()}


def test_an_unknown_name_lists_the_names() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'fkk'; it has .*fk"):
        armkin.fkk  # noqa: B018


def test_no_module_has_the_name_of_a_public_function() -> None:
    """Importing such a module would put it where the function was."""
    modules = {path.stem for path in (ROOT / "src/armkin").iterdir()}
    assert not modules & set(armkin.__all__)


def test_every_public_function_is_called_after_all_modules_are_imported(tmp_path: Path) -> None:
    """A submodule that is imported becomes a name of its package: it may replace none that people call."""
    code = (
        f"SVG = {str(ROOT / 'examples' / 'drawing.svg')!r}"
        + """
import importlib, inspect, pkgutil
import numpy as np
import armkin
for module in pkgutil.walk_packages(armkin.__path__, "armkin."):
    if "__main__" not in module.name:
        importlib.import_module(module.name)
arm, panda = armkin.load("three_dof"), armkin.load("panda")
q = np.array([0.1, 0.2, 0.3])
T, p = armkin.fk(arm, q), armkin.fk(arm, q)[:3, 3]
many = np.random.default_rng(1).uniform(-1, 1, (30, 3))
calls = {
    "calibrate": lambda f: f(arm, many, armkin.fk(arm, many)[:, :3, 3]),
    "load": lambda f: f("three_dof"),
    "lock": lambda f: f(panda, {"J3": 0.0}),
    "unlock": lambda f: f(panda, {"J3": 0.0}, np.zeros(6)),
    "closest": lambda f: f(arm, [2000, 0, 0]),
    "ik": lambda f: f(arm, p),
    "method": lambda f: f(arm),
    "compile": lambda f: f,  # a compiler is asked for elsewhere
    "path": lambda f: f(arm, [[350, 0, 300], [350, 50, 300]], start=armkin.ik(arm, [350, 0, 300]).q[0]),
    "drawing": lambda f: f(arm, SVG, [320, -50, 200]),
    "time_law": lambda f: f(arm, np.linspace(0, 0.1, 20)[:, None] * [1, 1, 1]),
    "joints": lambda f: f(arm, [100, 200, 300]),
    "reach": lambda f: f(arm, grid=200.0, azimuths=6),
    "place": lambda f: f(arm, [[300, 0, 300]], step=400.0, yaw=3.0),
    "workspace": lambda f: f(arm, 100),
}
called = 0
for name in armkin.__all__:
    function = getattr(armkin, name)
    assert not inspect.ismodule(function), name
    if inspect.isfunction(function):
        assert calls.get(name, lambda f: f(arm, q))(function) is not None, name
        called += 1
print(called)
"""
    )
    completed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert completed.returncode == 0, completed.stderr
    assert int(completed.stdout) > 20


@pytest.mark.parametrize(
    "code",
    [
        "import armkin; armkin.UsageError",
        "from armkin.cli.app import run; run(['--help'])",
        "from armkin.cli.app import run; run(['--version'])",
    ],
)
def test_start_up_imports_nothing_heavy(code: str) -> None:
    report = f"{code}\nimport sys; print('LOADED', *sorted({{m.partition('.')[0] for m in sys.modules}}))"
    completed = subprocess.run([sys.executable, "-c", report], capture_output=True, text=True, check=True, cwd=ROOT)
    loaded = completed.stdout.rpartition("LOADED")[2].split()
    assert not set(HEAVY) & set(loaded)


BAD = {
    "text": "abc",
    "numbers in quotes": ["1", "2", "3"],
    "lists of unequal lengths": [[1, 2, 3], [1, 2]],
    "complex": np.zeros(3, dtype=complex),
    "dates": np.array(["2020-01-01"] * 3, dtype="M8[D]"),
    "a mapping": {},
    "one number": 1.0,
    "two of three": [1, 2],
}


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize(
    "name", ["fk", "frames", "jacobian", "manipulability", "ik", "closest", "turns", "pulses", "joints", "best_pulses"]
)
def test_what_is_no_array_of_joint_values_is_refused(name: str, bad: str) -> None:
    arm = armkin.load(ROOT / THREE_DOF)
    with pytest.raises(armkin.UsageError):
        getattr(armkin, name)(arm, BAD[bad])
    if name in ("ik", "closest", "turns"):
        with pytest.raises(armkin.UsageError):
            getattr(armkin, name)(arm, [390, 80, 300], near=BAD[bad])


def test_ordinary_arrays_of_any_kind_are_taken() -> None:
    arm = armkin.load(ROOT / THREE_DOF)
    rows = np.random.default_rng(0).integers(-3, 3, (6, 3)).astype(float)
    kinds = [rows.tolist(), rows.astype(np.float32), rows.astype(int), rows.astype(object), np.asfortranarray(rows)]
    for kind in (*kinds, rows[::-1][::-1], np.broadcast_to(rows, (6, 3))):
        assert np.array_equal(armkin.fk(arm, kind), armkin.fk(arm, rows))


@pytest.mark.parametrize("robot", ["three_dof", "ur5e", "jaco_j2n6s300", "planar_3dof"])
@pytest.mark.parametrize("lead", [(0,), (2, 0)])
def test_a_batch_of_nothing_is_a_batch(robot: str, lead: tuple[int, ...]) -> None:
    arm = armkin.load(ROOT / f"robots/{robot}.yaml")
    one = armkin.ik(arm, armkin.fk(arm, arm.home), task="pose") if arm.n == 6 else armkin.ik(arm, [300.0, 10.0, 100.0])
    s = armkin.ik(arm, np.zeros((*lead, *one.target.shape)))
    assert s.q.shape[: len(lead)] == s.valid.shape[: len(lead)] == lead
    assert s.q.shape[-1] == arm.n
    assert s.status.shape == lead
    assert armkin.fk(arm, np.zeros((*lead, arm.n))).shape == (*lead, 4, 4)


def test_targets_beyond_arithmetic_are_refused() -> None:
    arm = armkin.load(ROOT / THREE_DOF)
    assert armkin.ik(arm, [1e15, 0, 0]).status == armkin.Status.UNREACHABLE
    for function in (armkin.ik, armkin.closest):
        with pytest.raises(armkin.UsageError, match="beyond"):
            function(arm, [1e300, 0, 0])


def test_joint_values_that_are_not_there_have_measures_that_are_not() -> None:
    """`Solutions.q` has rows of nan; what is computed from it keeps its shape."""
    arm = armkin.load(ROOT / THREE_DOF)
    q = np.array([[0.1, 0.2, 0.3], [np.nan] * 3])
    assert np.isnan(armkin.manipulability(arm, q)).tolist() == [False, True]
    assert np.isnan(armkin.condition(arm, q)).tolist() == [False, True]
    assert np.isnan(armkin.fk(arm, [np.inf, 0, 0])).any()


@pytest.mark.parametrize("value", [np.nan, np.inf, "0.5", [1, 2], 1j, None])
def test_a_joint_is_held_at_a_number(value: Any) -> None:
    with pytest.raises(armkin.UsageError):
        armkin.lock(armkin.load(ROOT / THREE_DOF), {"q1": value})


def test_solutions_show_themselves_in_a_line() -> None:
    s = armkin.ik(armkin.load(ROOT / "robots/three_dof.yaml"), [[390, 80, 300], [0, 0, 9000]])
    assert repr(s) == "<Solutions (2,) of three_dof, xyz: 4 branches, complete>"
