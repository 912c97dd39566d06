"""The C text of the places where families of an arm may change: the equations of `armkin.inverse.redundant.boundaries`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from armkin.export.c.c_program import fill_fields
from armkin.formula import arrays, c_and_js_code, recording
from armkin.formula.arrays import Entry
from armkin.formula.c_and_js_code import number_text
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant import turn_roots
from armkin.inverse.redundant.boundaries import DEGREE, Boundaries, equations

PART = Path(__file__).parent / "parts" / "family_places.c"
INPUTS = 12  # numbers of a target's rotation and of where it has the shoulder


class Complex:
    """A complex number whose parts are numbers or recorded symbols, in numpy's arrays of objects."""

    def __init__(self, real: Entry, imaginary: Entry = 0.0) -> None:
        self.real, self.imaginary = real, imaginary

    @staticmethod
    def of(x: Any) -> Complex:
        return x if isinstance(x, Complex) else Complex(float(x))

    def __add__(self, other: Any) -> Complex:
        b = Complex.of(other)
        return Complex(arrays.add(self.real, b.real), arrays.add(self.imaginary, b.imaginary))

    def __sub__(self, other: Any) -> Complex:
        b = Complex.of(other)
        return Complex(arrays.sub(self.real, b.real), arrays.sub(self.imaginary, b.imaginary))

    def __mul__(self, other: Any) -> Complex:
        b = Complex.of(other)
        real = arrays.sub(arrays.mul(self.real, b.real), arrays.mul(self.imaginary, b.imaginary))
        return Complex(real, arrays.add(arrays.mul(self.real, b.imaginary), arrays.mul(self.imaginary, b.real)))

    def __truediv__(self, other: Any) -> Complex:
        b = Complex.of(other)
        if isinstance(b.imaginary, float) and b.imaginary == 0.0:
            return Complex(self.real / b.real, self.imaginary / b.real)
        over = arrays.add(arrays.mul(b.real, b.real), arrays.mul(b.imaginary, b.imaginary))
        product = self * Complex(b.real, -b.imaginary)
        return Complex(product.real / over, product.imaginary / over)

    def __pow__(self, exponent: int) -> Complex:
        assert exponent == 2, "only squares are asked for"
        return self * self

    def __radd__(self, other: Any) -> Complex:
        return self + other

    def __rsub__(self, other: Any) -> Complex:
        return Complex.of(other) - self

    def __rmul__(self, other: Any) -> Complex:
        return self * other

    def __neg__(self) -> Complex:
        return self * -1.0


class Angle:
    """A complex angle, known by its cosine and sine."""

    def __init__(self, cosine: Complex, sine: Complex) -> None:
        self._cosine, self._sine = cosine, sine

    def cos(self) -> Complex:
        return self._cosine

    def sin(self) -> Complex:
        return self._sine


def recorded_equations(bounds: Boundaries) -> recording.Recording:
    """The polynomials at one angle; inputs: rotation and shoulder, real and imaginary parts of cosine and sine."""

    def formula(x: list[Entry]) -> list[Entry]:
        entries = np.array([Complex(entry) for entry in x[:INPUTS]], object)
        angle = Angle(Complex(x[INPUTS], x[INPUTS + 1]), Complex(x[INPUTS + 2], x[INPUTS + 3]))
        t = np.array([angle], object)
        values = equations(bounds, entries[:9].reshape(1, 3, 3), entries[9:].reshape(1, 3), t).ravel()
        return [part for value in values for part in (value.real, value.imaginary)]

    return recording.record(formula, INPUTS + 4)


def roots_fields(bounds: Boundaries) -> dict[str, str]:
    """Values of the fields about polynomials and their roots in parts/followed_families.c."""
    recorded = recorded_equations(bounds)
    inputs = [*(f"g[{k}]" for k in range(INPUTS)), "cr", "ci", "sr", "si"]
    code = c_and_js_code.write_code(recorded, inputs)
    stores = [f"value[{k}][i] = {texts[0]};" for k, texts in enumerate(code.outputs)]
    lines = "\n".join(f"        {line}" for line in [*code.lines, *stores])
    fields = {"real": "double", "suffix": "", "precision": "double", "rounding": number_text(tol.ROUNDING)}
    fields |= {name: name for name in ("atan", "cos", "sin", "cosh", "sinh", "exp", "sqrt", "fabs", "fmax")}
    fields |= {"shift": number_text(turn_roots.SHIFT), "equations": lines}
    return {
        "roots": fill_fields(PART.read_text(encoding="utf-8"), fields),
        "polynomials": str(len(code.outputs) // 2),
        "degree": str(DEGREE),
        "tail": str(turn_roots.TAIL),
        "terms": str(turn_roots.TERMS),
        "cells": str(math.ceil(np.pi * DEGREE / turn_roots.CELL_WIDTH)),
        "halvings": str(turn_roots.HALVINGS),
        "newton": str(turn_roots.STEPS),
        "safe": number_text(turn_roots.SAFE),
    }
