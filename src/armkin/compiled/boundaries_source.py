"""The C text of the places where families of an arm may change: the equations of `armkin.inverse.redundant.boundaries`."""

from __future__ import annotations

import math
from collections.abc import Callable
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
MOVED_ROOT = 1e-8  # way [rad] by which bounds of rounding let it move a root, above which more digits are used
INPUT_SHARE = 0.1  # share of rounding that the target's own numbers have, however many digits are used
INPUTS = 12  # numbers of a target's rotation and of where it has the shoulder


def _with_numbers(operation: Callable[[Any, Any], Complex]) -> Callable[[Any, Any], Any]:
    """An operation that leaves arrays to numpy, which does it with each of their numbers."""

    def of_number(one: Any, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        return operation(one, other if isinstance(other, Complex) else Complex(float(other)))

    return of_number


class Complex:
    """A complex number whose parts are numbers or recorded symbols, in numpy's arrays of objects."""

    def __init__(self, real: Entry, imaginary: Entry = 0.0) -> None:
        self.real, self.imaginary = real, imaginary

    def sqrt(self) -> Complex:
        assert isinstance(self.imaginary, float), "only roots of real numbers are asked for"
        return Complex(np.sqrt(self.real))

    @_with_numbers
    def __add__(self, b: Complex) -> Complex:
        return Complex(arrays.add(self.real, b.real), arrays.add(self.imaginary, b.imaginary))

    @_with_numbers
    def __sub__(self, b: Complex) -> Complex:
        return Complex(arrays.sub(self.real, b.real), arrays.sub(self.imaginary, b.imaginary))

    @_with_numbers
    def __mul__(self, b: Complex) -> Complex:
        real = arrays.sub(arrays.mul(self.real, b.real), arrays.mul(self.imaginary, b.imaginary))
        return Complex(real, arrays.add(arrays.mul(self.real, b.imaginary), arrays.mul(self.imaginary, b.real)))

    @_with_numbers
    def __truediv__(self, b: Complex) -> Complex:
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

    @_with_numbers
    def __rsub__(self, b: Complex) -> Complex:
        return b - self

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
    """The polynomials at one angle; inputs: rotation and shoulder, real and imaginary parts of cosine and sine, and
    `lengths`, as what follows from these is to be as precise as the numbers are."""
    known = np.concatenate([bounds.upper, bounds.fore]).tolist()

    def formula(x: list[Entry]) -> list[Entry]:
        entries = np.array([Complex(entry) for entry in x[:INPUTS]], object)
        angle = Angle(Complex(x[INPUTS], x[INPUTS + 1]), Complex(x[INPUTS + 2], x[INPUTS + 3]))
        given = iter(x[INPUTS + 4 :])
        upper, fore = np.array([Complex(next(given) if v else 0.0) for v in known], object).reshape(2, 3)
        own = bounds._replace(upper=upper, fore=fore)
        rotation, shoulder = entries[:9].reshape(1, 3, 3), entries[9:].reshape(1, 3)
        values = equations(own, rotation, shoulder, np.array([angle], object)).ravel()
        return [part for value in values for part in (value.real, value.imaginary)]

    return recording.record(formula, INPUTS + 4 + len(lengths(bounds)))


def lengths(bounds: Boundaries) -> list[float]:
    """The numbers, but zeros, that tell where shoulder and wrist are."""
    return [float(v) for v in [*bounds.upper, *bounds.fore] if v]


def roots_fields(bounds: Boundaries) -> dict[str, str]:
    """Values of the fields about polynomials and their roots in parts/family_branches.c."""
    recorded = recorded_equations(bounds)
    wide = "long double"
    return {
        "roots": _roots_code(recorded, lengths(bounds), {"real": "double", "suffix": "", "angles": "ARM_ANGLES"}, ""),
        "roots_wide": _roots_code(recorded, lengths(bounds), {"real": wide, "suffix": "_wide", "angles": "ARM_SAMPLED"}, "l"),
        "polynomials": str(len(recorded.outputs) // 2),
        "degree": str(DEGREE),
        "tail": str(turn_roots.TAIL),
        "terms": str(turn_roots.TERMS),
        "cells": str(math.ceil(np.pi * DEGREE / turn_roots.CELL_WIDTH)),
        "halvings": str(turn_roots.HALVINGS),
        "newton": str(turn_roots.STEPS),
        "safe": number_text(turn_roots.SAFE),
        "moved_root": number_text(MOVED_ROOT),
    }


def _roots_code(recorded: recording.Recording, known: list[float], fields: dict[str, str], ending: str) -> str:
    """parts/family_places.c for numbers of one precision; known: `lengths`; ending: of the names of C's functions."""
    inputs = [*(f"g[{k}]" for k in range(INPUTS)), "cr", "ci", "sr", "si", *(f"v{k}" for k in range(len(known)))]
    real, operations = fields["real"], c_and_js_code.C.operations | {"sqrt": f"sqrt{ending}({{}})"}
    language = c_and_js_code.C._replace(real=f"const {real}", operations=operations)
    code = c_and_js_code.write_code(recorded, inputs, language)
    given = [f"const {real} v{k} = {number_text(value)};" for k, value in enumerate(known)]
    stores = [f"value[{k}][i] = {texts[0]};" for k, texts in enumerate(code.outputs)]
    names = ("atan", "cos", "sin", "cosh", "sinh", "exp", "sqrt", "fabs", "fmax")
    rounding = number_text(tol.ROUNDING)
    if real != "double":
        rounding = f"fmaxl({number_text(INPUT_SHARE)}, LDBL_EPSILON / DBL_EPSILON) * {rounding}"
    fields = fields | {name: name + ending for name in names} | {
        "shift": number_text(turn_roots.SHIFT),
        "rounding": rounding,
        "equations": "\n".join(f"        {line}" for line in [*given, *code.lines, *stores]),
    }
    return fill_fields(PART.read_text(encoding="utf-8"), fields)
