"""`armkin export`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armkin.cli.parsing import arguments
from armkin.cli.parsing.options import Meshes, Out, Robot, Scene, TaskName
from armkin.cli.printing import output, render
from armkin.errors import RedundantArmError, UsageError

if TYPE_CHECKING:
    from armkin.model.arm import Arm


_ROBOT_FILE = (".yaml", ".yml")
_ENDINGS = {
    "--urdf": (".urdf", ".xml"),
    "--dh": _ROBOT_FILE,
    "--mdh": _ROBOT_FILE,
    "--screws": _ROBOT_FILE,
    "--json": (".json",),
    "--js": (".js", ".mjs"),
    "--html": (".html", ".htm"),
}


def export(
    robot: Robot,
    urdf: Annotated[
        bool, typer.Option("--urdf", help="URDF: limits, speeds, links as cylinders; metres and radians.")
    ] = False,
    dh: Annotated[bool, typer.Option("--dh", help="A robot file with a standard DH table.")] = False,
    mdh: Annotated[bool, typer.Option("--mdh", help="A robot file with a modified (Craig) DH table.")] = False,
    screws: Annotated[bool, typer.Option("--screws", help="A robot file with screws.")] = False,
    json: Annotated[
        bool, typer.Option("--json", help="Joints, screws, tables and matrices as one JSON object.")
    ] = False,
    c: Annotated[
        bool, typer.Option("--c", help="C99: fk, Jacobian, all branches; a header and a test program.")
    ] = False,
    js: Annotated[
        bool, typer.Option("--js", help="An ES module without imports: all branches in a browser or in node.")
    ] = False,
    html: Annotated[
        bool,
        typer.Option("--html", help="One HTML file that asks no server: all branches as it is dragged."),
    ] = False,
    path: Annotated[
        str | None, typer.Option("--path", metavar="FILE", help="With --html: a path file, whose plan the page plays.")
    ] = None,
    single: Annotated[bool, typer.Option("--float", help="With --c: 32-bit numbers, for microcontrollers.")] = False,
    task: TaskName = None,
    scene: Scene = None,
    meshes: Meshes = None,
    out: Out = None,
) -> None:
    """The arm in other words: URDF, JSON, C, JavaScript, HTML.

    All but --c go to stdout, or to the file that --out names. --dh, --mdh and --screws give a robot file: the
    same arm, the same poses.
    """
    kinds: dict[str, tuple[bool, Callable[[Arm], None]]] = {
        "--urdf": (urdf, partial(_write_urdf, out=out)),
        "--dh": (dh, partial(_write_table, convention="standard", out=out)),
        "--mdh": (mdh, partial(_write_table, convention="modified", out=out)),
        "--screws": (screws, partial(_write_table, convention="screws", out=out)),
        "--json": (json, partial(_write_json, out=out)),
        "--c": (c, partial(_write_c, task=task, single=single, out=out)),
        "--js": (js, partial(_write_js, task=task, out=out)),
        "--html": (html, partial(_write_html, task=task, path=path, meshes=meshes, out=out)),
    }
    kind = _one_chosen({name: is_chosen for name, (is_chosen, _) in kinds.items()})
    if single and not c:
        raise UsageError("--float goes with --c alone")
    if path is not None and not html:
        raise UsageError("--path goes with --html alone")
    if meshes is not None and not html:
        raise UsageError("--meshes goes with --html alone")
    if not c:
        output.check_destination(out, f"export {kind} is", *_ENDINGS[kind])
    _, write_file = kinds[kind]
    write_file(arguments.load_arm(robot, scene))


def _one_chosen(kinds: dict[str, bool]) -> str:
    """The only given option of these. Raises UsageError for none or several."""
    chosen_kinds = [name for name, is_chosen in kinds.items() if is_chosen]
    if len(chosen_kinds) != 1:
        kinds_text = ", ".join(kinds)
        chosen_text = f"; got {' and '.join(chosen_kinds)}" if chosen_kinds else ""
        raise UsageError(f"export: say as what, one of {kinds_text}{chosen_text}")
    return chosen_kinds[0]


def _write_urdf(arm: Arm, out: str | None) -> None:
    """The arm's URDF, and a note of joints without a speed."""
    import numpy as np

    from armkin.export.urdf_writer import urdf_text

    with output.destination(out) as write:
        write(urdf_text(arm))
    if without_speed := [name for name, speed in zip(arm.joint_names, arm.max_speed, strict=True) if np.isnan(speed)]:
        output.note(f"velocity is 0 for {', '.join(without_speed)}: the robot file has no max_speed there")


def _write_table(arm: Arm, convention: str, out: str | None) -> None:
    """The robot file in another convention, and a note of what its targets then count from."""
    from armkin.export import conventions
    from armkin.robot_file.robot_file_text import format_robot_file

    document = (
        conventions.screws(arm) if convention == "screws" else conventions.dh(arm, modified=convention == "modified")
    )
    lines = list(conventions.differences(arm, document))  # reads it: a number may be beyond what a robot file takes
    with output.destination(out) as write:
        write(format_robot_file(document))
    for line in lines:
        output.note(line)


def _write_json(arm: Arm, out: str | None) -> None:
    from armkin.export.arm_json import arm_numbers

    with output.destination(out) as write:
        write(f"{render.to_json({**render.head(arm), **arm_numbers(arm)})}\n")


def _write_js(arm: Arm, task: str | None, out: str | None) -> None:
    from armkin.export.js.es_module import module_text

    with _without_lock("JavaScript"):
        text = module_text(arm, task)
    with output.destination(out) as write:
        write(text)


def _write_html(arm: Arm, task: str | None, path: str | None, meshes: str | None, out: str | None) -> None:
    """The arm's page, with a path's plan and meshes where they are named."""
    from armkin.teach.one_file import arm_html
    from armkin.teach.urdf_meshes import meshes_json as read_meshes

    plan = None
    if path is not None:
        from armkin import path_file
        from armkin.motion.path_planner.path import path as planned

        file = path_file.read_path_file(path)
        path_file.check_robot(file, arm.name, arm.path)
        plan = planned(arm, file)
    with _without_lock("JavaScript"):
        text = arm_html(arm, task, plan, None if meshes is None else read_meshes(arm, meshes))
    with output.destination(out) as write:
        write(text)


@contextmanager
def _without_lock(language: str) -> Iterator[None]:
    """What `ik` advises, --lock, is none of what a file in another language can take."""
    try:
        yield
    except RedundantArmError as error:
        from armkin.cli.advice import HOLD_JOINTS

        raise UsageError(f"{error.message}: no {language} for that; {HOLD_JOINTS}") from None


def _write_c(arm: Arm, task: str | None, single: bool, out: str | None) -> None:
    """Three files: what was named, its header, and its test program."""
    from armkin.export.c.c_program import program

    if out is None or Path(out).suffix != ".c":
        raise UsageError("--c writes a source, its header and a test program: name the source, for example -o arm.c")
    path = Path(out)
    if any(letter in path.name for letter in '"\\\n'):
        raise UsageError(f"{path.name}: #include cannot name a header with a quote or a backslash in its name")
    try:
        with _without_lock("C"):
            texts = program(arm, path.name, task, single)
    except UsageError as error:
        if error.fields.get("precision") != "double":
            raise
        raise UsageError(error.message, advice="leave --float away", **error.fields) from None
    header, test = path.with_suffix(".h"), path.with_name(f"{path.stem}_test.c")
    with ExitStack() as files:  # all three, or none: one that cannot be written leaves the others as they were
        for name, text in ((test, texts.test), (header, texts.header), (path, texts.source)):
            files.enter_context(output.destination(str(name)))(text)
    output.note(f"wrote {path}, {header.name} and {test.name}")
