"""The bodies of an arm: capsules along its skeleton, one body for each joint and one for the base.

Body 0 is the base, and joint i moves body i. The ends of a segment are constant in the frame after the joint's motion.
The first segment of a prismatic joint begins at the end of the previous body, so that it grows with the joint value.
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
ASSUMED = 0.02  # radius, as a share of the reach, of a body without a radius in the file


@dataclass(frozen=True, eq=False)
class Bodies:
    """Capsules of one arm, lengths in mm; their segments are in the order of the bodies.

    Segment i goes from begin[i] to end[i] in the frame after the motion of joint owner[i] (0: in the world). If
    slide[i], begin[i] is a point in the frame before that motion.
    """

    names: tuple[str, ...]  # (n + 1,) base first
    radius: Array  # (n + 1,)
    assumed: NDArray[np.bool_]  # (n + 1,) whether the file has no radius
    owner: NDArray[np.intp]  # (S,) body of each segment
    begin: Array  # (S, 3)
    end: Array  # (S, 3)
    slide: NDArray[np.bool_]  # (S,)

    def exists(self, body: int) -> bool:
        """Whether a body has a segment and a radius."""
        return bool(self.radius[body] > 0 and (self.owner == body).any())


@lru_cache(maxsize=64)
def bodies(arm: Arm) -> Bodies:
    """The bodies of an arm; radii that the file does not state are assumed.

    >>> import armkin
    >>> found = bodies(armkin.load("three_dof"))
    >>> found.names, found.radius.round(1).tolist(), found.end[found.owner == 2].tolist()
    (('base', 'q1', 'q2', 'q3'), [12.5, 12.5, 12.5, 12.5], [[0.0, 0.0, -10.0], [197.0, 0.0, -10.0]])
    """
    radii = np.full(arm.n + 1, np.nan) if arm.body_radius is None else arm.body_radius
    is_assumed = np.isnan(radii)
    owner, begin, end, slide = zip(
        *_base_segments(arm), *(segment for i in range(arm.n) for segment in _link_segments(arm, i)), strict=True
    )
    return Bodies(
        names=(BASE, *arm.joint_names),
        radius=np.where(is_assumed, ASSUMED * arm.reach, radii),
        assumed=is_assumed,
        owner=np.array(owner),
        begin=np.array(begin),
        end=np.array(end),
        slide=np.array(slide),
    )


def _base_segments(arm: Arm) -> list[_Segment]:
    """The segments of the base, and those of link 1 on the axis of joint 1, which do not move."""
    skeleton, min_length = arm_shape(arm), 1e-9 * arm.reach
    fixed_segments = list(_segments_between(skeleton.bodies[0], min_length))
    if not arm.prismatic[0]:
        axis_segments = [
            segment for segment in _segments_between(skeleton.bodies[1], min_length) if _on_axis(segment, min_length)
        ]
        fixed_segments += [(_place_point(arm.link[0], a), _place_point(arm.link[0], b)) for a, b in axis_segments]
    return [(0, a, b, False) for a, b in fixed_segments or [(skeleton.bodies[0][-1],) * 2]]


def _link_segments(arm: Arm, joint: int) -> list[_Segment]:
    """The segments that move with a joint, among them the growing one of a prismatic joint."""
    corners, min_length = arm_shape(arm).bodies[joint + 1], 1e-9 * arm.reach
    segments = list(_segments_between(corners, min_length))
    if arm.prismatic[joint]:
        return [(joint + 1, corners[0], corners[0], True), *((joint + 1, a, b, False) for a, b in segments)]
    if joint == 0:
        segments = [segment for segment in segments if not _on_axis(segment, min_length)]
    elif not segments:
        segments = [(corners[-1], corners[-1])]  # a body without length is a sphere
    return [(joint + 1, a, b, False) for a, b in segments]


def _segments_between(corners: Array, min_length: float) -> list[tuple[Array, Array]]:
    """Pairs of neighbouring corners at different points."""
    pairs = pairwise(corners)
    return [(a, b) for a, b in pairs if np.linalg.norm(b - a) > min_length]


def _on_axis(segment: tuple[Array, Array], tolerance: float) -> bool:
    return all(float(np.hypot(*point[:2])) <= tolerance for point in segment)


def _place_point(T: Array, point: Array) -> Array:
    return np.asarray(T[:3, :3] @ point + T[:3, 3])


def segment_ends(arm: Arm, q: Array) -> tuple[Array, Array]:
    """Both ends of every segment: q (N, n) [rad | mm] -> (3, S, N) twice, in the world."""
    arm_bodies = bodies(arm)
    ends_of_segments = np.empty((2, 3, len(arm_bodies.owner), len(q)))
    columns = list(np.ascontiguousarray(q.T))
    code = _recorded_ends(arm).get(len(q))
    entries = ends_formula(arm, columns) if code is None else code.run(columns, code.workspace(len(q)))
    for number, entry in enumerate(entries):
        segment, coordinate = divmod(number, 6)
        ends_of_segments[coordinate // 3, coordinate % 3, segment] = entry
    return ends_of_segments[0], ends_of_segments[1]


@lru_cache(maxsize=64)
def _recorded_ends(arm: Arm) -> LazyCode:
    return LazyCode(lambda q: ends_formula(arm, q), arm.n)


def ends_formula(arm: Arm, q: Sequence[Motion]) -> list[Entry]:
    """The coordinates of both ends of each segment, six numbers for each."""
    capsules = bodies(arm)
    entries: list[Entry] = []
    for row in np.flatnonzero(capsules.owner == 0):
        entries += [*map(float, capsules.begin[row]), *map(float, capsules.end[row])]
    P = pose.constant(arm.link[0])
    for joint in range(arm.n):
        previous, P = P, move(arm, P, joint, q[joint])
        for row in np.flatnonzero(capsules.owner == joint + 1):
            entries += pose.apply(previous if capsules.slide[row] else P, [float(x) for x in capsules.begin[row]])
            entries += pose.apply(P, [float(x) for x in capsules.end[row]])
        P = pose.compose(P, pose.constant(arm.link[joint + 1]))
    return entries
