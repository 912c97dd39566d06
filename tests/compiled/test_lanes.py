"""The elimination in lockstep: matrices at once have the roots that one has alone."""

from __future__ import annotations

import ctypes

import numpy as np

from armkin.compiled import toolchain
from armkin.compiled.own_parts import PARTS
from armkin.export.c.source_parts import part_text

AROUND = """
#define ARM_MOST 24
#define ARM_PI 3.141592653589793
@head@
#ifndef ARM_MANY
#define ARM_MANY 4
#endif
@scalar@
@lanes@
const char arm_content[] = "lanes";

void one_by_one(double *a, int n, double *re, double *im)
{
    arm_roots_of(a, n, ARM_MOST, re, im);
}

int lanes(void)
{
    return ARM_MANY;
}

int in_lanes(const double *a, int n, double *re, double *im)
{
    arm_many C[(ARM_MOST + 1) * (ARM_MOST + 1)], x[ARM_MOST], y[ARM_MOST];
    arm_flags failed;
    int i, j, t;
    for (i = 0; i < (n + 1) * (n + 1); i++)
        C[i] = arm_all(0);
    for (t = 0; t < ARM_MANY; t++)
        for (i = 0; i < n; i++)
            for (j = 0; j < n; j++)
                C[i * (n + 1) + j][t] = a[(t * n + i) * n + j];
    arm_balance_lanes(C, n);
    arm_hessenberg_lanes(C, n);
    failed = arm_eigenvalues_lanes(C, n, x, y);
    for (t = 0; t < ARM_MANY; t++)
        for (i = 0; i < n; i++) {
            re[t * n + i] = x[i][t];
            im[t * n + i] = y[i][t];
        }
    return arm_any(failed);
}
"""


def build_library() -> ctypes.CDLL:
    """The two ways, without an arm."""
    head = (PARTS / "head.c").read_text().partition("typedef double arm_real")[0].replace("/* @about@ */", "")
    lanes = "".join((PARTS / f"{name}.c").read_text() for name in ("lanes", "lanes_eigenvalues"))
    text = AROUND.replace("@head@", head).replace("@scalar@", part_text("linear_algebra")).replace("@lanes@", lanes)
    return toolchain.load_library(text, "lanes", 2)


def companion_matrices(n: int, count: int) -> np.ndarray:
    """Companion forms of quadratic pencils, badly scaled ones, and some with roots twice or at zero."""
    rng = np.random.default_rng([n, count])
    a = rng.standard_normal((count, n, n))
    a[::4] *= 10.0 ** rng.uniform(-4, 4, (len(a[::4]), n, 1))
    a[1::4, n - 4 :] = np.eye(n)[:4]
    a[2::16, 0], a[6::16, :, 1] = 0.0, 0.0
    a[10::16] = np.triu(a[10::16])
    return a


def test_real_roots_are_as_many_in_lanes() -> None:
    library = build_library()
    lanes = library.lanes()
    for n in (16, 20, 24):
        companions = companion_matrices(n, 4096 if n == 16 else 512)
        for group in companions.reshape(-1, lanes, n, n):
            re, im = np.empty((2, lanes, n))
            assert not library.in_lanes(np.ascontiguousarray(group).ctypes, n, re.ctypes, im.ctypes)
            for k in range(lanes):
                padded, x, y = np.zeros((24, 24)), np.zeros(24), np.zeros(24)
                padded[:n, :n] = group[k]
                library.one_by_one(padded.ctypes, n, x.ctypes, y.ctypes)
                assert (im[k] == 0).sum() == (y[:n] == 0).sum()
                size = np.abs(x[:n] + 1j * y[:n]).max()
                gap = np.abs((re[k] + 1j * im[k])[:, None] - (x + 1j * y)[:n])
                assert max(gap.min(axis=0).max(), gap.min(axis=1).max()) < 1e-6 * size
