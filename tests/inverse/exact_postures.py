"""What typed postures are, by exact arithmetic: rank, multiplicity, and joints that move. Writes exact_postures.txt.

    python tests/inverse/exact_postures.py

Angles are multiples of 15 degrees, those of right triangles of whole sides (and their doubles), and halves of these and
of 45 degrees; lengths are whole numbers, so that every entry of a chain is in the rationals with some roots: of 2, 3,
10, 26 and 2 + sqrt(2). They are computed in the field of integers modulo a prime of 31 bits that has these: no number
is rounded, none compared with a threshold. A rank can only come out too small, where a prime divides a minor; singular
postures are computed by two primes.

With t = tan of half of each joint's motion the equations are polynomials. Those of full rank are solved for as many
joints as power series in the others (implicit function theorem); what is left of the equations has the Hilbert
function of the root's local ring (Dayton and Zeng, Computing the multiplicity structure in solving polynomial systems,
2005): its sum is the multiplicity, and where it does not end, the posture lies on a curve: of one lost direction a real
one, a self-motion manifold; of several, curves that cross may be complex.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FILE = Path(__file__).with_suffix(".txt")
PRIMES = 2147481359, 2147481311  # 47 modulo 48: 2, 3, 2 + sqrt(2) are squares, 10 and 26, too; their roots a power
COUNT, HALVES = 260, 40  # postures an arm, and those with halves of angles
DEGREE = {0: 1, 1: 12, 2: 6, 3: 4}  # of the power series, by the directions that are lost
DEGREE |= dict.fromkeys((4, 5, 6), 3)

Ints = NDArray[np.int64]

# tables of standard Denavit-Hartenberg rows (d, a, alpha in quarter turns); "P": a slide, its d the value added
ARMS: dict[str, tuple[str, str, list[tuple[int, int, int]]]] = {
    "elbow arm, spherical wrist": (
        "pose", "RRRRRR", [(0, 0, -1), (150, 430, 0), (0, 20, 1), (430, 0, -1), (0, 0, 1), (60, 0, 0)],
    ),
    "no offsets, spherical wrist": (
        "pose", "RRRRRR", [(300, 0, -1), (0, 400, 0), (0, 0, 1), (400, 0, -1), (0, 0, 1), (100, 0, 0)],
    ),
    "three parallel axes": (
        "pose", "RRRRRR", [(160, 0, 1), (0, -425, 0), (0, -390, 0), (130, 0, 1), (100, 0, -1), (100, 0, 0)],
    ),
    "offset wrist": (
        "pose", "RRRRRR", [(245, 0, -1), (0, 540, 2), (0, 0, -1), (540, 0, 1), (150, 0, -1), (160, 0, 0)],
    ),
    "slide and spherical wrist": (
        "pose", "RRPRRR", [(412, 0, -1), (154, 0, 1), (0, 0, 0), (0, 0, -1), (0, 0, 1), (263, 0, 0)],
    ),
    "point, elbow": ("xyz", "RRR", [(300, 0, -1), (0, 400, 0), (0, 300, 0)]),
    "point, shoulder offset": ("xyz", "RRR", [(300, 50, -1), (40, 400, 0), (0, 300, 0)]),
    "point, right angles": ("xyz", "RRR", [(0, 100, 1), (0, 200, 1), (0, 100, 0)]),
    "point, slide": ("xyz", "RRP", [(300, 0, 1), (50, 0, 1), (0, 0, 0)]),
}  # fmt: skip
TRIANGLES = (3, 4, 5), (5, 12, 13), (24, 7, 25)
# letters of the file: 24 multiples of 15 degrees, triangles' angles in all quadrants, odd multiples of 22.5 degrees,
# and halves of the first two triangles' angles in all quadrants
LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXabcdefghijklmnopqrstuvwxyzYZ"
KINDS = [
    [k for k in range(24) if k % 6 == 0],
    [k for k in range(24) if k % 3 == 0],
    [k for k in range(24) if k % 2 == 0],
    list(range(24)),
    [0, 6, 12, 18, *range(24, 36)],
    list(range(36)),
]
KINDS_OF_HALVES = [[0, 6, 12, 18, *range(36, 44)], [0, 6, 12, 18, *range(44, 52)], list(range(36, 52)), list(range(52))]
SLIDES = (0, 100, 154, 200, 250, 300)  # [mm] a slide's values, by letter


class Posture(NamedTuple):
    """lost: directions; multiplicity: of the root, 0 on a curve; moving: joints that a curve through it moves."""

    arm: str
    angles: str
    lost: int
    multiplicity: int
    moving: str


def letter_radians(letter: str) -> float:
    """The angle of a letter."""
    k = LETTERS.index(letter)
    if k < 24:
        return float(np.radians(15.0 * (k - 24 if k > 12 else k)))
    if 36 <= k < 44:
        angle = np.radians(22.5 + 45.0 * (k - 36))
    else:
        (a, b, _), quadrant = TRIANGLES[(k - 24 if k < 36 else k - 44) // 4], k % 4
        angle = np.arctan2(a, b) / (1.0 if k < 36 else 2.0) + quadrant * np.pi / 2
    return float(angle - 2 * np.pi if angle > np.pi else angle)


def joint_values(kinds: str, letters: str) -> NDArray[np.float64]:
    """Joint values [rad | mm] of a row's letters."""
    return np.array([
        SLIDES[LETTERS.index(x)] if kind == "P" else letter_radians(x) for kind, x in zip(kinds, letters, strict=True)
    ])  # fmt: skip


def read_postures() -> list[Posture]:
    """The rows of the file."""
    names = list(ARMS)
    rows = (line.split() for line in FILE.read_text().splitlines() if not line.startswith("#"))
    return [Posture(names[int(a)], q, int(lost), int(m), moving.strip("-")) for a, q, lost, m, moving in rows]


# ---- the field


class Field:
    """Integers modulo a prime p, with the roots of 2, 3, 10, 26 and 2 + sqrt(2)."""

    def __init__(self, p: int) -> None:
        self.p = p
        self.root = {k: pow(k, (p + 1) // 4, p) for k in (2, 3, 10, 26)}
        more = 2 + self.root[2]
        self.root[more] = pow(more, (p + 1) // 4, p)
        assert all(r * r % p == k for k, r in self.root.items())

    def over(self, a: int, b: int) -> int:
        return a * pow(b, -1, self.p) % self.p

    def angle(self, k: int) -> tuple[int, int]:
        """Cosine and sine of the k-th letter."""
        p = self.p
        if k >= 44:  # tangents 1/3 and 1/5
            a, c = [(3, 10), (5, 26)][(k - 44) // 4]
            quadrant, start = k % 4, (self.over(a, self.root[c]), self.over(1, self.root[c]))
        elif k >= 36:
            cos = self.over(self.root[2 + self.root[2]], 2)
            sin = self.over(self.root[2], 4 * cos)
            quadrant, start = (k - 36) // 2, (cos, sin) if k % 2 == 0 else (sin, cos)
        elif k >= 24:
            (a, b, c), quadrant = TRIANGLES[(k - 24) // 4], (k - 24) % 4
            start = self.over(b, c), self.over(a, c)
        else:
            two, three = self.root[2], self.root[3]
            quadrant, remainder = k // 6, k % 6
            # 0, 15, .. 75 degrees
            cosines = [
                1, self.over(two * (three + 1), 4), self.over(three, 2), self.over(two, 2), self.over(1, 2),
                self.over(two * (three - 1), 4),
            ]  # fmt: skip
            start = cosines[remainder] % p, (cosines[6 - remainder] if remainder else 0) % p
        c, s = start
        for _ in range(quadrant):
            c, s = -s % p, c
        return c, s

    def reduced(self, A: Ints) -> tuple[Ints, list[int], list[int]]:
        """The reduced row echelon form of A, its pivots' columns and the rows that they came from."""
        A, p = A.copy() % self.p, self.p
        order = list(range(len(A)))
        columns: list[int] = []
        for j in range(A.shape[1]):
            k = len(columns)
            rows = np.flatnonzero(A[k:, j])
            if not len(rows):
                continue
            i = k + int(rows[0])
            A[[k, i]] = A[[i, k]]
            order[k], order[i] = order[i], order[k]
            A[k] = A[k] * pow(int(A[k, j]), -1, p) % p
            others_rows = np.flatnonzero(A[:, j])
            others_rows = others_rows[others_rows != k]
            A[others_rows] = (A[others_rows] - A[others_rows, j, None] * A[k] % p) % p
            columns.append(j)
            if len(columns) == len(A):
                break
        return A, columns, order[: len(columns)]

    def rank(self, A: Ints) -> int:
        return len(self.reduced(A)[1]) if A.size else 0

    def inverse(self, A: Ints) -> Ints:
        n = len(A)
        return self.reduced(np.concatenate([A, np.eye(n, dtype=np.int64)], axis=1))[0][:, n:]


class Series:
    """Polynomials in r unknowns modulo p up to a degree: arrays (..., P) of coefficients."""

    def __init__(self, field: Field, r: int, degree: int) -> None:
        powers = [e for e in itertools.product(range(degree + 1), repeat=r) if sum(e) <= degree]
        self.powers = sorted(powers, key=lambda e: (sum(e), e))
        self.p, self.place = field.p, {e: i for i, e in enumerate(self.powers)}
        self.degrees = np.array([sum(e) for e in self.powers])
        self.products = []  # of each monomial: with which others, and where the product stands
        for e in self.powers:
            with_, to = [], []
            for i, f in enumerate(self.powers):
                target = self.place.get(tuple(a + b for a, b in zip(e, f, strict=True)))
                if target is not None:
                    with_.append(i)
                    to.append(target)
            self.products.append((np.array(with_), np.array(to)))

    def zeros(self, *shape: int) -> Ints:
        return np.zeros((*shape, len(self.powers)), np.int64)

    def times(self, a: Ints, b: Ints) -> Ints:
        """Products of polynomials (..., P)."""
        a, b = np.broadcast_arrays(a, b)
        product = np.zeros(a.shape, np.int64)
        for i, (with_, to) in enumerate(self.products):
            if a[..., i].any():
                product[..., to] = (product[..., to] + a[..., i, None] * b[..., with_]) % self.p
        return product


# ---- the arm


def pose_equations(field: Field, series: Series, arm: str, letters: str, t: Ints) -> Ints:
    """Polynomials (rows, P) that vanish where the target is kept; t: (n, P) half tangents of the joints' motions.

    Every entry of the chain is multiplied by the denominators 1 + t^2.
    """
    task, kinds, table = ARMS[arm]
    p = field.p
    M = series.zeros(3, 4)
    M[[0, 1, 2], [0, 1, 2], 0] = 1
    below = series.zeros()
    below[0] = 1  # the last row's only entry
    for i, (kind, (d, a, alpha)) in enumerate(zip(kinds, table, strict=True)):
        letter = LETTERS.index(letters[i])
        if kind == "P":
            slide = t[i].copy()
            slide[0] = (slide[0] + SLIDES[letter]) % p
            M[:, 3] = (M[:, 3] + series.times(M[:, 2], slide)) % p
        else:
            c, s = field.angle(letter)
            square = series.times(t[i], t[i])
            minus, plus = -square % p, square
            minus[0], plus[0] = (minus[0] + 1) % p, (plus[0] + 1) % p
            C, S = (c * minus - s * (2 * t[i] % p)) % p, (s * minus + c * (2 * t[i] % p)) % p
            x, y = M[:, 0], M[:, 1]
            M = np.stack(
                [
                    (series.times(x, C) + series.times(y, S)) % p,
                    (series.times(y, C) - series.times(x, S)) % p,
                    series.times(M[:, 2], plus),
                    series.times(M[:, 3], plus),
                ],
                axis=1,
            )
            below = series.times(below, plus)
        M[:, 3] = (M[:, 3] + d * M[:, 2] + a * M[:, 0]) % p
        for _ in range(alpha % 4):
            M[:, 1], M[:, 2] = M[:, 2].copy(), -M[:, 1] % p
    start = M[:, :, 0].copy()
    M = (M - start[:, :, None] * below) % p
    return M[:, 3] if task == "xyz" else M.reshape(12, -1)


def posture_structure(field: Field, arm: str, letters: str) -> Posture:
    """What a posture is."""
    p, n = field.p, len(letters)
    linear = Series(field, n, 1)
    variables = linear.zeros(n)
    variables[np.arange(n), [linear.place[tuple(row)] for row in np.eye(n, dtype=int).tolist()]] = 1
    place = variables.argmax(axis=1)
    J = pose_equations(field, linear, arm, letters, variables)[:, place]
    _, solved, rows = field.reduced(J)
    lost = n - len(solved)
    if not lost:
        return Posture(arm, letters, 0, 1, "")
    series = Series(field, lost, DEGREE[lost])
    unsolved = [j for j in range(n) if j not in solved]
    t = series.zeros(n)
    for k, j in enumerate(unsolved):
        t[j, series.place[tuple(int(i == k) for i in range(lost))]] = 1
    back = field.inverse(J[np.ix_(rows, solved)])
    for _ in range(int(series.degrees.max())):  # each makes the series right by one degree more
        left = pose_equations(field, series, arm, letters, t)[rows]
        for k, j in enumerate(solved):
            for i in range(len(rows)):
                t[j] = (t[j] - back[k, i] * left[i]) % p
    g = pose_equations(field, series, arm, letters, t)
    multiplicity = _multiplicity(field, series, np.delete(g, rows, axis=0))
    curve = lost == 1 and not multiplicity
    moving = "".join(str(j + 1) for j in range(n) if curve and t[j].any())
    return Posture(arm, letters, lost, multiplicity, moving)


def _multiplicity(field: Field, series: Series, g: Ints) -> int:
    """The sum of the Hilbert function of the ideal of g (m, P); 0 if it does not end within the series' degree."""
    multiples = []
    for e in series.powers:
        monomial = series.zeros()
        monomial[series.place[e]] = 1
        multiples.append(series.times(g, monomial))
    every, before = np.concatenate(multiples), 0
    for degree in range(int(series.degrees.max()) + 1):
        low = series.degrees <= degree
        dimension = int(low.sum()) - field.rank(every[:, low])
        if dimension == before:
            return dimension
        before = dimension
    return 0


def posture_rows(rng: np.random.Generator, number: int, choices: list[list[int]], count: int) -> list[str]:
    """Lines of the file: so many postures of an arm, of letters as choices say."""
    arm, (_, kinds, _) = list(ARMS.items())[number]
    first, second = map(Field, PRIMES)
    row_of: dict[str, str] = {}
    while len(row_of) < count:
        choice = choices[int(rng.integers(len(choices)))]
        letters = "".join(
            LETTERS[int(rng.integers(len(SLIDES)) if kind == "P" else rng.choice(choice))] for kind in kinds
        )
        if letters not in row_of:
            posture = posture_structure(first, arm, letters)
            assert not posture.lost or posture == posture_structure(second, arm, letters)
            row_of[letters] = f"{number} {letters} {posture.lost} {posture.multiplicity} {posture.moving or '-'}"
    return list(row_of.values())


def main() -> None:
    lines = ["# arm, joints' letters, lost directions, multiplicity (0: a curve), joints that move: exact_postures.py"]
    for seed, choices, count in ((1, KINDS, COUNT), (2, KINDS_OF_HALVES, HALVES)):
        rng = np.random.default_rng(seed)
        lines += [line for number in range(len(ARMS)) for line in posture_rows(rng, number, choices, count)]
    FILE.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
