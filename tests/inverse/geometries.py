"""Random arms of every class that `armkin.ik` distinguishes, made as robot files.

`CLASSES` maps a class to ``(make, task)``: `make(rng)` returns the fields of a robot file. The axes of special
classes are built from points and directions (convention: screws), so that what is special is so to
rounding only; the classes of DH tables are special exactly.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from oracle import Screws, screws_of

from armkin.model.arm import Arm
from armkin.model.build_arm import arm_of_file
from armkin.robot_file import RobotFile

Array = NDArray[np.float64]
Fields = dict[str, Any]
Rng = np.random.Generator


class Case(NamedTuple):
    """A random arm, its screws for the oracle and the task to test."""

    arm: Arm
    screw: Screws
    task: str


# ---- robot files -------------------------------------------------------------------------------------------


def robot_of(fields: Fields) -> RobotFile:
    """A validated robot file; joints without a name are numbered."""
    joints = [{"name": f"J{i + 1}", **joint} for i, joint in enumerate(fields["joints"])]
    return RobotFile.model_validate_json(json.dumps({"name": "random", **fields, "joints": joints}))


def case_of(fields: Fields, task: str) -> Case:
    file = robot_of(fields)
    return Case(arm_of_file(file), screws_of(file), task)


def base_and_tool(rng: Rng) -> Fields:
    """A base and a tool at random."""
    return {
        "base": {"xyz": [*rng.uniform(-300, 300, 3)], "rpy": [*rng.uniform(-180, 180, 3)]},
        "tool": {"xyz": [*rng.uniform(-100, 100, 3)], "rpy": [*rng.uniform(-180, 180, 3)]},
    }


def random_dh(
    rng: Rng, pattern: str, alpha: list[float | None], a: list[float | None], d: list[float | None] | None = None,
    convention: str = "standard", **more: Any,
) -> Fields:  # fmt: skip
    """A DH table: None is a random number; offsets and signs are random."""

    def pick(value: float | None, low: float, high: float) -> float:
        return float(rng.uniform(low, high)) if value is None else value

    joints = []
    for i, kind in enumerate(pattern):
        row = {
            "alpha": pick(alpha[i], -170, 170),
            "a": pick(a[i], 50, 400) if rng.random() < 0.5 else pick(a[i], -400, -50),
            "d": pick(None if d is None else d[i], -300, 300),
            "theta": float(rng.uniform(-180, 180)),
        }
        joint: Fields = {"dh": row, "sign": int(rng.choice([-1, 1]))}
        if kind == "P":
            joint |= {"type": "prismatic", "limits": [-500, 500]}
        joints.append(joint)
    return {"convention": convention, "joints": joints, **more}


def random_screws(rng: Rng, pattern: str, w: list[Any], q: list[Any], **more: Any) -> Fields:
    """Axes by directions and points (None: random), the zero pose of the tool at random."""
    joints = []
    for kind, axis, point in zip(pattern, w, q, strict=True):
        direction = random_direction(rng) if axis is None else np.asarray(axis, dtype=float)
        place = rng.uniform(-300, 300, 3) if point is None else np.asarray(point, dtype=float)
        sign = int(rng.choice([-1, 1]))
        if kind == "P":
            screw: Fields = {"w": [0, 0, 0], "v": direction.tolist()}
            joints.append({"type": "prismatic", "screw": screw, "limits": [-500, 500], "sign": sign})
        else:
            joints.append({"screw": {"w": direction.tolist(), "q": place.tolist()}, "sign": sign})
    zero = {"xyz": [*rng.uniform(-500, 500, 3)], "rpy": [*rng.uniform(-180, 180, 3)]}
    return {"convention": "screws", "zero_pose": zero, "joints": joints, **more}


def random_direction(rng: Rng) -> Array:
    """A random direction."""
    v = rng.standard_normal(3)
    direction: Array = v / np.linalg.norm(v)
    return direction


def either_sign(rng: Rng, v: Array) -> Array:
    """v or -v."""
    return v * float(rng.choice([-1.0, 1.0]))


# ---- classes -----------------------------------------------------------------------------------------------

Make = Callable[[Rng], Fields]
CLASSES: dict[str, tuple[Make, str]] = {}


def add_class(name: str, task: str, make: Make) -> None:
    CLASSES[name] = (make, task)


@lru_cache(maxsize=128)
def random_case(name: str, seed: int) -> Case:
    """The seed-th random arm of a class; the same arm each time, as what is prepared of it is kept by arm."""
    make, task = CLASSES[name]
    return case_of(make(np.random.default_rng([seed, *name.encode()])), task)


_N = None
AXIS = dict(zip("xyz", np.eye(3), strict=True))
add_class("RRR general", "xyz", lambda r: random_dh(r, "RRR", [_N] * 3, [_N] * 3, **base_and_tool(r)))
add_class(
    "RRR modified DH",
    "xyz",
    lambda r: random_dh(r, "RRR", [_N] * 3, [_N] * 3, convention="modified", **base_and_tool(r)),
)
add_class("RRR 1 || 2", "xyz", lambda r: random_dh(r, "RRR", [0.0, _N, _N], [_N] * 3))
add_class("RRR 1 antiparallel 2", "xyz", lambda r: random_dh(r, "RRR", [180.0, _N, _N], [_N] * 3))
add_class("RRR 2 || 3", "xyz", lambda r: random_dh(r, "RRR", [_N, 0.0, _N], [_N] * 3, **base_and_tool(r)))
add_class("RRR 2 antiparallel 3", "xyz", lambda r: random_dh(r, "RRR", [_N, 180.0, _N], [_N] * 3))
add_class("RRR 1 meets 2", "xyz", lambda r: random_dh(r, "RRR", [_N] * 3, [0.0, _N, _N]))
add_class("RRR 2 meets 3", "xyz", lambda r: random_dh(r, "RRR", [_N] * 3, [_N, 0.0, _N]))
add_class("RRR 1, 2 and 3 meet in pairs", "xyz", lambda r: random_dh(r, "RRR", [_N] * 3, [0.0, 0.0, _N]))
add_class(
    "RRR orthogonal", "xyz", lambda r: random_dh(r, "RRR", [float(r.choice([-90, 90])) for _ in range(3)], [_N] * 3)
)
add_class("RRR orthogonal, 1 meets 2", "xyz", lambda r: random_dh(r, "RRR", [90.0, -90.0, _N], [0.0, _N, _N]))
add_class(
    "RRR orthogonal, no offsets", "xyz", lambda r: random_dh(r, "RRR", [90.0, 90.0, _N], [_N] * 3, [_N, 0.0, 0.0])
)
add_class("RRR anthropomorphic", "xyz", lambda r: random_dh(r, "RRR", [90.0, 0.0, _N], [0.0, _N, _N], [_N, 0.0, 0.0]))
for _p in ("RRP", "RPR", "PRR", "RPP", "PRP", "PPR", "PPP"):
    add_class(f"{_p} general", "xyz", lambda r, p=_p: random_dh(r, p, [_N] * 3, [_N] * 3, **base_and_tool(r)))
for _p, _w in {
    "RRP": "zxy", "RPR": "zyx", "PRR": "xzy", "RPP": "zzx", "PRP": "zzx", "PPR": "zxz", "PPP": "xyz",
}.items():  # fmt: skip
    add_class(
        f"{_p} right angles",
        "xyz",
        lambda r, p=_p, w=_w: random_screws(r, p, [either_sign(r, AXIS[k]) for k in w], [_N] * 3),
    )
add_class("RRP spherical", "xyz", lambda r: random_dh(r, "RRP", [-90.0, 90.0, 0.0], [0.0, 0.0, 0.0]))
add_class("RPP cylindrical", "xyz", lambda r: random_dh(r, "RPP", [0.0, -90.0, 0.0], [0.0, 0.0, 0.0]))


def planar_fields(rng: Rng, pattern: str) -> Fields:
    """Axes along +-z, slides in the plane; heights at random."""
    w = []
    for kind in pattern:
        angle = rng.uniform(-np.pi, np.pi)
        w.append([np.cos(angle), np.sin(angle), 0.0] if kind == "P" else [0.0, 0.0, float(rng.choice([-1, 1]))])
    return random_screws(rng, pattern, w, [None] * len(pattern))


for _t in itertools.product("RP", repeat=2):
    _p = "".join(_t)
    add_class(f"planar {_p}", "xy", lambda r, p=_p: planar_fields(r, p))
for _t in itertools.product("RP", repeat=3):
    _p = "".join(_t)
    if _p != "PPP":
        add_class(f"planar {_p}", "xy_theta", lambda r, p=_p: planar_fields(r, p))


def scara_fields(rng: Rng, lift: int) -> Fields:
    pattern = ["R"] * 3
    pattern.insert(lift, "P")
    return random_screws(rng, "".join(pattern), [either_sign(rng, np.array([0.0, 0, 1])) for _ in range(4)], [None] * 4)


for _k in range(4):
    add_class(f"SCARA, P at {_k + 1}", "xyz_yaw", lambda r, k=_k: scara_fields(r, k))


def pitch_fields(rng: Rng, n: int, first: str = "R", flat: bool = False) -> Fields:
    """A joint of any direction, three (anti)parallel ones, for n = 5 one more."""
    if flat:  # the usual table: shoulder on the base's axis, no offsets
        alpha: list[float | None] = [90.0, 0.0, 0.0, 0.0]
        a: list[float | None] = [0.0, None, None, None]
        d: list[float | None] = [None, 0.0, 0.0, 0.0]
        if n == 5:
            alpha[3], a[3], alpha, a, d = 90.0, 0.0, [*alpha, 0.0], [*a, 0.0], [*d, None]
            a[3] = 0.0
        fields = random_dh(rng, first + "R" * (n - 1), alpha, a, d)
        for joint in fields["joints"][1:4]:
            joint["sign"] = int(rng.choice([-1, 1]))
        return fields
    if rng.random() < 0.5:
        alpha = [None, float(rng.choice([0, 180])), float(rng.choice([0, 180])), *[None] * (n - 3)]
        return random_dh(rng, first + "R" * (n - 1), alpha, [None] * n, **base_and_tool(rng))
    axis = random_direction(rng)
    w = [None, *(either_sign(rng, axis) for _ in range(3)), *[None] * (n - 4)]
    return random_screws(rng, first + "R" * (n - 1), w, [None] * n)


for _n in (4, 5):
    _task = "xyz_pitch" if _n == 4 else "xyz_pitch_roll"
    add_class(f"pitch arm, {_n} joints", _task, lambda r, n=_n: pitch_fields(r, n))
    add_class(f"pitch arm, {_n} joints, usual table", _task, lambda r, n=_n: pitch_fields(r, n, flat=True))
    add_class(f"pitch arm, {_n} joints, slide first", _task, lambda r, n=_n: pitch_fields(r, n, "P"))


def rolled_fields(rng: Rng, first: str = "R") -> Fields:
    """A joint of any direction, two (anti)parallel ones, a roll about any direction, the tool off its axis."""
    alpha = [None, float(rng.choice([0, 180])), None, None]
    return random_dh(rng, first + "RRR", alpha, [None] * 4, **base_and_tool(rng))


add_class("roll arm", "xyz_roll", rolled_fields)
add_class("roll arm, slide first", "xyz_roll", lambda r: rolled_fields(r, "P"))
add_class("roll arm, usual table", "xyz_roll", lambda r: random_dh(
    r, "RRRR", [90.0, 0.0, 90.0, 0.0], [0.0, _N, 0.0, 0.0], [_N, 0.0, 0.0, _N]))  # fmt: skip
add_class("axis, 5R general", "xyz_axis", lambda r: random_dh(r, "RRRRR", [_N] * 5, [_N] * 5, **base_and_tool(r)))
add_class(
    "axis, 5R with elbow",
    "xyz_axis",
    lambda r: random_dh(r, "RRRRR", [90.0, 0.0, 90.0, 90.0, _N], [0.0, _N, 0.0, 0.0, 0.0]),
)
add_class(
    "axis, pitch arm", "xyz_axis", lambda r: random_dh(r, "RRRRR", [90.0, 0.0, 0.0, 90.0, _N], [0.0, _N, _N, 0.0, 0.0])
)
add_class("axis, RPRRR", "xyz_axis", lambda r: random_dh(r, "RPRRR", [_N] * 5, [_N] * 5))
add_class("pose, 5R general", "pose", lambda r: random_dh(r, "RRRRR", [_N] * 5, [_N] * 5, **base_and_tool(r)))
add_class(
    "pose, pitch arm", "pose", lambda r: random_dh(r, "RRRRR", [90.0, 0.0, 0.0, 90.0, _N], [0.0, _N, _N, 0.0, 0.0])
)
add_class("pose, 4R general", "pose", lambda r: random_dh(r, "RRRR", [_N] * 4, [_N] * 4, **base_and_tool(r)))
add_class("pose, 3R general", "pose", lambda r: random_dh(r, "RRR", [_N] * 3, [_N] * 3))
add_class("pose, RRPRR", "pose", lambda r: random_dh(r, "RRPRR", [_N] * 5, [_N] * 5))


def wrist_fields(rng: Rng, arm: str, shoulder: bool = False) -> Fields:
    """Three axes through one point after (or before) three others."""
    centre = rng.uniform(-400, 400, 3)
    if shoulder:
        return random_screws(rng, "RRR" + arm, [None] * 6, [centre] * 3 + [None] * 3)
    return random_screws(rng, arm + "RRR", [None] * 6, [None] * 3 + [centre] * 3)


for _t in itertools.product("RP", repeat=3):
    _p = "".join(_t)
    add_class(f"{_p} and spherical wrist", "pose", lambda r, p=_p: wrist_fields(r, p))
add_class("spherical wrist, modified DH", "pose", lambda r: random_dh(
    r, "RRRRRR", [_N, 90.0, 0.0, 90.0, -90.0, 90.0], [0.0, 0.0, _N, _N, 0.0, 0.0], [_N, 0.0, _N, _N, 0.0, 0.0],
    convention="modified", **base_and_tool(r)))  # fmt: skip
add_class("spherical wrist, elbow", "pose", lambda r: random_dh(
    r, "RRRRRR", [90.0, 0.0, 90.0, -90.0, 90.0, _N], [_N, _N, _N, 0.0, 0.0, _N], [_N, _N, _N, _N, 0.0, _N],
    **base_and_tool(r)))  # fmt: skip
add_class("spherical wrist, oblique", "pose", lambda r: random_dh(
    r, "RRRRRR", [_N, 180.0, _N, _N, _N, _N], [_N, _N, _N, 0.0, 0.0, _N], [_N, _N, _N, _N, 0.0, _N],
    **base_and_tool(r)))  # fmt: skip
add_class("spherical shoulder", "pose", lambda r: wrist_fields(r, "RRR", shoulder=True))
add_class("spherical shoulder, RPR", "pose", lambda r: wrist_fields(r, "RPR", shoulder=True))
add_class("spherical shoulder, elbow", "pose", lambda r: random_dh(
    r, "RRRRRR", [90.0, 90.0, _N, 0.0, _N, _N], [0.0, 0.0, _N, _N, _N, _N], [_N, 0.0, _N, _N, _N, _N]))  # fmt: skip


def three_parallel(rng: Rng, first: int, meet: bool = True) -> Fields:
    """Axes first, first + 1, first + 2 (anti)parallel, the two at the other end meeting."""
    axis = random_direction(rng)
    q: list[Any] = [None] * 6
    w = [either_sign(rng, axis) if first <= i < first + 3 else None for i in range(6)]
    if meet:
        point = rng.uniform(-300, 300, 3)
        for i in (4, 5) if first == 1 else (0, 1):
            q[i] = point
    return random_screws(rng, "RRRRRR", w, q, **base_and_tool(rng))


def three_meeting(rng: Rng, first: int) -> Fields:
    """Axes first, first + 1, first + 2 through one point, between the others."""
    point = rng.uniform(-300, 300, 3)
    return random_screws(rng, "RRRRRR", [None] * 6, [point if first <= i < first + 3 else None for i in range(6)])


add_class("three parallel axes 2, 3, 4", "pose", lambda r: three_parallel(r, 1))
add_class("three parallel axes 3, 4, 5", "pose", lambda r: three_parallel(r, 2))
add_class(
    "UR table",
    "pose",
    lambda r: random_dh(r, "RRRRRR", [90.0, 0.0, 0.0, 90.0, -90.0, 0.0], [0.0, _N, _N, 0.0, 0.0, 0.0]),
)
add_class("three parallel axes 2, 3, 4, none meet", "pose", lambda r: three_parallel(r, 1, meet=False))
add_class("three parallel axes 3, 4, 5, none meet", "pose", lambda r: three_parallel(r, 2, meet=False))
add_class("three parallel axes 1, 2, 3", "pose", lambda r: three_parallel(r, 0, meet=False))
add_class("three parallel axes 4, 5, 6", "pose", lambda r: three_parallel(r, 3, meet=False))
add_class("three parallel axes 2, 3, 4, and 5, 6", "pose", lambda r: random_dh(
    r, "RRRRRR", [_N, 0.0, 180.0, _N, 0.0, _N], [_N] * 6, **base_and_tool(r)))  # fmt: skip
add_class("three axes that meet 2, 3, 4", "pose", lambda r: three_meeting(r, 1))
add_class("three axes that meet 3, 4, 5", "pose", lambda r: three_meeting(r, 2))
add_class("6R general", "pose", lambda r: random_dh(r, "RRRRRR", [_N] * 6, [_N] * 6, **base_and_tool(r)))
add_class(
    "6R modified DH",
    "pose",
    lambda r: random_dh(r, "RRRRRR", [_N] * 6, [_N] * 6, convention="modified", **base_and_tool(r)),
)
for _k in range(6):
    _p = "R" * _k + "P" + "R" * (5 - _k)
    add_class(f"{_p} general", "pose", lambda r, p=_p: random_dh(r, p, [_N] * 6, [_N] * 6))
add_class("RRPPRR general", "pose", lambda r: random_dh(r, "RRPPRR", [_N] * 6, [_N] * 6))
add_class("PRRRRP general", "pose", lambda r: random_dh(r, "PRRRRP", [_N] * 6, [_N] * 6))
add_class("RPRPRP general", "pose", lambda r: random_dh(r, "RPRPRP", [_N] * 6, [_N] * 6))


def right_angles(rng: Rng) -> Fields:
    """Six joints of quarter turns, many lengths zero: what people build."""

    def lengths(of: list[float]) -> list[float | None]:
        return [float(v) for v in rng.choice(of, 6, p=[0.45, 0.2, 0.15, 0.1, 0.1])]

    alpha = [float(v) for v in rng.choice([0, 90, -90, 180], 6, p=[0.15, 0.4, 0.35, 0.1])]
    fields = random_dh(rng, "RRRRRR", [*alpha], lengths([0, 100, 200, 300, -150]), lengths([0, 80, 160, 250, -90]))
    for joint in fields["joints"]:
        joint["dh"]["theta"] = float(rng.choice([0, 90, -90, 180]))
    return fields
