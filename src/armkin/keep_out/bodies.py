"""The bodies of an arm: capsules along its skeleton, one body a joint, and one for what stands before joint 1.

Body 0 is the base's, body i the one that joint i moves. A segment's ends are constant in the frame after its
joint's motion; a slide's own segment begins where the body before ends, so it is as long as the slide is out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula import pose
from armkin.formula.arrays import Array, Entry
from armkin.formula.trace import LazyCode
from armkin.forward import Motion, move
from armkin.view.skeleton import arm_shape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from armkin.model.arm import Arm

    _Segment = tuple[int, Array, Array, bool]  # body, begin, end, and whether it slides out

BASE = "base"  # name of the base's body
ASSUMED = 0.02  # radius, as a share of the reach, of a body that the file does not state


@dataclass(frozen=True, eq=False)
class Bodies:
    """Capsules of one arm, lengths in mm; their segments are in the order of the bodies.

    segment i goes from begin[i] to end[i] in the frame after joint owner[i]'s motion (0: in the world); where
    slide[i], begin[i] is a place in the frame before that motion.
    """

    names: tuple[str, ...]  # (n + 1,) base first
    radius: Array  # (n + 1,)
    assumed: NDArray[np.bool_]  # (n + 1,) the file does not state it
    owner: NDArray[np.intp]  # (S,) body of each segment
    begin: Array  # (S, 3)
    end: Array  # (S, 3)
    slide: NDArray[np.bool_]  # (S,)

    def exists(self, body: int) -> bool:
        """Whether a body has a segment and a radius."""
        return bool(self.radius[body] > 0 and (self.owner == body).any())


@lru_cache(maxsize=64)
def bodies(arm: Arm) -> Bodies:
    """The bodies of an arm that has keep-outs, or of any other with radii assumed.

    >>> import armkin
    >>> found = bodies(armkin.load("three_dof"))
    >>> found.names, found.radius.round(1).tolist(), found.end[found.owner == 2].tolist()
    (('base', 'q1', 'q2', 'q3'), [12.5, 12.5, 12.5, 12.5], [[0.0, 0.0, -10.0], [197.0, 0.0, -10.0]])
    """
    radii = np.full(arm.n + 1, np.nan) if arm.body_radius is None else arm.body_radius
    assumed = np.isnan(radii)
    owner, begin, end, slide = zip(
        *_base_segments(arm), *(s for i in range(arm.n) for s in _link_segments(arm, i)), strict=True
    )
    return Bodies(
        names=(BASE, *arm.joint_names),
        radius=np.where(assumed, ASSUMED * arm.reach, radii),
        assumed=assumed,
        owner=np.array(owner),
        begin=np.array(begin),
        end=np.array(end),
        slide=np.array(slide),
    )


def _base_segments(arm: Arm) -> list[_Segment]:
    """The base's segments, with those of link 1 that lie on joint 1's own axis: they do not turn."""
    form, least = arm_shape(arm), 1e-9 * arm.reach
    still = list(_segments_between(form.bodies[0], least))
    if not arm.prismatic[0]:
        on_axis = [s for s in _segments_between(form.bodies[1], least) if _on_axis(s, least)]
        still += [(_place_point(arm.link[0], a), _place_point(arm.link[0], b)) for a, b in on_axis]
    return [(0, a, b, False) for a, b in still or [(form.bodies[0][-1],) * 2]]


def _link_segments(arm: Arm, i: int) -> list[_Segment]:
    """The segments that move with joint i; of a slide the first one, which grows, as well."""
    corners, least = arm_shape(arm).bodies[i + 1], 1e-9 * arm.reach
    segments = list(_segments_between(corners, least))
    if arm.prismatic[i]:
        return [(i + 1, corners[0], corners[0], True), *((i + 1, a, b, False) for a, b in segments)]
    if i == 0:
        segments = [s for s in segments if not _on_axis(s, least)]
    elif not segments:
        segments = [(corners[-1], corners[-1])]  # a body without length is a sphere
    return [(i + 1, a, b, False) for a, b in segments]


def _segments_between(corners: Array, least: float) -> list[tuple[Array, Array]]:
    """Neighbouring corners that are apart."""
    pairs = pairwise(corners)
    return [(a, b) for a, b in pairs if np.linalg.norm(b - a) > least]


def _on_axis(segment: tuple[Array, Array], least: float) -> bool:
    return all(float(np.hypot(*point[:2])) <= least for point in segment)


def _place_point(T: Array, point: Array) -> Array:
    return np.asarray(T[:3, :3] @ point + T[:3, 3])


def segment_ends(arm: Arm, q: Array) -> tuple[Array, Array]:
    """Both ends of every segment: q (N, n) [rad | mm] -> (3, S, N) twice, in the world."""
    form = bodies(arm)
    ends_of_segments = np.empty((2, 3, len(form.owner), len(q)))
    columns = list(np.ascontiguousarray(q.T))
    code = _recorded_ends(arm).get(len(q))
    entries = ends_formula(arm, columns) if code is None else code.run(columns, code.workspace(len(q)))
    for k, entry in enumerate(entries):
        segment, coordinate = divmod(k, 6)
        ends_of_segments[coordinate // 3, coordinate % 3, segment] = entry
    return ends_of_segments[0], ends_of_segments[1]


@lru_cache(maxsize=64)
def _recorded_ends(arm: Arm) -> LazyCode:
    return LazyCode(lambda q: ends_formula(arm, q), arm.n)


def ends_formula(arm: Arm, q: Sequence[Motion]) -> list[Entry]:
    """Six numbers a segment: where it begins and where it ends."""
    form = bodies(arm)
    entries: list[Entry] = []
    for k in np.flatnonzero(form.owner == 0):
        entries += [*map(float, form.begin[k]), *map(float, form.end[k])]
    P = pose.constant(arm.link[0])
    for i in range(arm.n):
        before, P = P, move(arm, P, i, q[i])
        for k in np.flatnonzero(form.owner == i + 1):
            entries += pose.apply(before if form.slide[k] else P, [float(x) for x in form.begin[k]])
            entries += pose.apply(P, [float(x) for x in form.end[k]])
        P = pose.compose(P, pose.constant(arm.link[i + 1]))
    return entries
