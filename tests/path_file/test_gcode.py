"""G-code: the path that an independent reading of RS-274 draws, or a refusal with line and word."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.errors import PathFileError, UsageError
from armkin.inverse.tasks.choose_task import task_for
from armkin.model.target_numbers import targets_in
from armkin.motion.tool_path.drawing_frame import place_drawing
from armkin.path_file import gcode, gcode_arcs
from armkin.path_file.drawing import DrawingOptions, Placing
from command_line import run

AS_IT_IS = Placing((0.0, 0.0, 0.0), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))


def rounded_moves(text: str, **options: Any) -> list[tuple[str, Any]]:
    """Kinds and values of the moves, polylines and targets rounded."""
    listed: list[tuple[str, Any]] = []
    for move in gcode.parse_gcode(text.encode(), "t.gcode", AS_IT_IS, DrawingOptions(**options)).moves:
        value = getattr(move, move.kind)
        if move.kind in ("polyline", "point"):
            value = np.round(value, 6).tolist()
        listed.append((move.kind, value))
    return listed


def line_ends(text: str) -> list[list[float]]:
    """Where each line ends, the jump to the first point included."""
    points: list[list[float]] = []
    for kind, value in rounded_moves(text):
        points += [value] if kind == "point" else value if kind == "polyline" else []
    return points


@pytest.mark.parametrize(
    ("text", "points"),
    [
        ("G0 X1 Y2\nG1 X3 F60", [[1, 2, 0], [3, 2, 0]]),
        ("G21 G90 G0 X0\nG91 G1 X1\nX1 Y1", [[0, 0, 0], [1, 0, 0], [2, 1, 0]]),
        ("G20\nG0X1\nG1Y1", [[25.4, 0, 0], [25.4, 25.4, 0]]),
        ("G92 X10\nG0 X10\nG1 X11 Y1", [[0, 0, 0], [1, 1, 0]]),
        ("G10 L2 P2 X5 Y6\nG55 G0 X0 Y0\nG1 X1\nG54 X0", [[5, 6, 0], [6, 6, 0], [0, 6, 0]]),
        ("G0 X7\nG10 L20 P1 X2\nG1 X3", [[7, 0, 0], [8, 0, 0]]),
        ("G52 X3\nG0 X0\nG1 X1\nG52 X0\nX1", [[3, 0, 0], [4, 0, 0], [1, 0, 0]]),
        ("G10 L2 P1 X5\nG0 X0\nG53 G1 X1 Y1\nX0", [[5, 0, 0], [1, 1, 0], [5, 1, 0]]),
        ("%\nN1 G00 X+1. Y-.5 (move)\nN2 G01 X 2 ; end\n%\nG1 X99", [[1, -0.5, 0], [2, -0.5, 0]]),
        ("G1 X1 F60\nG1 X2 M30\nG1 X3", [[1, 0, 0], [2, 0, 0]]),
        ("N3 T0*57\nG1 X5 Y2\nG1 X6", [[5, 2, 0], [6, 2, 0]]),
        ("M201 X500 Y500\nM117 Hello World\ng1 x1\ng1 x2", [[1, 0, 0], [2, 0, 0]]),
        ("G0 X5\nG28 X0\nG0 X1\nG1 X2", [[5, 0, 0], [1, 0, 0], [2, 0, 0]]),
    ],
)
def test_modal_state_is_that_of_rs_274(text: str, points: list[list[float]]) -> None:
    assert line_ends(text) == points


@pytest.mark.parametrize(
    ("text", "via", "to"),
    [
        ("G0 X10 Y0\nG3 X0 Y10 I-10 J0", (10 / math.sqrt(2), 10 / math.sqrt(2), 0), (0, 10, 0)),
        ("G0 X10 Y0\nG2 X0 Y10 I-10 J0", (-10 / math.sqrt(2), -10 / math.sqrt(2), 0), (0, 10, 0)),
        ("G0 X10 Y0\nG3 X0 Y10 R10", (10 / math.sqrt(2), 10 / math.sqrt(2), 0), (0, 10, 0)),
        ("G0 X10 Y0\nG3 X0 Y10 R-10", (10 + 10 / math.sqrt(2), 10 + 10 / math.sqrt(2), 0), (0, 10, 0)),
        ("G18 G0 X10 Z0\nG3 X0 Z-10 I-10 K0", (10 / math.sqrt(2), 0, -10 / math.sqrt(2)), (0, 0, -10)),
        ("G19 G0 Y10 Z0\nG3 Y0 Z10 J-10 K0", (0, 10 / math.sqrt(2), 10 / math.sqrt(2)), (0, 0, 10)),
    ],
)
def test_arcs(text: str, via: tuple[float, ...], to: tuple[float, ...]) -> None:
    kind, value = rounded_moves(text)[-1]
    assert kind == "arc"
    assert value.via == pytest.approx(via, abs=1e-9)
    assert value.to == pytest.approx(to, abs=1e-9)


@pytest.mark.parametrize("plane", [(0, 1, 2), (2, 0, 1), (1, 2, 0)])
def test_a_printed_centre_becomes_as_far_from_both_ends(plane: tuple[int, int, int]) -> None:
    """Three decimals put an arc's end beside its circle, and the misses of arcs one after another would add up.

    Of chords longer than half the radius; of shorter ones the centre would move too far.
    """
    x, y, across = plane
    for seed in range(40):
        rng = np.random.default_rng(seed)
        start, sweep, radius = rng.uniform(-3, 3), rng.uniform(0.7, 3.0), rng.uniform(0.5, 80)
        a, b = np.zeros(3), np.zeros(3)
        a[[x, y]] = radius * np.array([math.cos(start), math.sin(start)])
        b[[x, y]] = radius * np.array([math.cos(start + sweep), math.sin(start + sweep)])
        a, b = a.round(3), b.round(3)
        offsets = {"IJK"[k]: round(-a[k] + rng.uniform(-0.001, 0.001), 3) for k in (x, y)}
        ends = [(float(p[0]), float(p[1]), float(p[2])) for p in (a, b)]
        centre, normal, angle = gcode_arcs.arc("G3", plane, offsets, 1.0, *ends)
        assert math.dist(centre, a) == pytest.approx(math.dist(centre, b), abs=1e-9)
        assert math.dist(centre, (0, 0, 0)) < 0.01
        assert angle == pytest.approx(sweep, abs=0.01)
        assert normal[across] == 1.0


def test_circles_and_helices() -> None:
    kind, value = rounded_moves("G0 X10 Y0\nG2 I-10 Z6 P2")[-1]
    assert (kind, value.turns, value.rise) == ("circle", -2.0, 6.0)
    assert value.centre == [0, 0, 0]
    assert value.normal == [0, 0, 1]


@pytest.mark.parametrize("end", ["0.00001", "-0.00003"])
def test_a_circle_whose_end_is_rounded_is_that_circle(end: str) -> None:
    """Of an inch's rounding: three points, two of them beside each other across the circle, were on another one."""
    kind, value = rounded_moves(f"G0 X10.00004 Y0\nG3 X10 Y{end} I-7 J7")[-1]
    assert kind == "circle"
    assert value.centre == pytest.approx([3, 7, 0], abs=1e-4)
    assert value.turns == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize("comment", ["", "(a move)", " (a) "])
def test_a_checksum_counts_the_comments_before_it(comment: str) -> None:
    line, check = f"N1 G1{comment} X5", 0
    for byte in line.encode():
        check ^= byte
    assert line_ends(f"G0 X1\n{line}*{check} ; and none behind * it") == [[1, 0, 0], [5, 0, 0]]
    with pytest.raises(PathFileError, match=r"t\.gcode:2: its checksum is"):
        line_ends(f"G0 X1\n{line}*{check ^ 1}")


def test_events_and_speeds() -> None:
    text = "G0 X1\nM3 S1000\nG1 X2 F120\nX3 F240\nM4\nG4 P0.5\nG4 S2\nM5\nM0\nG0 X4\nG28"
    file = gcode.parse_gcode(text.encode(), "t.nc", AS_IT_IS, DrawingOptions(grip_by="M3"))
    kinds_and_speeds = [(move.kind, move.tool_speed) for move in file.moves]
    assert kinds_and_speeds == [
        ("point", None), ("grip", None), ("polyline", 2.0), ("polyline", 4.0), ("wait", None), ("wait", None),
        ("grip", None), ("wait", None), ("polyline", None), ("joint", None),
    ]  # fmt: skip
    assert [move.grip for move in file.moves if move.grip] == ["closed", "open"]
    assert [move.wait for move in file.moves if move.wait] == [0.5, 2.0, "enter"]
    fan = gcode.parse_gcode(
        b"G0 X1\nM106 S255\nG1 X2\nM106 S0\nG1 X3\nM107", "t", AS_IT_IS, DrawingOptions(3.0, grip_by="M106")
    )
    assert [move.grip for move in fan.moves if move.grip] == ["closed", "open"]
    assert {move.tool_speed for move in fan.moves if move.polyline} == {3.0}


def test_what_is_ignored_is_noted_once_a_word() -> None:
    text = "M104 S200\nM104 S210\nT0\nG0 X1 E2\nG1 X2\nG10\nG11\nG40 G49 G61 G80 G94\nG64 P0.1\nG91.1\nG29 P1 X2"
    notes = gcode.parse_gcode(text.encode(), "t", AS_IT_IS, DrawingOptions()).notes
    words = [note.split()[0] for note in notes]
    assert words == ["M104", "S", "T", "E", "G10", "G11", "G40", "G49", "G61", "G80", "G94", "G64", "G91.1", "G29"]
    assert notes[0] == "M104 is ignored (line 1, and 1 more)"


def test_s_is_noted_where_nothing_takes_it() -> None:
    def words(text: str, grip_by: str | None = None) -> list[str]:
        notes = gcode.parse_gcode(
            f"{text}\nG0 X1\nG1 X2 F60".encode(), "t", AS_IT_IS, DrawingOptions(grip_by=grip_by)
        ).notes
        return [note.split()[0] for note in notes]

    assert words("S100") == ["S"]
    assert words("M3 S100", "M3") == ["S"]
    assert words("M106 S100", "M106") == words("G4 S1") == []
    assert words("M106 S100") == ["M106", "S"]


def test_the_number_of_a_cam_program_is_noted_and_a_macro_of_that_letter_refused() -> None:
    file = gcode.parse_gcode(b"%\nO1001 (pocket)\nG0 X1\nG1 X2 F60\nM30\n%", "t", AS_IT_IS, DrawingOptions())
    assert file.notes == ("O is ignored (line 2)",)
    with pytest.raises(PathFileError, match="t:1: 'SUB' is no word"):
        gcode.parse_gcode(b"O100 SUB\nG0 X1\nG1 X2 F60", "t", AS_IT_IS, DrawingOptions())


def test_a_program_has_as_many_points_as_any_path() -> None:
    """A million lines took minutes and gigabytes, as no other kind of file may."""
    with pytest.raises(PathFileError, match=r"t\.gcode:120003: is behind 120000 points, and a path has no more"):
        line_ends("G1 X1\nX2\n" * 65_000)


def test_a_cycle_that_ends_leaves_the_motion_as_it_was() -> None:
    with_cycle, without = (
        gcode.parse_gcode(f"G0 X1\nG1 X2 F60{word}\nX3".encode(), "t", AS_IT_IS, DrawingOptions())
        for word in ("\nG80", "")
    )
    assert with_cycle.moves == without.moves
    assert gcode.parse_gcode(b"G80 G0 X1\nG1 X2 F60", "t", AS_IT_IS, DrawingOptions()).notes == (
        "G80 is ignored (line 1)",
    )


def test_home_takes_the_flags_that_slicers_give_it() -> None:
    for line in ("G28 W ; home all without mesh bed level", "G28 X Y", "G28 X0 Y0", "N1 G28 O"):
        file = gcode.parse_gcode(f"{line}\nG0 X1\nG1 X2 F60".encode(), "t", AS_IT_IS, DrawingOptions())
        assert [move.kind for move in file.moves] == ["joint", "point", "polyline"]
    with pytest.raises(PathFileError, match="t:1: 'X' is no word"):
        gcode.parse_gcode(b"G1 X", "t", AS_IT_IS, DrawingOptions())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("G0 X1\nG5 X2", "t.gcode:2: G5 is not known"),
        ("G43 H1", "t.gcode:1: G43 is not known"),
        ("G0 X1\nG1 X#5", "t.gcode:2: 'X#5': expressions, parameters and macros"),
        ("#1=5", "expressions, parameters and macros"),
        ("START_PRINT BED=60", "'START_PRINT' is no word of G-code"),
        ("G0 X1\nX1 X2", "X stands twice"),
        ("G0 G1 X1", "G0 and G1 stand on one line"),
        ("X1", "neither G0, G1, G2 nor G3"),
        ("G0 X1\nG2 X2", "G2 needs I, J or R"),
        ("G0 X1\nG2 X2 Y2 R0.1", "shorter than half of its chord"),
        ("G0 X1\nG2 X1 R5", "begins where it ends"),
        ("G0 X10\nG2 X0 Y12 I-10", "off its circle"),
        ("G0 X10\nG2 X0 Y10 I-10 K2", "G2 has K in the plane of X and Y"),
        ("N1 G0 X1*3", "the line was damaged"),
        ("G0 X1 (open", "has no partner"),
        ("G1 X1 F0\nG1 X2", "F0 never arrives"),
        ("G10 L1 P1 X1", "G10 L1 is not known"),
        ("G0 X1 H5", "H belongs to no word"),
        ("G0 X1\nG1 X9999999", "farther away than"),
        ("G0 X1\n(nothing)", "t.gcode:2: draws nothing up to here: it needs two places"),
        ("", "t.gcode:1: draws nothing"),
        ("GG0 X1", "is no word of G-code"),
        ("G0 X1\nG1 X1..5", "is no word of G-code"),
        ("G4 P-1", "G4 waits 0 to 86400"),
        ("/G0 X1", "a machine's switch"),
    ],
)
def test_what_is_refused_names_line_and_word(text: str, words: str) -> None:
    with pytest.raises(PathFileError, match=words):
        rounded_moves(text)


def test_the_plan_draws_what_the_program_says(tmp_path: Path) -> None:
    file = tmp_path / "d.gcode"
    file.write_text("G21 G90\nG0 X0 Y0 Z2\nG1 Z0 F600\nX40 F3000\nY20\nG3 X30 Y30 I-10 J0\nG1 X0\nY0\nM2\n")
    plan = run("path", "three_dof", file, "--at", "300,0,250", "--json").json
    assert plan["length_mm"] == pytest.approx(2 + 40 + 20 + 5 * math.pi + 30 + 30, abs=0.5)
    assert plan["deviation_mm"] <= 0.05
    refused = run("path", "three_dof", file)
    assert refused.code == 2
    assert "--at X,Y,Z" in refused.err
    assert "--feed belongs to G-code" in run("path", "three_dof", "--via", "390,80,300", "--feed", "3").err


@pytest.mark.parametrize("robot", ["irb120", "wx250s", "labvolt_5150", "xarm6", "so101"])
def test_the_tool_points_against_the_drawing(robot: str) -> None:
    arm = armkin.load(robot)
    place = place_drawing(arm, [300, 0, 50])
    definition = task_for(arm, None)
    target = targets_in(definition.labels, [[*(0.25 * arm.reach, 0.0, 0.2 * arm.reach), *place.orientation]])
    solutions = armkin.ik(arm, target[0])
    assert solutions.valid.any()
    assert armkin.fk(arm, solutions.q[solutions.valid][0])[:3, 2] == pytest.approx([0, 0, -1], abs=1e-6)


def test_a_tilt_that_a_pitch_cannot_hold_is_refused() -> None:
    with pytest.raises(UsageError, match="without a tilt"):
        place_drawing(armkin.load("labvolt_5150"), [300, 0, 50, 20, 0, 0], task="xyz_pitch_roll")


def test_lines_that_are_read_in_one_step_are_read_as_word_by_word(monkeypatch: pytest.MonkeyPatch) -> None:
    """Most lines of a slicer match one pattern; all modes, units and offsets hold for them, too."""
    rng = np.random.default_rng(4)
    words = ["G0 ", "G1 ", "g1", "G01 ", "", "N5 G1 ", "G2 I1 J1 ", "G21\n", "G20\nG1 ", "G91\n", "G90\n", "(a) G1 "]
    words += ["G92 X1 Y2\nG1 ", "G55\nG0 ", "G10 L2 P2 X3\n", "G52 Z1\n", "G28\nG0 ", "G53 G0 ", "M3 S5\nG1 "]
    programs = ["G21 G90 F600\nG0 X0 Y0"]
    for _ in range(100):
        lines = ["G0 X1 Y1 F900"]
        for _ in range(8):
            line = str(rng.choice(words))
            for letter in "XYZEF":
                if rng.random() < 0.5:
                    sign = "" if letter == "F" else str(rng.choice(["", "-", "+"]))
                    line += f"{letter}{sign}{rng.choice(['3', '.5', '2.', '1.25', '00.1'])}{rng.choice(['', ' '])}"
            lines.append(line)
        programs.append("\n".join(lines))

    def read(text: str) -> object:
        try:
            file = gcode.parse_gcode(text.encode(), "t.gcode", AS_IT_IS, DrawingOptions())
        except PathFileError as error:
            return str(error)
        return [move.model_dump() for move in file.moves], file.notes

    quick = [read(text) for text in programs]
    assert sum(not isinstance(one, str) for one in quick) > 20
    monkeypatch.setattr(gcode._Program, "_plain_line", lambda *_: False)
    assert [read(text) for text in programs] == quick


def test_an_arc_without_radius_draws_nothing() -> None:
    """`G2 X0 Y0 I0 J0` where the tool stands: an internal error."""
    arm = armkin.load("three_dof")

    def plan_length(text: str) -> float:
        return armkin.path(
            arm, gcode.parse_gcode(text.encode(), "t.gcode", place_drawing(arm, [330, -10, 250]), DrawingOptions())
        ).length

    with pytest.raises(UsageError, match=r"t\.gcode:1: .*its points are all the same"):
        plan_length("G0 X0 Y0\nG2 X0 Y0 I0 J0")
    assert plan_length("G0 X0 Y0\nG2 X0 Y0 I0 J0\nG1 X5\nG2 X5 Y0 I0 J0\nG1 X9") == pytest.approx(9)
