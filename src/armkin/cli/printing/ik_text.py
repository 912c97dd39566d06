"""The answer of `armkin ik` as text: a table of branches, and what it does not show."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armkin.cli.printing import render
from armkin.cli.printing.render import fixed_text
from armkin.model.target_numbers import label_units

if TYPE_CHECKING:
    from armkin.cli.answers import Branch, Ik
    from armkin.model.arm import Arm


def text(arm: Arm, answer: Ik) -> str:
    """The answer for people: a table of branches, or the nearest pose."""
    headings = render.joint_headings(arm)
    goal = render.label_values(answer["target_labels"], answer["target"], label_units(answer["target_labels"]))
    rows = [["", "branch", *headings, "motion", ""]]
    for i, branch in enumerate(answer["branches"]):
        joints_outside = ", ".join(violation["joint"] for violation in branch["violations"])
        mark = "*" if i == answer["best"] and len(answer["branches"]) > 1 else ""
        notes = [
            _family_text(branch),
            _turned_text(branch["residual_deg"]),
            f"outside limits: {joints_outside}" if joints_outside else "",
            render.hits_in_words(branch),
        ]
        note = "; ".join(filter(None, notes))
        rows.append([mark, branch["name"], *map(fixed_text, branch["joints"]), fixed_text(branch["motion"]), note])
        for copy in branch.get("turns", ())[1:]:
            rows.append(["", "  or", *map(fixed_text, copy), "", ""])
    nearest = answer["closest"]
    if nearest and not answer["branches_within_limits"]:
        miss = f"{fixed_text(nearest['distance_mm'])} mm away"
        if turn_text := _turned_text(nearest["angle_deg"]):
            miss += f", {turn_text}"
        rows.append(["", "closest", *map(fixed_text, nearest["joints"]), "", miss])
    last_column = len(headings) + 3
    table = f"{render.table(rows, left_aligned=(0, 1, last_column), indent='')}\n\n" if len(rows) > 1 else ""
    return f"{arm.name}: {goal}\n\n{table}{_summary(answer)}\n"


def _family_text(branch: Branch) -> str:
    """Along which values of the redundant joint a branch moves."""
    if "family" not in branch:
        return ""
    low, high = map(fixed_text, branch["family"]["interval"])
    return f"{branch['family']['joint']} from {low} to {high}"


def _turned_text(angle_deg: float) -> str:
    """How far a rotation is off the target's [deg], in words; "" where it is no more than rounding."""
    return f"turned by {fixed_text(angle_deg)} deg" if angle_deg > 1e-6 else ""


def _summary(answer: Ik) -> str:
    """What the table does not show: how many branches there are, and by which method."""
    count, legal_count = answer["branch_count"], answer["branches_within_limits"]
    text = f"{answer['status']}: {count} branch{'es' * (count != 1)}, {legal_count} within limits"
    if "branches_free" in answer:
        text += f", {answer['branches_free']} free"
    if answer["free_joints"]:
        text += f"; free: {', '.join(answer['free_joints'])}"
    if count > len(answer["branches"]):
        text += " (--all-branches lists all)"
    completeness = "no real branch is missing" if answer["complete"] else "there may be more branches"
    return f"{text}\n" + render.wrap_text(f"solved as {answer['method']} ({answer['why']}): {completeness}")
