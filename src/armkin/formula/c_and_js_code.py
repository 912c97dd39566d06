"""A recording as C99 or JavaScript: one assignment a line, branch axes unrolled, equal values once.

The lines are plain expressions without branches or memory, so that compilers turn a loop around them into
vector instructions.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from armkin.formula.recording import BOOLEAN, FLIPS, Node, Recording, axes_of, index_before_flip

# Operations on single numbers; the functions in capitals are macros of the file that the lines go to.
_C = {
    "multiply": "{} * {}",
    "add": "{} + {}",
    "subtract": "{} - {}",
    "divide": "{} / {}",
    "absolute": "ARM_ABS({})",
    "sqrt": "ARM_SQRT({})",
    "cbrt": "ARM_CBRT({})",
    "tan": "ARM_TAN({})",
    "arctan2": "ARM_ATAN2({}, {})",
    "rint": "ARM_RINT({})",
    "sign": "({0} > 0) - ({0} < 0)",
    "copysign": "ARM_COPYSIGN({}, {})",
    "less": "{} < {}",
    "less_equal": "{} <= {}",
    "greater": "{} > {}",
    "greater_equal": "{} >= {}",
    "equal": "{} == {}",
    "bitwise_or": "{} | {}",
    "bitwise_and": "{} & {}",
    "where": "{} ? {} : {}",
    # where the first is not a number, so is the result
    "maximum": "{1} > {0} ? {1} : {0}",
    "minimum": "{1} < {0} ? {1} : {0}",
}
MIN_CONSTANT = 1e-30  # constant of a formula that stands for "next to nothing" in single precision


_COMPARISONS = {"less": "<", "less_equal": "<=", "greater": ">", "greater_equal": ">=", "equal": "==="}
# The same in JavaScript, where 1 and 0 are truth; `rint` and `copysign` are functions of the module with the lines.
_JAVASCRIPT = _C | {
    "absolute": "Math.abs({})",
    "sqrt": "Math.sqrt({})",
    "cbrt": "Math.cbrt({})",
    "tan": "Math.tan({})",
    "arctan2": "Math.atan2({}, {})",
    "rint": "rint({})",
    "sign": "Math.sign({})",
    "copysign": "copysign({}, {})",
    **{op: f"{{}} {sign} {{}} ? 1 : 0" for op, sign in _COMPARISONS.items()},
}


class Value(NamedTuple):
    """A number with its sign: `text` is a constant's digits or a variable's name."""

    text: str
    minus: bool = False
    constant: float | None = None

    def __str__(self) -> str:
        return f"-{self.text}" if self.minus else self.text


class Code(NamedTuple):
    """The lines of a recording, and the expressions of its outputs, one a branch, in the order of `numpy.ndindex`."""

    lines: list[str]
    outputs: list[list[str]]


def number_text(value: float, single: bool = False) -> str:
    """A constant as C99: all digits that tell it from its neighbours.

    >>> number_text(0.1), number_text(3.0), number_text(0.1, single=True)
    ('0.1', '3.0', '0.1f')
    """
    if math.isinf(value) or math.isnan(value):
        return f"{'-' if value < 0 else ''}ARM_INFINITY"
    if not single:
        return repr(float(value))
    if value != 0.0 and abs(value) < MIN_CONSTANT:
        value = math.copysign(MIN_CONSTANT, value)
    text = str(np.float32(value))
    return f"{text}f"


class Language(NamedTuple):
    """How one language says a line: its operations, the words before a name, constants."""

    operations: dict[str, str]
    real: str
    boolean: str
    number: Callable[[float], str]


C = Language(_C, "const arm_real", "const int", number_text)
C_SINGLE = Language(_C, "const arm_real", "const int", partial(number_text, single=True))
JAVASCRIPT = Language(
    _JAVASCRIPT, "const", "const", lambda value: number_text(value).replace("ARM_INFINITY", "Infinity")
)


class _Writer:
    """Lines written so far; a value that is known already is not computed again."""

    def __init__(self, language: Language) -> None:
        self.language = language
        self.lines: list[str] = []
        self.values_by_key: dict[tuple[Any, ...], Value] = {}

    def constant(self, value: float) -> Value:
        """A number, its sign apart."""
        value = float(value)
        minus = math.copysign(1.0, value) < 0
        return Value(self.language.number(abs(value)), minus, abs(value))

    def apply(self, op: str, args: list[Value]) -> Value:
        """The value of an operation: no factors of one, signs moved outwards, equal operations once."""
        if op in ("multiply", "divide", "add", "subtract"):
            return self._arithmetic(op, *args)
        if op == "negative":
            return _flip_sign(args[0], True)
        if op == "power":
            assert args[1].constant == 2.0, "only squares are recorded"
            return self._arithmetic("multiply", args[0], args[0])
        if op == "absolute":
            args = [args[0]._replace(minus=False)]
        if op == "where" and args[1] == args[2]:
            return args[1]
        if op in ("maximum", "minimum") and args[0].constant is not None:
            args = args[::-1]
        return self.emit(op, args)

    def _arithmetic(self, op: str, a: Value, b: Value) -> Value:
        """A product, a quotient, a sum or a difference."""
        if a.constant is not None and b.constant is not None and op != "divide":
            x, y = (-c if minus else c for c, minus in ((a.constant, a.minus), (b.constant, b.minus)))
            return self.constant({"multiply": x * y, "add": x + y, "subtract": x - y}[op])
        if op in ("add", "subtract"):
            return self._sum(a, _flip_sign(b, op == "subtract"))
        minus = a.minus != b.minus
        a, b = a._replace(minus=False), b._replace(minus=False)
        if op == "multiply" and a.constant == 1.0:
            return _flip_sign(b, minus)
        if b.constant == 1.0:
            return _flip_sign(a, minus)
        if op == "multiply" and 0.0 in (a.constant, b.constant):
            return self.constant(0.0)
        return _flip_sign(self.emit(op, sorted((a, b)) if op == "multiply" else [a, b]), minus)

    def _sum(self, a: Value, b: Value) -> Value:
        if a.constant == 0.0:
            return b
        if b.constant == 0.0:
            return a
        if a.minus == b.minus:
            magnitudes = sorted((a._replace(minus=False), b._replace(minus=False)))
            return _flip_sign(self.emit("add", magnitudes), a.minus)
        plus, minus = (b, a) if a.minus else (a, b)
        return self.emit("subtract", [plus._replace(minus=False), minus._replace(minus=False)])

    def emit(self, op: str, args: list[Value]) -> Value:
        """A new variable for an operation, or the one that holds it."""
        key = (op, *args)
        if key not in self.values_by_key:
            name = f"t{len(self.lines)}"
            kind = self.language.boolean if op in BOOLEAN else self.language.real
            texts = [f"({x})" if x.minus and k else str(x) for k, x in enumerate(args)]
            self.lines.append(f"{kind} {name} = {self.language.operations[op].format(*texts)};")
            self.values_by_key[key] = Value(name)
        return self.values_by_key[key]


def _flip_sign(x: Value, minus: bool) -> Value:
    return x._replace(minus=x.minus != minus)


def write_code(recording: Recording, inputs: list[str], language: Language = C) -> Code:
    """The lines that compute a recording; inputs: the expressions of its inputs."""
    writer = _Writer(language)
    values: dict[int, dict[tuple[int, ...], Value]] = {
        id(node): {(): Value(text)} for node, text in zip(recording.inputs, inputs, strict=True)
    }

    def value(x: Any, index: tuple[int, ...]) -> Value:
        axes = axes_of(x)
        place = tuple(0 if size == 1 else i for size, i in zip(axes, index[len(index) - len(axes) :], strict=True))
        if isinstance(x, Node):
            return values[id(x)][place]
        return writer.constant(float(np.asarray(x)[(*place, 0)] if np.ndim(x) else x))

    for node in recording.nodes:
        if node.op in FLIPS:
            argument = node.args[0]
            values[id(node)] = {
                index: value(argument, index_before_flip(node.op, index, node.axes)) for index in np.ndindex(*node.axes)
            }
            continue
        values[id(node)] = {
            index: writer.apply(node.op, [value(x, index) for x in node.args]) for index in np.ndindex(*node.axes)
        }
    outputs = [[str(value(x, index)) for index in np.ndindex(*axes_of(x))] for x in recording.outputs]
    return Code(writer.lines, outputs)
