"""`armkin info` for people: the tables as papers print them, from the same object as the JSON."""

from collections.abc import Mapping, Sequence
from typing import Any

from armkin.cli.printing.render import short_text, table, wrap_text


def arm_summary(answer: Mapping[str, Any]) -> str:
    """The whole summary."""
    joints = answer["joints"]
    kinds = "".join("P" if joint["type"] == "prismatic" else "R" for joint in joints)
    form = {
        "standard": "standard DH: Rz(theta) Tz(d) Tx(a) Rx(alpha)",
        "modified": "modified DH (Craig): Rx(alpha) Tx(a) Rz(theta) Tz(d), alpha and a of the link before",
        "screws": "screw axes at the zero pose",
    }[answer["convention"]]
    head = [f"{answer['robot']}: {len(joints)} joint{'s' * (len(joints) != 1)} ({kinds}), {form}"]
    if answer["description"]:
        head.append(wrap_text(answer["description"]))
    if answer["source"]:
        head.append(wrap_text(f"Source: {answer['source']}"))
    parts = [
        "\n".join(head),
        _screw_table(joints) if answer["convention"] == "screws" else _dh_table(joints),
        _frames_text(answer),
        _ranges_table(answer),
        _poses_text(answer),
        _steppers_table(answer),
        _servos_table(answer),
        _bus_servos(answer),
        _motor_matrix(answer),
        _hardware_text(answer),
        _solver_text(answer),
        _keep_outs(answer),
        _lacks_text(answer["lacks"], answer["lines_to_add"]),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _dh_table(joints: Sequence[dict[str, Any]]) -> str:
    """Joints with their DH rows, the joint's own variable in its place."""
    rows = [["joint", "alpha/deg", "a/mm", "d/mm", "theta/deg"]]
    for joint in joints:
        dh = joint["dh"]
        d, theta = short_text(dh["d"]), short_text(dh["theta"])
        if joint["type"] == "prismatic":
            d = _variable_text(joint, dh["d"])
        else:
            theta = _variable_text(joint, dh["theta"])
        rows.append([joint["name"], short_text(dh["alpha"]), short_text(dh["a"]), d, theta])
    return table(rows)


def _variable_text(joint: dict[str, Any], constant: float) -> str:
    """The joint's variable with its sign and the constant beside it: ``-q2 + 90``."""
    variable = joint["name"] if joint["sign"] > 0 else f"-{joint['name']}"
    if not constant:
        return variable
    return f"{variable} {'+' if constant > 0 else '-'} {short_text(abs(constant))}"


def _screw_table(joints: Sequence[dict[str, Any]]) -> str:
    """Joints with their screws: direction, and a point on the axis or the velocity."""
    rows = [["joint", "w", "v or point q/mm"]]
    for joint in joints:
        screw = joint["screw"]
        place_text = f"q = {_triple_text(screw['q'])}" if screw["v"] is None else f"v = {_triple_text(screw['v'])}"
        sign = "" if joint["sign"] > 0 else "  (counts against its axis)"
        rows.append([joint["name"], _triple_text(screw["w"]), place_text + sign])
    return table(rows, left_aligned=(0, 1, 2))


def _triple_text(values: Sequence[float]) -> str:
    return f"({', '.join(map(short_text, values))})"


def _frames_text(answer: Mapping[str, Any]) -> str:
    """Base, tool and zero pose, where they are not the identity."""
    lines = []
    for key in ("base", "tool", "zero_pose"):
        pose = answer[key]
        if pose is not None and (any(pose["xyz"]) or any(pose["rpy"]) or key == "zero_pose"):
            name = key.replace("_", " ")
            lines.append(f"  {name:9}  xyz {_triple_text(pose['xyz'])} mm, rpy {_triple_text(pose['rpy'])} deg")
    return "\n".join(lines)


def _ranges_table(answer: Mapping[str, Any]) -> str:
    """Joints with their limits, home, speeds and homing; without the last column where none homes."""
    rows = [["joint", "limits", "home", "max speed", "max accel", "", "homing"]]
    for joint, unit in zip(answer["joints"], answer["joint_units"], strict=True):
        limits = joint["limits"]
        homing = joint["homing"]
        rows.append(
            [
                joint["name"],
                "unlimited" if limits is None else f"{short_text(limits[0])} .. {short_text(limits[1])}",
                short_text(joint["home"]),
                "-" if joint["max_speed"] is None else f"{short_text(joint['max_speed'])}/s",
                "-" if joint["max_accel"] is None else f"{short_text(joint['max_accel'])}/s2",
                unit,
                "" if homing is None else f"switch {homing['switch']} at {short_text(homing['at'])}",
            ]
        )
    if not any(row[-1] for row in rows[1:]):
        rows = [row[:-1] for row in rows]
    return table(rows, left_aligned=(0, 5, 6))


def _poses_text(answer: Mapping[str, Any]) -> str:
    """Named poses; home alone stands in the table of ranges."""
    if len(answer["poses"]) == 1:
        return ""
    rows = [["pose", *(joint["name"] for joint in answer["joints"])]]
    rows += [[name, *map(short_text, values)] for name, values in answer["poses"].items()]
    return table(rows)


def _steppers_table(answer: Mapping[str, Any]) -> str:
    """How the steppers' pulses per turn come about; empty where there is none."""
    heading = ["stepper", "axis", "full steps", "x micro", "x gear", "x pulley", "= pulses/turn", "one pulse"]
    rows = [[*heading, "", ""]]
    for motor in answer["motors"]:
        if motor["kind"] == "stepper":
            rows.append(
                [
                    motor["name"],
                    motor.get("axis", "-"),
                    str(motor["full_steps"]),
                    str(motor["microsteps"]),
                    short_text(motor["gear"]),
                    short_text(motor["pulley"]),
                    short_text(motor["pulses_per_turn"]),
                    f"{motor['unit_per_pulse']:.7g}",
                    motor["unit"],
                    _remarks(motor),
                ]
            )
    return table(rows, left_aligned=(0, 1, 8, 9)) if len(rows) > 1 else ""


def _remarks(motor: dict[str, Any]) -> str:
    lead = [f"lead {short_text(motor['lead'])} mm"] if "lead" in motor else []
    return ", ".join(lead + ["inverted"] * motor["invert"])


def _servos_table(answer: Mapping[str, Any]) -> str:
    """The servos' travel and pulses; empty where there is none."""
    rows = [["servo", "axis", "travel/deg", "pulse/us", "zero/deg", "us/deg", ""]]
    for motor in answer["motors"]:
        if motor["kind"] == "servo":
            rows.append(
                [
                    motor["name"],
                    motor.get("axis", "-"),
                    " .. ".join(map(short_text, motor["travel"])),
                    " .. ".join(map(str, motor["pulse_us"])),
                    short_text(motor["zero"]),
                    short_text(motor["pulses_per_unit"]),
                    "inverted" if motor["invert"] else "",
                ]
            )
    return table(rows, left_aligned=(0, 1, 6)) if len(rows) > 1 else ""


def _bus_servos(answer: Mapping[str, Any]) -> str:
    rows = [["bus servo", "id", "counts/turn", "zero/count", "counts/deg", ""]]
    for motor in answer["motors"]:
        if motor["kind"] == "bus":
            figures = (short_text(motor["zero"]), short_text(motor["pulses_per_unit"]))
            direction = "inverted" if motor["invert"] else ""
            rows.append([motor["name"], str(motor["id"]), str(motor["counts"]), *figures, direction])
    return table(rows, left_aligned=(0, 5)) if len(rows) > 1 else ""


def _motor_matrix(answer: Mapping[str, Any]) -> str:
    """Motors as sums of joints, where they are not one to one."""
    if answer["one_to_one"]:
        return ""
    lines = []
    for motor in answer["motors"]:
        total = ""
        for name, weight in motor["joints"].items():
            weight_text = "" if abs(weight) == 1 else f"{short_text(abs(weight))} "
            sign = "-" if weight < 0 else "+"
            total += f" {sign} {weight_text}{name}" if total else f"{sign}{weight_text}{name}".removeprefix("+")
        lines.append(f"  motor {motor['name']} = {total}")
    return "\n".join(lines)


def _hardware_text(answer: Mapping[str, Any]) -> str:
    lines = []
    if gripper := answer["gripper"]:
        axis_text = f" on {gripper['axis']}" if "axis" in gripper else ""
        ends = f"open {short_text(gripper['open'])}, closed {short_text(gripper['closed'])}"
        lines.append(f"  gripper  {gripper['kind']}{axis_text}, {ends}")
    if board := answer["board"]:
        lines.append("  board    " + ", ".join(str(value) for value in board.values()))
    return "\n".join(lines)


def _solver_text(answer: Mapping[str, Any]) -> str:
    """Reach, task and solver of the arm, or why ik refuses it."""
    lines = [f"  reach    at most {answer['reach_mm']:.4f} mm from the first joint"]
    if answer["task"] is not None:
        pairs = zip(answer["target_labels"], answer["target_units"], strict=True)
        target_text = " ".join(f"{label}/{unit}" if unit else label for label, unit in pairs)
        offset = f", pitch offset {short_text(answer['pitch_offset'])} deg" if answer["pitch_offset"] else ""
        lines.append(f"  task     {answer['task']}: target {target_text}{offset}")
    if solver := answer["solver"]:
        completeness = "no real branch is missing" if solver["complete"] else "there may be more branches"
        lines.append(wrap_text(f"{solver['method']} ({solver['why']}): {completeness}", "  ik       ", " " * 11))
    if answer["ik_refuses"]:
        lines.append(wrap_text(answer["ik_refuses"], "  ik       ", " " * 11))
    return "\n".join(lines)


def _keep_outs(answer: Mapping[str, Any]) -> str:
    """Bodies and what they keep out of, where there are keep-outs."""
    if "bodies" not in answer:
        return ""
    rows = [["body", "radius/mm", ""]]
    rows += [[b["name"], short_text(b["radius_mm"]), "assumed" if b["assumed"] else ""] for b in answer["bodies"]]
    clearance_text = f", {short_text(answer['clearance_mm'])} mm away" if answer["clearance_mm"] else ""
    lines = [wrap_text(f"{', '.join(answer['keep_out'])}{clearance_text}", "  keep out ", " " * 11)]
    if answer["pairs_left_out"]:
        words = ", ".join(" and ".join(pair) for pair in answer["pairs_left_out"])
        lines.append(wrap_text(f"{words}: they overlap in every posture", "  left out ", " " * 11))
    if answer["hits_at_home"]:
        from armkin.keep_out.clearance import hits_text

        lines.append(wrap_text(hits_text(answer["hits_at_home"]), "  at home  ", " " * 11))
    return "\n".join([table(rows, left_aligned=(0, 2)), "", *lines])


def _lacks_text(lacks: dict[str, list[str]], add: list[str]) -> str:
    """What the commands that move the arm still need; what needs nothing is said to be ready."""
    send = [words for words in lacks["send"] if words not in lacks["simulate"]]
    rows = {"pulses": lacks["pulses"], "simulate": lacks["simulate"], "send": send}
    rows["home"] = [words for words in lacks["home"] if words not in lacks["send"]]
    builds_on = {"send": "simulate", "home": "send"}
    lines = []
    for name, words in rows.items():
        builds_on_words = ["the same"] if name in builds_on and lacks[builds_on[name]] else []
        text = f"not yet: {'; '.join(builds_on_words + words)}" if builds_on_words or words else "ready"
        lines.append(wrap_text(text, f"  {name:9}", " " * 11))
    if add:
        lines += ["", "  to add, with your arm's figures, for send:", *(f"    {line}" for line in add)]
    return "\n".join(lines)
