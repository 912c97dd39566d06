"""`armkin robots`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import armkin
from armkin.cli.parsing.options import Json, TextOut
from armkin.cli.printing import output, render

if TYPE_CHECKING:
    from armkin.cli.answers import ShippedRobot

_CAPABILITIES = ("ik", "pulses", "simulate", "send", "home")


def robots(json: Json = False, out: TextOut = None) -> None:
    """The robots that come with armkin, and what each can do.

    Each is used by its name from any folder: `armkin fk three_dof -30 5 -5`. simulate: `send --dry-run`, and
    `--port sim` without assumptions. `armkin info ROBOT` says what is missing for the rest. compared: whether the
    geometry was compared with a maker's or another author's figure, or only with the URDF that it comes from;
    --json says which.
    """
    from armkin.robot_file import catalogue

    entries = [_robot_entry(name) for name in catalogue.robot_names()]
    with output.destination(out) as write:
        write(render.to_json({"robots": entries}) + "\n" if json else _text(entries))


def _robot_entry(name: str) -> ShippedRobot:
    """A shipped robot as data of JSON: its joints, its task and what it can do."""
    from armkin.board.backend.missing_keys import missing_by_command

    arm = armkin.load(name)
    task, labels, refusals = _task_and_target(arm)
    lacks = missing_by_command(arm)
    return {
        **render.head(arm),
        "description": arm.description,
        "joints": list(arm.joint_names),
        "joint_types": ["prismatic" if is_prismatic else "revolute" for is_prismatic in arm.prismatic],
        "task": task,
        "target_labels": labels,
        "can": {"ik": not refusals, **{command: not lacks[command] for command in _CAPABILITIES[1:]}},
        "lacks": {"ik": refusals, **lacks},
        "compared": "" if arm.file is None else arm.file.compared,
    }


def _task_and_target(arm: Any) -> tuple[str | None, list[str], list[str]]:
    """The task with its target's numbers, and why `armkin ik` refuses it."""
    from armkin.errors import UsageError
    from armkin.inverse.tasks.choose_task import task_for

    try:
        task = task_for(arm)
    except UsageError as error:
        return None, [], [str(error)]
    surplus = arm.n - task.constraints  # with one joint to spare ik lists families; with more it asks for held ones
    return task.name, list(task.labels), [f"hold {surplus} joints with --lock"] if surplus > 1 else []


def _text(robots: list[ShippedRobot]) -> str:
    rows = [["robot", "joints", "task", "target", *_CAPABILITIES, "compared"]]
    for entry in robots:
        kinds = "".join("P" if kind == "prismatic" else "R" for kind in entry["joint_types"])
        marks = ["yes" if entry["can"][command] else "-" for command in _CAPABILITIES]
        if entry["task"] is not None and not entry["can"]["ik"]:
            marks[0] = "--lock"
        comparison = "URDF only" if entry["compared"].startswith("only its own URDF") else "yes"
        rows.append([entry["robot"], kinds, entry["task"] or "-", " ".join(entry["target_labels"]), *marks, comparison])
    return render.table(rows, left_aligned=range(10), indent="") + "\n"
