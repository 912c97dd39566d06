"""What a shell offers when Tab is pressed: robots, joints, branches, tasks, poses and ports by name.

Typer calls these while a command line is being typed; what goes wrong offers nothing and says nothing. Where
nothing is offered, the shell completes names of files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import wraps
from typing import TYPE_CHECKING

import typer

import armkin

if TYPE_CHECKING:
    from armkin.model.arm import Arm

Complete = Callable[[typer.Context, str], list[str]]


def _without_errors(offers: Callable[[typer.Context], Iterable[str]]) -> Complete:
    """A completion of the offers that begin with what was typed; errors offer nothing."""

    @wraps(offers)
    def complete(ctx: typer.Context, incomplete: str) -> list[str]:
        try:
            return [word for word in offers(ctx) if word.startswith(incomplete)]
        except Exception:  # a half-typed command line may be anything
            return []

    complete.__annotations__ = {"ctx": typer.Context, "incomplete": str}  # Typer reads them
    del complete.__dict__["__wrapped__"]
    return complete


def _arm_of(ctx: typer.Context) -> Arm:
    from armkin.keep_out.load_with_scene import load

    return load(str(ctx.params["robot"]))


@_without_errors
def robots(ctx: typer.Context) -> Iterable[str]:
    """Shipped robots."""
    from armkin.robot_file import catalogue

    return catalogue.robot_names()


@_without_errors
def poses(ctx: typer.Context) -> Iterable[str]:
    """Named poses, in place of joint values."""
    return [] if ctx.params.get("q") else _arm_of(ctx).poses


@_without_errors
def joints(ctx: typer.Context) -> Iterable[str]:
    """Joints of the robot."""
    return _arm_of(ctx).joint_names


@_without_errors
def assignments(ctx: typer.Context) -> Iterable[str]:
    """Joints of the robot, to be given a value."""
    return [f"{name}=" for name in _arm_of(ctx).joint_names]


@_without_errors
def branches(ctx: typer.Context) -> Iterable[str]:
    """Names of the robot's branches, written without blanks: left/elbow-up."""
    from armkin.inverse.tasks.choose_task import task_for
    from armkin.inverse.tasks.task import targets_of

    arm = _arm_of(ctx)
    task = task_for(arm, ctx.params.get("task"))
    goal = targets_of(task, armkin.fk(arm, arm.home)[None], arm.home[None])
    return [name.replace(", ", "/").replace(" ", "-") for name in armkin.ik(arm, goal, task.name).names]


@_without_errors
def tasks(ctx: typer.Context) -> Iterable[str]:
    """Names of the tasks."""
    from armkin.inverse.tasks.task import LABELS

    return LABELS


@_without_errors
def ports(ctx: typer.Context) -> Iterable[str]:
    """Serial ports, and the board in the process."""
    from armkin.board.ports import list_ports

    return ["sim", *(port.device for port in list_ports())]
