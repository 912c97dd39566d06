"""`armkin new`."""

from __future__ import annotations

import csv
import os
import re
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from armkin.cli.parsing import arguments
from armkin.cli.parsing.number_parsing import number, of_pi, whole_number
from armkin.cli.parsing.options import RobotOut
from armkin.cli.printing import output
from armkin.errors import FileError, RobotFileError, UsageError

if TYPE_CHECKING:
    from armkin.robot_file.new_file import Row

_COLUMNS = ("alpha", "a", "d", "theta", "type", "lower", "upper", "home", "name")
_VARIABLE = re.compile(r"([+-]?)(?:q|theta|th|d|s|\u03b8)_?[0-9]{0,2}\*? *(?:([+-]) *([0-9.pi/*\u03c0]{1,20}))?", re.I)
_LARGEST_FILE = 1_000_000  # size [bytes], at most, of a table

ArmName = Annotated[str, typer.Argument(metavar="NAME", help="The arm's name; the file is NAME.yaml.")]
DhRow = Annotated[
    list[str] | None,
    typer.Option(
        "--dh",
        metavar="ALPHA,A,D[,THETA]",
        help="A row of the DH table, in degrees and mm. Repeatable; d3 for d makes a prismatic joint.",
    ),
]
DhTable = Annotated[
    str | None,
    typer.Option(
        "--batch",
        metavar="FILE|-",
        help="The table as CSV: alpha,a,d[,theta], or a heading with these, type, lower, upper, home, name.",
    ),
]
Convention = Annotated[
    str | None,
    typer.Option("--convention", metavar="NAME", help="standard, or modified (Craig). Needed with --dh and --batch."),
]
NumbersFrom = Annotated[str, typer.Option("--source", metavar="TEXT", help="Where the numbers come from.")]
Floor = Annotated[
    float | None,
    typer.Option("--floor", metavar="Z", help="A keep-out: nothing of the arm goes below this z, in mm."),
]


def new(
    name: ArmName,
    dh: DhRow = None,
    batch: DhTable = None,
    convention: Convention = None,
    source: NumbersFrom = "",
    floor: Floor = None,
    out: RobotOut = None,
) -> None:
    """A robot file from a DH table, commented.

    Without --dh or --batch it asks on the terminal. Entries may be written as papers do: pi/2 for an angle,
    q2 + 90 or d3 for the variable. Keys that the table does not give stand in the file as
    comments, to be filled in.
    """
    from armkin.robot_file.new_file import new_file_text

    path = _output_path(name, out)
    asks = not dh and batch is None and sys.stdin is not None and sys.stdin.isatty()
    convention, table = _table_by_questions(convention) if asks else _table_of_options(dh, batch, convention)
    if convention not in ("standard", "modified"):
        raise UsageError(f"--convention {convention}: must be standard or modified")
    rows = [_dh_row(entries, i) for i, entries in enumerate(table, 1)]
    title = os.path.basename(name)
    if asks and floor is None:
        floor = _ask_floor(lambda z: _check_file(new_file_text(title, convention, rows, source, z), path))
    file_text = new_file_text(title, convention, rows, source, floor)
    _check_file(file_text, path)  # what it refuses, limits for one, is told in its words, and nothing is written
    with output.destination(path) as write:
        write(file_text)
    if path != "-":
        word = shlex.quote(path)
        output.note(f"wrote {path}; armkin info {word} prints it as papers do, armkin fk {word} home where it stands")


def _check_file(text: str, path: str) -> None:
    """Raise RobotFileError for a file that is not valid, or whose floor is hit in every posture."""
    from armkin.keep_out.load_with_scene import arm_in_scene
    from armkin.robot_file import parse_robot_file

    arm_in_scene(parse_robot_file(text, path))


def _table_of_options(
    dh: list[str] | None, batch: str | None, convention: str | None
) -> tuple[str, list[dict[str, str]]]:
    """The convention and the table that the options give. Raises UsageError for what lacks."""
    if dh and batch is not None:
        raise UsageError("--dh and --batch: give one of the two")
    if not (dh or batch is not None) or convention is None:
        raise _lacking_error(bool(dh) or batch is not None, convention)
    return convention, _rows_of_options(dh) if dh else _rows_of_csv(batch or "-")


def _lacking_error(table: bool, convention: str | None) -> UsageError:
    """All that is missing, at once."""
    lacks = [] if table else ["no table: give --dh ALPHA,A,D,THETA for each joint, or --batch FILE (a CSV)"]
    if convention is None:
        lacks.append(
            "--convention is missing: standard (Rz Tz Tx Rx) or modified (Craig: Rx Tx Rz Tz); the table's source says"
        )
    return UsageError("\n".join(lacks))


def _output_path(name: str, out: str | None) -> str:
    base = os.path.basename(name)
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9 _.-]{0,79}", base) or base.endswith((".yaml", ".yml")):
        base_without_ending = re.sub(r"\.ya?ml$", "", base)
        advice = "" if base_without_ending == base else f"; write {base_without_ending}"
        raise UsageError(f"NAME: '{name}' is the arm's name, letters and digits{advice}")
    path = out or f"{name}.yaml"
    if path != "-" and os.path.exists(path):
        raise FileError(f"{path} is there already; give another name or --out FILE", file=path)
    return path


def _rows_of_options(words: Sequence[str]) -> list[dict[str, str]]:
    table = []
    for i, word in enumerate(words, 1):
        cells = [cell.strip() for cell in word.split(",")]
        if len(cells) not in (3, 4):
            raise UsageError(f"--dh {word}: row {i} takes alpha,a,d or alpha,a,d,theta with commas, got {len(cells)}")
        table.append(dict(zip(_COLUMNS, cells, strict=False)))
    return table


def _text_of(source: str) -> str:
    """The text of a file, or of standard input for "-"."""
    try:
        if source == "-":
            return arguments.standard_input(_LARGEST_FILE).decode("utf-8-sig")
        with open(source, encoding="utf-8-sig") as file:
            return file.read(_LARGEST_FILE)
    except (OSError, ValueError) as error:
        raise FileError(f"{source}: cannot read: {getattr(error, 'strerror', None) or error}", file=source) from None


def _rows_of_csv(source: str) -> list[dict[str, str]]:
    """The rows of a CSV by the names of their columns; UsageError for rows of too few or too many cells."""
    lines = [line for line in _text_of(source).splitlines() if line.strip() and not line.lstrip().startswith("#")]
    try:
        rows = [[cell.strip() for cell in row] for row in csv.reader(lines, skipinitialspace=True)]
    except csv.Error as error:
        raise UsageError(f"{source}: this is no CSV: {error}") from None
    heading = _heading(source, rows[0]) if rows else None
    if heading is not None:
        rows = rows[1:]
    heading = heading or _COLUMNS
    if not rows:
        raise UsageError(f"{source}: no rows; give one of alpha,a,d,theta for each joint")
    for i, row in enumerate(rows, 1):
        if not 3 <= len(row) <= len(heading):
            raise UsageError(f"{source}: row {i} has {len(row)} cells; it takes {','.join(heading)}")
    return [dict(zip(heading, row, strict=False)) for row in rows]


def _heading(source: str, cells: list[str]) -> Sequence[str] | None:
    """The columns, if a table's first row names them."""
    heading = [cell.lower() for cell in cells]
    if not {"alpha", "a", "d"} <= set(heading):
        return None
    if unknown := [cell for cell in heading if cell not in _COLUMNS]:
        raise UsageError(f"{source}: there is no column {unknown[0]}; the columns are {', '.join(_COLUMNS)}")
    return heading


def _ask(question: str, default: str, check: Callable[[str], object]) -> str:
    """An answer on the terminal; one that does not do is asked for again."""
    while True:
        answer = str(typer.prompt(question, default=default, err=True)).strip()
        try:
            check(answer)
            return answer
        except (UsageError, RobotFileError) as error:
            output.warn(str(error))


def _ask_floor(check: Callable[[float | None], object]) -> float | None:
    """The height that the arm may not go below; a file that is wrong for other reasons is refused at once."""
    check(None)

    def floor_height(answer: str) -> float | None:
        return None if answer == "none" else number(answer, "floor")

    return floor_height(
        _ask("floor: z that nothing goes below [mm], or none", "none", lambda word: check(floor_height(word)))
    )


def _table_by_questions(convention: str | None) -> tuple[str, list[dict[str, str]]]:
    """The table by questions on the terminal."""

    def check_convention(answer: str) -> None:
        if answer not in ("standard", "modified"):
            raise UsageError("write standard (Rz Tz Tx Rx) or modified (Craig: Rx Tx Rz Tz); the table's source says")

    def check_limits(answer: str) -> None:
        if answer != "none":
            _row_limits(dict(zip(("lower", "upper"), answer.split(","), strict=False)), "limits")

    convention = convention or _ask("convention, standard or modified", "standard", check_convention)
    count = whole_number(_ask("how many joints", "3", lambda n: whole_number(n, "joints", 1, 12)), "joints", 1, 12)
    table = []
    for i in range(1, count + 1):
        row = {
            "alpha": _ask(f"joint {i}: alpha [deg]", "0", lambda word: _table_entry(word, "alpha")),
            "a": _ask(f"joint {i}: a [mm]", "0", lambda word: _table_entry(word, "a")),
            "d": _ask(f"joint {i}: d [mm], d{i} if it slides", "0", lambda word: _table_entry(word, "d")),
            "theta": _ask(f"joint {i}: theta offset [deg]", "0", lambda word: _table_entry(word, "theta")),
        }
        span = _ask(f"joint {i}: limits LOWER,UPPER, or none", "none", check_limits)
        if span != "none":
            row |= dict(zip(("lower", "upper"), span.split(","), strict=True))
        table.append(row)
    return convention, table


def _is_prismatic(cells: Mapping[str, str], row: str, *, d_varies: bool) -> bool:
    """Whether a row's joint is prismatic, by its type or, without one, by its variable."""
    kind = (cells.get("type") or "").lower()
    if kind not in ("", "revolute", "prismatic", "r", "p"):
        raise UsageError(f"{row}type: '{cells['type']}' must be revolute or prismatic")
    return kind in ("prismatic", "p") or (not kind and d_varies)


def _dh_row(cells: Mapping[str, str], i: int) -> Row:
    """A row of the table with its joint's kind, limits and home; i: its number, for messages."""
    from armkin.robot_file.new_file import Row

    context = f"row {i}: "
    values = {key: _table_entry(cells.get(key) or "0", f"{context}{key}") for key in ("alpha", "a", "d", "theta")}
    for key in ("alpha", "a"):
        if values[key][1]:
            raise UsageError(f"{context}{key}: '{cells[key]}' is a variable; only theta or d can be")
    slides = _is_prismatic(cells, context, d_varies=values["d"][1])
    if values["d"][1] and values["theta"][1]:
        raise UsageError(f"{context}both theta and d are variables; a joint has one")
    limits = _row_limits(cells, context)
    home = number(cells.get("home") or "0", f"{context}home")
    if limits is not None and not cells.get("home") and not limits[0] <= home <= limits[1]:
        home = limits[0]
        output.note(f"{context}0 is outside the limits: home is {home:g}")
    numbers = {key: value for key, (value, _) in values.items()}
    return Row(cells.get("name") or f"q{i}", **numbers, prismatic=slides, limits=limits, home=home)


def _row_limits(cells: Mapping[str, str], row: str) -> tuple[float, float] | None:
    lower, upper = cells.get("lower") or "", cells.get("upper") or ""
    if not lower and not upper:
        return None
    if not (lower and upper):
        raise UsageError(f"{row}: give both lower and upper, or neither")
    return number(lower, f"{row}lower"), number(upper, f"{row}upper")


def _table_entry(word: str, name: str) -> tuple[float, bool]:
    """An entry of the table as papers write it: its constant, and whether the joint's variable is in it."""
    if (angle := of_pi(word)) is not None and not name.endswith((" a", " d")):
        return angle, False
    match = _VARIABLE.fullmatch(word.strip())
    if match is None or not word.strip():
        return number(word, name), False
    if match[1] == "-":
        raise UsageError(f"{name}: '{word}' counts against its row; write the constant here and sign: -1 in the file")
    constant = match[3] or "0"
    angle = of_pi(constant)
    return (number(constant, name) if angle is None else angle) * (-1.0 if match[2] == "-" else 1.0), True
