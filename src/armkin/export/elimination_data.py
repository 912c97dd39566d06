"""The constants of the general elimination for C and JavaScript: which pencils, and their arrays.

`armkin.inverse.elimination.method` explains the method and why it is complete.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from armkin.inverse.elimination.choose_variable import Kind
from armkin.inverse.elimination.passes import shaken_goal
from armkin.inverse.numeric.tolerances import SHAKES

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.inverse.elimination.method import Elimination
    from armkin.inverse.elimination.pencil import Pencil

PASSES = 4  # passes of the C code, of seven in Python; unsolved cases are reported as doubt
OWN_PENCILS = 2  # special pencils of each kind of poses


def has_form(elimination: Elimination) -> bool:
    """Whether C and JavaScript can read all pencils for general poses."""
    return bool(elimination.plans) and all(map(_is_read, elimination.plans[:PASSES]))


def _is_read(pencil: Pencil) -> bool:
    """Whether a pencil has the pose where roots.c and roots.js expect it: in La, Lb or Le, at full rank."""
    return pencil.role.slot == 1 or (pencil.role.at_an_end and pencil.ends.rank == 9)


def plans_of(elimination: Elimination, passes: int) -> list[tuple[Pencil, ...]]:
    """The pencils for each kind of poses; the first two are special for the kind, if the parts can read them."""
    special_pencils = [elimination.pencils_of_kind(kind)[:OWN_PENCILS] for kind in Kind]
    plans = elimination.plans[:passes]
    return [(*pencils, *plans[OWN_PENCILS:]) if all(map(_is_read, pencils)) else plans for pencils in special_pencils]


def pencils_of(kinds: list[tuple[Pencil, ...]]) -> tuple[list[Pencil], list[list[int]]]:
    """The distinct pencils of plans, and the plans as indices of pencils."""
    distinct = {(pencil.role, pencil.psi): pencil for plans in kinds for pencil in plans}
    numbers = {key: number for number, key in enumerate(distinct)}
    return list(distinct.values()), [[numbers[pencil.role, pencil.psi] for pencil in plans] for plans in kinds]


def pencil_arrays(pencil: Pencil) -> dict[str, Array | None]:
    """The arrays of a pencil, with rows of 15 padded to 16; None for arrays that its slot does not have."""
    slot, ends = pencil.role.slot, pencil.ends
    return {
        "links": np.concatenate([frame_rows(link) for link in pencil.links]),
        "first": _first_factor(slot, ends.factors) if slot != 1 else None,
        "second": _pad_to_fours(ends.factors[1]) if slot == 0 else None,
        "N": _pad_to_fours(ends.N) if slot == 1 else None,
        "recover": _pad_to_fours(ends.recover) if slot == 1 else None,
        "columns": pencil.columns,
        "mix": pencil.mix,
        "K_re": pencil.K_re if pencil.K_re.size else None,
        "K_im": pencil.K_im if pencil.K_re.size else None,
        "W": pencil.W,
    }


def _first_factor(slot: int, factors: tuple[Array, ...]) -> Array:
    """The first factor of Q with transposed matrices: (3, 15, 16) in slot La, (15, 9 * 16) in slot Le."""
    matrices = factors[0].reshape(-1, 15, 15)
    if slot == 0:
        return _pad_to_fours(matrices.swapaxes(1, 2))
    return _pad_to_fours(np.moveaxis(matrices, 2, 0)).reshape(15, -1)


def _pad_to_fours(rows: Array) -> Array:
    """Rows (..., k) padded with zeros to a multiple of four."""
    return np.pad(rows, [(0, 0)] * (rows.ndim - 1) + [(0, -rows.shape[-1] % 4)])


def moves_of(passes: int) -> list[Array]:
    """The motion of the pose in each pass, as frames."""
    return [frame_rows(shaken_goal(np.eye(4), shake)) for shake in SHAKES[:passes]]


def frame_rows(motion: ArrayLike) -> np.ndarray:
    """The upper three rows of a motion (4, 4), as a flat array."""
    return np.asarray(motion, dtype=float)[:3].ravel()
