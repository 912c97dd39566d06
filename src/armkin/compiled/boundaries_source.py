"""The C text of the places where families of an arm may change: `armkin.inverse.redundant.boundaries` and their roots.

The equations are recorded on complex numbers of symbols, once for numbers of two precisions.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from armkin.compiled.own_parts import own_part
from armkin.export.c.c_program import fill_fields
from armkin.formula import arrays, c_and_js_code, recording
from armkin.formula.arrays import Entry
from armkin.formula.c_and_js_code import number_text
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant import turn_roots
from armkin.inverse.redundant.boundaries import DEGREE, Boundaries, equations

INPUTS = 12  # numbers of a target's rotation and of where it has the shoulder
FUNCTIONS = ("atan", "cos", "sin", "cosh", "sinh", "exp", "sqrt", "fabs", "fmax")  # of C's library


def _with_numbers(operation: Callable[[ComplexNumber, ComplexNumber], ComplexNumber]) -> Callable[[Any, Any], Any]:
    """An operation that leaves arrays to numpy, which does it with each of their numbers."""

    def apply(one: ComplexNumber, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        return operation(one, other if isinstance(other, ComplexNumber) else ComplexNumber(float(other)))

    return apply


class ComplexNumber:
    """A complex number whose parts are numbers or symbols, for numpy's arrays of objects."""

    def __init__(self, real: Entry, imaginary: Entry = 0.0) -> None:
        self.real, self.imaginary = real, imaginary

    @_with_numbers
    def __add__(self, b: ComplexNumber) -> ComplexNumber:
        return ComplexNumber(arrays.add(self.real, b.real), arrays.add(self.imaginary, b.imaginary))

    @_with_numbers
    def __sub__(self, b: ComplexNumber) -> ComplexNumber:
        return ComplexNumber(arrays.sub(self.real, b.real), arrays.sub(self.imaginary, b.imaginary))

    @_with_numbers
    def __mul__(self, b: ComplexNumber) -> ComplexNumber:
        real = arrays.sub(arrays.mul(self.real, b.real), arrays.mul(self.imaginary, b.imaginary))
        return ComplexNumber(real, arrays.add(arrays.mul(self.real, b.imaginary), arrays.mul(self.imaginary, b.real)))

    @_with_numbers
    def __truediv__(self, b: ComplexNumber) -> ComplexNumber:
        product = ComplexNumber.__mul__(self, ComplexNumber(b.real, arrays.sub(0.0, b.imaginary)))
        square = arrays.add(arrays.mul(b.real, b.real), arrays.mul(b.imaginary, b.imaginary))
        return ComplexNumber(product.real / square, product.imaginary / square)

    @_with_numbers
    def __rsub__(self, b: ComplexNumber) -> ComplexNumber:
        return ComplexNumber(arrays.sub(b.real, self.real), arrays.sub(b.imaginary, self.imaginary))

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> Any:
        return self * -1.0

    def __pow__(self, exponent: int) -> Any:
        """Squares alone."""
        assert exponent == 2
        return self * self

    def sqrt(self) -> ComplexNumber:
        """The root of a real number."""
        assert isinstance(self.imaginary, float)
        return ComplexNumber(arrays.sqrt(self.real))


class ComplexAngle:
    """A complex angle, known by its cosine and sine."""

    def __init__(self, cosine: ComplexNumber, sine: ComplexNumber) -> None:
        self._cosine, self._sine = cosine, sine

    def cos(self) -> ComplexNumber:
        """For `numpy.cos`."""
        return self._cosine

    def sin(self) -> ComplexNumber:
        """For `numpy.sin`."""
        return self._sine


def record_equations(bounds: Boundaries) -> recording.Recording:
    """All polynomials at one angle, real and imaginary parts.

    Inputs: a target's rotation and shoulder, real and imaginary parts of the angle's cosine and sine, and
    `lengths`, as what follows from them shall be as precise as the numbers are.
    """
    places = np.concatenate([bounds.upper, bounds.fore]).tolist()

    def formula(x: list[Entry]) -> list[Entry]:
        numbers = np.array([ComplexNumber(entry) for entry in x[:INPUTS]], object)
        rotation, shoulder = numbers[:9].reshape(1, 3, 3), numbers[9:].reshape(1, 3)
        cosine, sine = (ComplexNumber(x[k], x[k + 1]) for k in (INPUTS, INPUTS + 2))
        symbols = iter(x[INPUTS + 4 :])
        upper_and_fore = np.array([ComplexNumber(next(symbols) if v else 0.0) for v in places], object)
        symbolic = bounds._replace(upper=upper_and_fore[:3], fore=upper_and_fore[3:])
        values: Any = equations(symbolic, rotation, shoulder, np.array([ComplexAngle(cosine, sine)], object))
        return [part for value in values.ravel() for part in (value.real, value.imaginary)]

    return recording.record(formula, INPUTS + 4 + len(lengths(bounds)))


def lengths(bounds: Boundaries) -> list[float]:
    """Where shoulder and wrist are, seen before and behind joint 4 [reaches], without zeros."""
    return [float(v) for v in (*bounds.upper, *bounds.fore) if v]


def roots_fields(bounds: Boundaries) -> dict[str, str]:
    """Values of the fields about polynomials and their roots in parts/family_places.c."""
    recorded, known = record_equations(bounds), lengths(bounds)
    single = {"real": "double", "suffix": "", "angles": "ARM_ANGLES", "rounding": number_text(tol.ROUNDING)}
    wide = {"real": "long double", "suffix": "_wide", "angles": "ARM_SAMPLED"}
    wide["rounding"] = f"fmaxl({turn_roots.INPUT_SHARE}, LDBL_EPSILON / DBL_EPSILON) * {number_text(tol.ROUNDING)}"
    return {
        "roots": _roots_code(recorded, known, single, ""),
        "roots_wide": _roots_code(recorded, known, wide, "l"),
        "polynomials": str(len(recorded.outputs) // 2),
        "degree": str(DEGREE),
        "tail": str(turn_roots.TAIL),
        "terms": str(turn_roots.TERMS),
        "cells": str(math.ceil(np.pi * DEGREE / turn_roots.CELL_WIDTH)),
        "halvings": str(turn_roots.HALVINGS),
        "newton": str(turn_roots.STEPS),
        "safe": number_text(turn_roots.SAFE),
        "moved_root": number_text(tol.MOVED_ROOT),
    }


def _roots_code(recorded: recording.Recording, known: list[float], fields: dict[str, str], ending: str) -> str:
    """parts/family_places.c for numbers of one precision; known: `lengths`; ending: of its functions in C's library."""
    real, operations = fields["real"], c_and_js_code.C.operations | {"sqrt": f"sqrt{ending}({{}})"}
    language = c_and_js_code.C._replace(real=f"const {real}", operations=operations)
    names = [f"v{k}" for k in range(len(known))]
    inputs = [*(f"g[{k}]" for k in range(INPUTS)), "cr", "ci", "sr", "si", *names]
    code = c_and_js_code.write_code(recorded, inputs, language)
    lines = [f"const {real} {name} = {number_text(value)};" for name, value in zip(names, known, strict=True)]
    lines += [*code.lines, *(f"value[{k}][i] = {texts[0]};" for k, texts in enumerate(code.outputs))]
    fields = fields | {name: name + ending for name in FUNCTIONS}
    fields |= {"shift": number_text(turn_roots.SHIFT), "equations": "\n".join(f"        {line}" for line in lines)}
    return fill_fields(own_part("family_places"), fields)
