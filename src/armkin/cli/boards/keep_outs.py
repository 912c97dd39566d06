"""What commands that move an arm share about keep-outs: radii that are assumed, a port's scene, what is ignored."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from armkin.cli.parsing import arguments
from armkin.cli.printing import output
from armkin.errors import UsageError

if TYPE_CHECKING:
    from armkin.board.backend import Backend, Planned
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Trajectory

Ignore = Annotated[
    bool,
    typer.Option("--ignore-keep-out", help="Move without the proof that nothing is hit, this once."),
]
NoScene = Annotated[
    bool,
    typer.Option("--no-scene", help="Forget the scene that this port was last used with."),
]
_POSTURE_COUNT = 4001  # postures of a motion in which hits that are ignored are looked for


def check_together(scene: str | None, no_scene: bool) -> None:
    """Raise UsageError for `--scene` and `--no-scene`: the port would keep the scene that it was to forget."""
    if scene is not None and no_scene:
        raise UsageError("--scene and --no-scene contradict each other: leave one away")


def load_moving_arm(robot: str, scene: str | None, ignore: bool = False, tool: str | None = None) -> Arm:
    """The arm of a command that moves it; radii that are assumed are named."""
    return mark_ignored(arguments.load_arm(robot, scene, tool), ignore)


def mark_ignored(arm: Arm, ignore: bool) -> Arm:
    """The arm, its motions not proved if keep-outs are ignored; radii that are assumed are named."""
    if not arm.keep_out:
        return arm
    from dataclasses import replace

    from armkin.keep_out.clearance import assumed_radii

    if guessed_radii := assumed_radii(arm):
        names = ", ".join(name for name, _ in guessed_radii)
        output.note(f"no file states the radius of {names}: {guessed_radii[0][1]:.4g} mm are assumed, 2 % of the reach")
    return replace(arm, ignores_keep_out=True) if ignore else arm


def check_port(port: str, arm: Arm, no_scene: bool, *, simulated: bool = False) -> None:
    """Keep the scene of a port's motion, or refuse one without the scene that the port was last used with."""
    from armkin.board.ports import scene_note

    if simulated:
        return
    if arm.scene:
        scene_note.write_scene(port, arm.scene)
    elif no_scene:
        scene_note.forget_scene(port)
    elif last := scene_note.last_scene(port):
        raise UsageError(
            f"{port} was last used with the scene {last}, and this motion has none: give --scene {last}, "
            "or --no-scene if it no longer stands there",
            port=port,
            scene=last,
        )


def check_start(machine: Backend, arm: Arm, no_scene: bool) -> None:
    """Check the scene of an open board's port, as `check_port` does, and tell if the arm stands in a hit."""
    check_port(machine.port.name, arm, no_scene, simulated=machine.port.simulated)
    if machine.position() != "lost":
        tell_start_hit(arm, machine.joints())


def tell_start_hit(arm: Arm, q: Array) -> None:
    """Tell if an arm that moves from joint values (n,) [rad | mm] stands in a hit."""
    if not arm.keep_out:
        return
    from armkin.keep_out.clearance import hits, hits_text

    [(_, hit)] = hits(arm, q[None])
    if hit:
        allowance = "" if arm.ignores_keep_out else ": it may move out, and no farther in"
        output.note(f"the arm stands in a hit: it {hits_text(hit)}{allowance}")


def telling_ignored(plans: Iterable[Planned | None]) -> Iterator[Planned | None]:
    """Plans as they come, each told before it is carried out if it passes through what none before it did."""
    told = set[tuple[str, str]]()
    for plan in plans:
        if plan is not None:
            told |= tell_ignored([plan.trajectory], told)
        yield plan


def tell_ignored(trajectories: Iterable[Trajectory], told: Collection[tuple[str, str]] = ()) -> set[tuple[str, str]]:
    """What motions pass through under `--ignore-keep-out`, pairs that are `told` apart; the names of these pairs."""
    import numpy as np

    from armkin.keep_out.body_pairs import guard
    from armkin.keep_out.clearance import hits_text

    deepest: dict[tuple[str, str], float] = {}
    for trajectory in trajectories:
        if not trajectory.arm.keep_out or not trajectory.arm.ignores_keep_out:
            return set()
        held = guard(trajectory.arm)
        t = np.linspace(0.0, trajectory.duration, _POSTURE_COUNT)
        least_clearances = held.clearances(trajectory.q(t)).min(axis=0, initial=np.inf)
        for k in np.flatnonzero(least_clearances < 0).tolist():
            if (pair := held.pair_names(k)) not in told:
                deepest[pair] = max(deepest.get(pair, 0.0), float(-least_clearances[k]))
    if deepest:
        deepest_first = sorted(deepest.items(), key=lambda item: -item[1])
        words = hits_text(
            [{"body": body, "with": obstacle, "depth_mm": depth} for (body, obstacle), depth in deepest_first]
        )
        output.warn(f"--ignore-keep-out: this motion {words}")
    return set(deepest)
