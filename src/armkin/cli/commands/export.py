"""`armkin export`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armkin.cli import inputs, output
from armkin.cli.options import Out, Robot, TaskName
from armkin.errors import UsageError

if TYPE_CHECKING:
    from armkin.model.arm import Arm


def export(
    robot: Robot,
    c: Annotated[
        bool, typer.Option("--c", help="C99: fk, Jacobian, all branches; a header and a test program.")
    ] = False,
    single: Annotated[bool, typer.Option("--float", help="With --c: 32-bit numbers, for microcontrollers.")] = False,
    task: TaskName = None,
    out: Out = None,
) -> None:
    """The arm in other words: C99."""
    kinds: dict[str, tuple[bool, Callable[[Arm], None]]] = {
        "--c": (c, lambda arm: _c(arm, task, single, out)),
    }
    asked = [name for name, (wanted, _) in kinds.items() if wanted]
    if len(asked) != 1:
        listed = ", ".join(kinds)
        raise UsageError(f"export: say as what, one of {listed}" + (f"; got {' and '.join(asked)}" if asked else ""))
    if single and not c:
        raise UsageError("--float goes with --c alone")
    output.spare(robot, out)
    kinds[asked[0]][1](inputs.load(robot))


def _c(arm: Arm, task: str | None, single: bool, out: str | None) -> None:
    """Three files: what was named, its header, and its test program."""
    from armkin.export.c.program import program

    if out is None or Path(out).suffix != ".c":
        raise UsageError("--c writes a source, its header and a test program: name the source, for example -o arm.c")
    path = Path(out)
    texts = program(arm, path.name, task, single)
    for name, text in ((path.with_suffix(".h"), texts.header), (path.with_name(f"{path.stem}_test.c"), texts.test)):
        with output.destination(str(name)) as write:
            write(text)
    with output.destination(out) as write:
        write(texts.source)
    output.note(f"wrote {path}, {path.with_suffix('.h').name} and {path.stem}_test.c")
