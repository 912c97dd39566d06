"""General 6-joint inverse kinematics by numeric elimination."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import pencil as pencils
from .line_features import Array
from .merge import merge
from .pencil import Pencil
from .polish import refine, shrink

Bool = NDArray[np.bool_]
Int = NDArray[np.int64]

CHUNK = 256
ACCEPTED = 1e-10  # residual of an answer, lengths scaled
PSI = (0.7321, -1.1879)
MOST = 16


@dataclass(frozen=True)
class Elimination:
    """A 6-joint chain prepared for `solve`: read-only, to be shared by threads.

    base, links, tool: the chain with lengths scaled and frames moved along their axes;
    length: its unit [mm].  plans: the pencil of the main pass, then those of the retry passes.
    """

    prismatic: Bool
    base: Array
    links: Array
    tool: Array
    length: float
    plans: tuple[Pencil, ...]
    score: float


def prepare(link: Array, prismatic: Bool) -> Elimination:
    """Prepare a chain; see the module text."""
    base, links, tool, length = _compact(link, prismatic)
    closed = np.concatenate([links, np.eye(4)[None]])
    chain = np.concatenate([np.eye(4)[None], links, np.eye(4)[None]])
    rng = np.random.default_rng(5)
    q = rng.uniform(-np.pi, np.pi, (16, 6))
    q[:, prismatic] = rng.uniform(-1, 1, (16, int(prismatic.sum())))
    goal = _forward(chain, prismatic, q)
    X = np.linalg.inv(goal)
    ranked = _rank(closed, prismatic, pencils.roles(prismatic, (0, 1, 5), (0,)), X, q)
    if not ranked or ranked[0][0] > -8:
        more = [r for r in pencils.roles(prismatic, (0, 1, 5, 2, 3, 4), (0, 1, 2)) if r.slot in (2, 3, 4) or r.hidden]
        ranked += _rank(closed, prismatic, more, X, q)
        ranked.sort(key=lambda item: item[0])
    first = ranked[0][1]
    second = pencils.build(first.role, closed, prismatic, PSI[1])
    plans = (first, second, *(item[1] for item in ranked[1:6]))
    return Elimination(prismatic, base, links, tool, length, plans, ranked[0][0])


def _rank(closed: Array, prismatic: Bool, roles: list[pencils.Role], X: Array, q: Array) -> list[tuple[float, Pencil]]:
    ranked = []
    for role in roles:
        plan = pencils.build(role, closed, prismatic, PSI[0])
        ranked.append((_score(plan, X, q), plan))
    ranked.sort(key=lambda item: item[0])
    return ranked


def _score(plan: Pencil, X: Array, q: Array) -> float:
    found = pencils.seeds(plan, X)
    error = np.abs(found.q - q[found.pose])
    error = np.where(plan.sliding, error, np.abs(np.mod(error + np.pi, 2 * np.pi) - np.pi)).max(axis=1)
    error[~np.isfinite(error)] = 1.0
    nearest = np.full(X.shape[0], 1.0)
    np.minimum.at(nearest, found.pose, error)
    score = float(np.quantile(np.log10(nearest + 1e-16), 0.9))
    return score - 0.5 * (plan.role.slot == 1)


def _forward(chain: Array, prismatic: Bool, q: Array) -> Array:
    T = np.broadcast_to(chain[0], (q.shape[0], 4, 4))
    for i in range(6):
        Z = np.stack([pencils.line_features.joint_motion(bool(prismatic[i]), value) for value in q[:, i]])
        T = T @ Z @ chain[i + 1]
    return T


def _compact(link: Array, prismatic: Bool) -> tuple[Array, Array, Array, float]:
    """Move frames along their axes."""
    link = link.astype(float)
    # shift_i: frame i moves by D_i (a translation that commutes with Z_i), link[i] -> D_i^-1 link[i] D_{i+1}
    free = [np.eye(3) if p else np.eye(3)[:, 2:] for p in prismatic]
    width = [f.shape[1] for f in free]
    start = np.concatenate([[0], np.cumsum(width)])
    M, t = np.zeros((15, start[-1])), np.zeros(15)
    for i in range(5):  # links between joints i and i + 1: t + R d_{i+1} - d_i
        rows = slice(3 * i, 3 * i + 3)
        t[rows] = link[i + 1, :3, 3]
        M[rows, start[i] : start[i + 1]] = -free[i]
        M[rows, start[i + 1] : start[i + 2]] = link[i + 1, :3, :3] @ free[i + 1]
    d = np.linalg.lstsq(M, -t, rcond=1e-9)[0]
    out = link.copy()
    for i in range(6):
        shift = free[i] @ d[start[i] : start[i + 1]]
        out[i, :3, 3] += out[i, :3, :3] @ shift
        out[i + 1, :3, 3] -= shift
    size = float(np.linalg.norm(out[1:6, :3, 3], axis=1).sum()) / 3
    length = size if size > 1e-9 * (1 + np.abs(link[:, :3, 3]).max()) else 300.0
    out = shrink(out, length)
    return out[0], out[1:6], out[6], length


def solve(elimination: Elimination, T: Array) -> tuple[Array, Bool]:
    """All."""
    count = T.shape[0]
    scaled = shrink(T, elimination.length)
    goal = np.linalg.inv(elimination.base) @ scaled @ np.linalg.inv(elimination.tool)
    answers, doubt = _run(elimination, 0, goal, np.arange(count))
    found = [answers]
    doubtful = doubt.copy()
    for stage in range(1, len(elimination.plans)):
        again = np.flatnonzero(doubt)
        if again.size == 0:
            break
        answers, still = _run(elimination, stage, goal[again], again)
        found.append(answers)
        doubt[again] = still
    pose = np.concatenate([f[0] for f in found])
    q = np.concatenate([f[1] for f in found])
    residual = np.concatenate([f[2] for f in found])
    weakness = np.concatenate([f[3] for f in found])
    out, merged = merge(elimination.prismatic, chain_of(elimination), goal, count, pose, q, residual, weakness)
    return out * np.where(elimination.prismatic, elimination.length, 1.0), doubt | merged


def chain_of(e: Elimination) -> Array:
    return np.concatenate([np.eye(4)[None], e.links, np.eye(4)[None]])


def _run(e: Elimination, stage: int, goal: Array, index: Int):
    plan = e.plans[stage]
    chain = chain_of(e)
    parts, doubt = [], np.zeros(goal.shape[0], bool)
    for begin in range(0, goal.shape[0], CHUNK):
        part = goal[begin : begin + CHUNK]
        X = np.linalg.inv(part)
        seed = pencils.seeds(plan, X, 0.02 if stage == 0 else 0.3)
        if stage == 0:
            done = refine(chain, e.prismatic, seed.q, part[seed.pose], 4)
        else:
            done = refine(chain, e.prismatic, seed.q, part[seed.pose], 12, damped=True)
        good = done.residual < ACCEPTED
        bad = seed.rough.copy()
        bad[seed.pose[(~good) & ((seed.tilt == 0) | (done.residual < 1e-3))]] = True
        bad[seed.pose[good & (seed.tilt > 0) & (seed.tilt < 1e-4)]] = True
        pose, hidden = seed.pose[good], seed.hidden[good]
        order = np.lexsort((hidden, pose))
        close = (np.diff(pose[order]) == 0) & (np.diff(hidden[order]) < 1e-4)
        bad[pose[order][1:][close]] = True
        doubt[begin : begin + CHUNK] = bad
        q = done.q[good]
        q = np.where(e.prismatic, q, np.pi - np.mod(np.pi - q, 2 * np.pi))
        parts.append((index[begin + pose], q, done.residual[good], done.weakness[good]))
    return tuple(np.concatenate([p[i] for p in parts]) for i in range(4)), doubt
