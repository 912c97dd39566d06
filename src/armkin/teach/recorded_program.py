"""A program of recorded moves with the keys of a path file, and undo."""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from armkin import path_file
from armkin.errors import UsageError
from armkin.forward import fk
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.task import targets_of
from armkin.model import units
from armkin.model.target_numbers import targets_out
from armkin.motion.tool_path.path_numbers import check_numbers
from armkin.path_file import PathFile
from armkin.path_file.path_keys import KINDS
from armkin.robot_file.robot_file_text import flow_text
from armkin.teach import request_checks

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.plan.path_plan import PathPlan
    from armkin.path_file import PathFile

MAX_MOVES = 2000  # most moves of a program
_MAX_UNDO = 100  # most edits that can be undone
_DIGITS = 6  # decimals of recorded numbers: a millionth of a degree or mm
_SETTINGS = ("blend", "speed", "tool_speed", "tolerance")
_NAMED_STEP = re.compile(r"^\s*- .*?#\s*(?P<name>.+?)\s*$")


class Program:
    """The moves of one arm, with undo and redo of edits."""

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self.head: dict[str, Any] = {}  # start, task, blend, speed, tool_speed, tolerance: as in a path file
        self.moves: list[dict[str, Any]] = []  # each as in a path file
        self.names: list[str] = []  # names of the moves, "" for none
        self.via: list[float] | None = None  # the middle point of an arc that is being recorded
        self._undo_states: list[tuple[Any, ...]] = []
        self._redo_states: list[tuple[Any, ...]] = []

    def state(self) -> dict[str, Any]:
        """The state for the pages, as JSON."""
        return {
            "moves": [
                {"kind": _move_kind(move), "name": name, "said": _figures_text(move), "blend": move.get("blend")}
                for move, name in zip(self.moves, self.names, strict=True)
            ],
            "blend": self.head.get("blend", 0),
            "speed": self.head.get("speed", 100),
            "tool_speed": self.head.get("tool_speed"),
            "via": self.via is not None,
            "undo": len(self._undo_states),
            "redo": len(self._redo_states),
        }

    def edit(self, fields: Mapping[str, Any]) -> None:
        """Carry out the edit that `do` names. Raises UsageError, without a change, for an invalid one."""
        edit_name = request_checks.text_field(fields, "do", 20)
        if edit_name in ("undo", "redo"):
            states, opposite_states = (
                (self._undo_states, self._redo_states)
                if edit_name == "undo"
                else (self._redo_states, self._undo_states)
            )
            if states:
                opposite_states.append(self._snapshot())
                self._restore(states.pop())
            return
        edits = {
            "record": self._record,
            "via": self._set_via,
            "rename": self._rename,
            "reorder": self._reorder,
            "delete": self._delete,
            "clear": self._clear,
            "blend": self._set_blend,
            "settings": self._set_head,
        }
        if edit_name not in edits:
            raise UsageError(f"do: '{edit_name}' is none of {', '.join((*edits, 'undo', 'redo'))}")
        snapshot = self._snapshot()
        try:
            edits[edit_name](fields)
            if self.moves:
                self.file()
        except Exception:
            self._restore(snapshot)
            raise
        self._undo_states = [*self._undo_states[-_MAX_UNDO + 1 :], snapshot]
        self._redo_states = []

    def document(self) -> dict[str, Any]:
        """The program as the data of a path file."""
        return {"robot": self.arm.name, **self.head, "moves": self.moves}

    def file(self) -> PathFile:
        """The program as a path file's model. Raises PathFileError if it is invalid."""
        return path_file.validate_path(self.document())

    def text(self) -> str:
        """The program as the text of a path file; names are comments."""
        lines = [f"robot: {self.arm.name}"]
        keys = [key for key in PathFile.model_fields if key in self.head]
        lines += [f"{key}: {flow_text(self.head[key])}" for key in keys]
        lines.append("moves:")
        for move, name in zip(self.moves, self.names, strict=True):
            entries = [f"{key}: {flow_text(value)}" for key, value in move.items()]
            move_text = entries[0] if len(entries) == 1 else "{" + ", ".join(entries) + "}"
            lines.append(f"  - {move_text}" + (f"  # {name}" if name else ""))
        return "\n".join(lines) + "\n"

    def load(self, text: str, name: str) -> None:
        """Replace the program by a path file's text. Raises PathFileError with the line, without a change."""
        file = path_file.parse_path_file(text, name)
        path_file.check_robot(file, self.arm.name, self.arm.path)
        check_numbers(self.arm, file)
        document = file.model_dump(exclude_unset=True, exclude_none=True)
        document.pop("robot", None)
        moves = document.pop("moves")
        if len(moves) > MAX_MOVES:
            raise UsageError(f"{name} has {len(moves)} moves; the page takes {MAX_MOVES}")
        self._undo_states = [*self._undo_states[-_MAX_UNDO + 1 :], self._snapshot()]
        self._redo_states = []
        self.head, self.moves, self.via = document, moves, None
        items = [line for line in text.splitlines() if line.lstrip().startswith("- ")]
        matches = [_NAMED_STEP.match(line) for line in items]
        names = [match["name"][:60] if match else "" for match in matches]
        self.names = names if len(names) == len(moves) else [""] * len(moves)

    def plan(self, start: Array | None, speed: float = 1.0) -> PathPlan:
        """The plan; start: (n,) [rad | mm] the arm's position, None: home; speed: a fraction."""
        if not self.moves:
            raise UsageError("the program has no moves: record one")
        from armkin.motion.path_planner.path import path

        return path(self.arm, self.file(), start=start, speed=speed)

    def copied(self) -> Program:
        """A copy of head and moves, to be planned while this one is edited."""
        part = Program(self.arm)
        part.head, part.moves, part.names = copy.deepcopy((self.head, self.moves, self.names))
        return part

    def end_of(self, index: int, start: Array | None) -> Array:
        """Joint values where a move ends: (n,) [rad | mm]."""
        part = Program(self.arm)
        part.head, part.moves = self.head, self.moves[: index + 1]
        plan = part.plan(start)
        return plan.q(plan.duration)

    # Edits

    def _record(self, fields: Mapping[str, Any]) -> None:
        """Add a move to the pose q at the end, or behind the move `index`."""
        if len(self.moves) >= MAX_MOVES:
            raise UsageError(f"a program has at most {MAX_MOVES} moves")
        kind = request_checks.text_field(fields, "kind", 20)
        index = (
            len(self.moves)
            if fields.get("index") is None
            else request_checks.index_field(fields, "index", len(self.moves)) + 1
        )
        self.moves.insert(index, self._make_move(kind, fields))
        self.names.insert(index, "")

    def _make_move(self, kind: str, fields: Mapping[str, Any]) -> dict[str, Any]:
        """A move of a path file [mm, deg] from a page's fields. Raises UsageError for an invalid one."""
        if kind == "wait":
            return {"wait": request_checks.number_field(fields, "seconds", 0, 3600)}
        if kind == "grip":
            value = request_checks.text_field(fields, "value", 10)
            if value not in ("open", "closed"):
                raise UsageError("value: expected open or closed")
            return {"grip": value}
        values = request_checks.number_list_field(fields, "q", self.arm.n)
        if kind == "joint":
            return {"joint": _round_values(values)}
        target = self._target_of(values)
        if kind == "line":
            return {"line": target}
        if kind == "arc":
            if self.via is None:
                raise UsageError("an arc needs a point on its way: set it first")
            via, self.via = self.via, None
            return {"arc": {"via": via, "to": target}}
        raise UsageError(f"kind: '{kind}' is none of joint, line, arc, wait, grip")

    def _target_of(self, values: Sequence[float]) -> list[float]:
        q = units.joints_in(self.arm, values)
        task = task_for(self.arm, self.head.get("task"))
        [target] = targets_out(task.labels, targets_of(task, fk(self.arm, q)[None], q[None]))
        return _round_values(target)

    def _set_via(self, fields: Mapping[str, Any]) -> None:
        q = units.joints_in(self.arm, request_checks.number_list_field(fields, "q", self.arm.n))
        self.via = _round_values(fk(self.arm, q)[:3, 3].tolist())

    def _rename(self, fields: Mapping[str, Any]) -> None:
        name = request_checks.text_field(fields, "name", 60)  # a YAML comment may only have printable characters
        printable = "".join(char if char.isprintable() else " " for char in name.replace("#", ""))
        self.names[self._move_index(fields)] = " ".join(printable.split())

    def _reorder(self, fields: Mapping[str, Any]) -> None:
        index, new_index = self._move_index(fields), request_checks.index_field(fields, "to", len(self.moves))
        self.moves.insert(new_index, self.moves.pop(index))
        self.names.insert(new_index, self.names.pop(index))

    def _delete(self, fields: Mapping[str, Any]) -> None:
        index = self._move_index(fields)
        del self.moves[index], self.names[index]

    def _clear(self, fields: Mapping[str, Any]) -> None:
        self.moves, self.names = [], []
        self.head, self.via = {}, None

    def _set_blend(self, fields: Mapping[str, Any]) -> None:
        """Set a move's own blend radius; null: use the program's."""
        move = self.moves[self._move_index(fields)]
        if fields.get("blend") is None:
            move.pop("blend", None)
        else:
            move["blend"] = request_checks.number_field(fields, "blend", 0, 1e6)

    def _set_head(self, fields: Mapping[str, Any]) -> None:
        for key in _SETTINGS:
            if key in fields:
                if fields[key] is None:
                    self.head.pop(key, None)
                else:
                    self.head[key] = request_checks.number_field(fields, key, 0, 1e6)

    def _move_index(self, fields: Mapping[str, Any]) -> int:
        if not self.moves:
            raise UsageError("the program has no moves")
        return request_checks.index_field(fields, "index", len(self.moves))

    def _snapshot(self) -> tuple[Any, ...]:
        return copy.deepcopy((self.head, self.moves, self.names, self.via))

    def _restore(self, state: tuple[Any, ...]) -> None:
        self.head, self.moves, self.names, self.via = state


def _move_kind(move: Mapping[str, Any]) -> str:
    return next(kind for kind in KINDS if kind in move)


def _figures_text(move: Mapping[str, Any]) -> str:
    """A move's numbers as text."""
    value = move[_move_kind(move)]
    if isinstance(value, dict) and "to" in value:
        return ", ".join(f"{x:.1f}" for x in value["to"])
    if isinstance(value, list) and value and isinstance(value[0], int | float):
        return ", ".join(f"{x:.1f}" for x in value)
    return str(value)


def _round_values(values: Sequence[float]) -> list[float]:
    return [round(float(value), _DIGITS) + 0.0 for value in values]
