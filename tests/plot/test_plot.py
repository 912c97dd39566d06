"""Pictures: what is drawn, in true proportion, the same every time; and life without matplotlib."""

import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import armkin
from armkin.errors import FileError, MissingExtraError, UsageError
from armkin.forward import fk
from armkin.model.arm import from_links
from armkin.plot import plot_poses, plot_workspace
from armkin.plot.canvas import space_axes, tick_step
from armkin.reachability import Workspace, workspace
from armkin.robot_file import catalogue
from armkin.view.skeleton import skeleton
from command_line import ROOT

THREE_DOF = armkin.load(ROOT / "robots/three_dof.yaml")
PLANAR = armkin.load(ROOT / "robots/planar_3dof.yaml")
SCARA = armkin.load(ROOT / "tests/robots/scara_steppers.yaml")
POSE = np.deg2rad([-30, 5, -5])


@pytest.fixture
def saved_figures(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The figures that were saved."""
    figures: list[Any] = []
    save = Figure.savefig

    def keep(self: Figure, *arguments: Any, **options: Any) -> None:
        figures.append(self)
        save(self, *arguments, **options)

    monkeypatch.setattr(Figure, "savefig", keep)
    return figures


@pytest.fixture(scope="module")
def survey_of_arm() -> Workspace:
    return workspace(THREE_DOF, 40_000, measures=["manipulability", "step_error"], keep=40_000)


def size_of_png(path: Path) -> tuple[int, int]:
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert data[-8:-4] == b"IEND"
    width, height = struct.unpack(">II", data[16:24])
    return width, height


def millimetres_per_millimetre(axes: Any) -> np.ndarray:
    """How long a millimetre of each axis is in the picture's box, relative to x."""
    limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    length = np.asarray(axes._box_aspect) / np.ptp(limits, axis=1)
    return np.asarray(length / length[0])


def texts_of(figure: Any) -> list[str]:
    words = [text.get_text() for text in figure.texts]
    for axes in figure.axes:
        legend = axes.get_legend()
        words += [] if legend is None else [text.get_text() for text in legend.get_texts()]
    return words


@pytest.mark.parametrize("q", [POSE, [0, np.pi / 2, -np.pi / 2], [2.0, 0.3, 1.0]])
def test_skeleton_ends_at_the_tip_and_goes_through_the_joints(q: np.ndarray) -> None:
    bone = skeleton(THREE_DOF, q)
    assert bone.tip == pytest.approx(fk(THREE_DOF, q)[:3, 3], abs=1e-9)
    assert bone.joints[:2].tolist() == [[0, 0, 0], [0, 0, 170]]
    for joint in bone.joints:
        assert np.linalg.norm(bone.path - joint, axis=1).min() < 1e-9
    # Links lead along their joint's axis first, then straight on: 170, then -10 and 197, then 258.
    lengths = np.linalg.norm(np.diff(bone.path, axis=0), axis=1)
    assert lengths == pytest.approx([170, 10, 197, 258])


def test_skeleton_of_a_slide() -> None:
    q = SCARA.home.copy()
    [k] = np.flatnonzero(SCARA.prismatic)
    q[k] += 25
    [slide] = skeleton(SCARA, q).slides
    assert np.linalg.norm(slide[1] - slide[0]) == pytest.approx(abs(q[k]))
    assert skeleton(SCARA, q).tip == pytest.approx(fk(SCARA, q)[:3, 3], abs=1e-9)


def test_single_pose(tmp_path: Path, saved_figures: list[Any]) -> None:
    picture = tmp_path / "arm.png"
    plot_poses(THREE_DOF, POSE, str(picture), title="three_dof")
    width, height = size_of_png(picture)
    assert width >= 1200
    assert height >= 800
    [figure] = saved_figures
    [axes] = figure.axes
    assert millimetres_per_millimetre(axes) == pytest.approx([1, 1, 1])
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_zlabel()) == ("x / mm", "y / mm", "z / mm")
    assert "three_dof" in texts_of(figure)
    assert "tip (398.4, -218.5, 187.2) mm;  frames: x red, y green, z blue" in texts_of(figure)
    # All of the arm is within the axes, and one line is its skeleton.
    paths = [np.array(line.get_data_3d()).T for line in axes.lines]
    assert any(path.shape == (5, 3) and np.allclose(path, skeleton(THREE_DOF, POSE).path) for path in paths)
    low, high = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()]).T
    bone = skeleton(THREE_DOF, POSE).path
    assert np.all((bone >= low - 1e-9) & (bone <= high + 1e-9))
    # ... and the axes' box, with its labels, within the figure.
    renderer: Any = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    box = axes.get_tightbbox(renderer)
    assert box.x0 >= 0
    assert box.y0 >= 0
    assert box.x1 <= figure.bbox.width
    assert box.y1 <= figure.bbox.height


def test_all_branches_of_a_target(tmp_path: Path, saved_figures: list[Any]) -> None:
    s = armkin.ik(THREE_DOF, [390.0, 80.0, 300.0])
    names = [s.names[k] for k in s.branch]
    plot_poses(THREE_DOF, s.q, str(tmp_path / "branches.png"), names=names, target=[390, 80, 300])
    [figure] = saved_figures
    legal = {name for name, is_legal in zip(names, s.within_limits, strict=True) if is_legal}
    assert legal == {"left, elbow up", "left, elbow down"}
    labels = [name if name in legal else f"{name} (outside limits)" for name in names]
    assert [text for text in texts_of(figure) if "elbow" in text] == labels
    assert "target" in texts_of(figure)
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    for label in labels:
        assert (lines[label].get_linestyle() == "-") == ("outside" not in label)
    assert len({lines[label].get_color() for label in labels}) == 4


def test_path(tmp_path: Path, saved_figures: list[Any]) -> None:
    poses = np.deg2rad([[a, 30 + a / 3, -40] for a in range(0, 70, 10)])
    plot_poses(THREE_DOF, poses, str(tmp_path / "path.svg"))
    [figure] = saved_figures
    assert [text for text in texts_of(figure) if text in ("start", "end")] == ["start", "end"]
    tips = fk(THREE_DOF, poses)[:, :3, 3]
    ways = [np.array(line.get_data_3d()).T for line in figure.axes[0].lines]
    [way] = [way for way in ways if way.shape == (6 * 16 + 1, 3)]
    assert np.allclose(way[::16], tips)
    middle = fk(THREE_DOF, (poses[2] + poses[3]) / 2)[:3, 3]  # where the tip is, and not half of the chord
    assert np.allclose(way[2 * 16 + 8], middle)
    assert np.linalg.norm((tips[2] + tips[3]) / 2 - middle) > 1


def test_a_long_path_shows_some_arms_and_the_whole_way(tmp_path: Path, saved_figures: list[Any]) -> None:
    poses = np.deg2rad([[a / 10, 30 + a / 30, -40] for a in range(1000)])
    plot_poses(THREE_DOF, poses, str(tmp_path / "path.png"))
    [figure] = saved_figures
    arms = [line for line in figure.axes[0].lines if np.array(line.get_data_3d()).shape == (3, 5)]
    assert len(arms) == 40
    assert max(np.array(line.get_data_3d()).shape[1] for line in figure.axes[0].lines) > 10_000


def seen_boxes(figure: Any) -> tuple[Any, Any]:
    """What is seen of the axes in space, and the legend: [pixels]."""
    from armkin.plot.canvas import _visible_corners

    axes = figure.axes[0]
    legend = axes.get_legend()
    renderer: Any = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    return _visible_corners(axes), None if legend is None else legend.get_window_extent(renderer)


@pytest.mark.parametrize("first", range(0, len(catalogue.robot_names()), 2))
def test_nothing_of_a_shipped_robot_is_cut_off_or_covered(
    first: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sample: Callable[[int, int], int]
) -> None:
    saved_figures: list[Any] = []
    monkeypatch.setattr(
        Figure, "savefig", lambda figure, *_, **__: saved_figures.append(figure)
    )  # the pixels take half of it
    for name in catalogue.robot_names()[first : first + sample(2, 1)]:
        saved_figures.clear()
        _is_seen_whole(armkin.load(name), tmp_path, saved_figures)


def _is_seen_whole(arm: armkin.Arm, tmp_path: Path, saved_figures: list[Any]) -> None:
    plot_poses(arm, arm.home, str(tmp_path / "home.png"))
    near = arm.home + 0.2 * np.where(arm.prismatic, arm.reach, 1.0) * np.array([[1.0], [-1.0]])
    names = ["right, elbow down, flip", "left, elbow up, no flip"]
    plot_poses(arm, near, str(tmp_path / "branches.png"), names=names)
    shown = [text.get_text() for axes in saved_figures[0].axes for text in axes.texts]
    assert set(" ".join(shown).replace(",", "").split()) >= set(arm.joint_names)
    for figure in saved_figures:
        if not hasattr(figure.axes[0], "get_zlim"):
            continue
        assert (figure.axes[0].elev, figure.axes[0].azim) == (
            saved_figures[0].axes[0].elev,
            saved_figures[0].axes[0].azim,
        )
        (low, high), legend = seen_boxes(figure)
        assert np.all(low >= 0)
        assert np.all(high <= figure.bbox.size)
        assert legend is None or legend.x1 <= low[0] + 1
        places = [axis.get_majorticklocs() for axis in (figure.axes[0].xaxis, figure.axes[0].yaxis)]
        assert all(len(marks) for marks in places)


def test_twins_are_seen_beside_each_other(tmp_path: Path, saved_figures: list[Any]) -> None:
    """A wrist flip leaves every corner of the arm where it is."""
    arm = armkin.load("puma560")
    s = armkin.ik(arm, fk(arm, [0.3, -0.5, 0.4, 0.5, 0.7, 0.2]), "pose")
    names = [s.names[k] for k in s.branch[s.valid]]
    plot_poses(arm, s.q[s.valid], str(tmp_path / "twins.png"), names=names)
    lines = {line.get_label(): line.get_linewidth() for line in saved_figures[0].axes[0].lines}
    by_name = {name: width for label, width in lines.items() for name in names if str(label).startswith(name)}
    for name in names:
        if name.endswith("no flip"):
            continue
        assert abs(by_name[name] - by_name[name.removesuffix("flip") + "no flip"]) >= 2


def test_planar_arm_is_drawn_in_its_plane(tmp_path: Path, saved_figures: list[Any]) -> None:
    plot_poses(PLANAR, np.deg2rad([20, 50, -30]), str(tmp_path / "planar.png"))
    plot_poses(PLANAR, np.deg2rad([20, 50, -30]), str(tmp_path / "space.png"), view=(20, -60))
    [plane], [space] = (figure.axes for figure in saved_figures)
    assert not hasattr(plane, "get_zlim")
    assert hasattr(space, "get_zlim")
    assert plane.get_aspect() == 1.0
    box = plane.get_window_extent()
    scale = np.array([box.width / np.ptp(plane.get_xlim()), box.height / np.ptp(plane.get_ylim())])
    assert scale[0] == pytest.approx(scale[1], rel=1e-6)
    assert (plane.get_xlabel(), plane.get_ylabel()) == ("x / mm", "y / mm")


@pytest.mark.parametrize("colour", ["manipulability", "step_error", "reach", "z"])
def test_workspace_picture(tmp_path: Path, saved_figures: list[Any], survey_of_arm: Workspace, colour: str) -> None:
    picture = tmp_path / "cloud.png"
    plot_workspace(survey_of_arm, str(picture), colour=colour)
    width, _ = size_of_png(picture)
    assert width >= 1200
    [figure] = saved_figures
    cloud, above, side, bar = figure.axes
    assert millimetres_per_millimetre(cloud) == pytest.approx([1, 1, 1])
    assert (above.get_xlabel(), above.get_ylabel()) == ("x / mm", "y / mm")
    assert (side.get_xlabel(), side.get_ylabel()) == ("r / mm", "z / mm")
    assert above.get_aspect() == side.get_aspect() == 1.0
    unit = {"manipulability": "share of the largest", "step_error": "step error / mm"}
    assert unit.get(colour, "/ mm") in bar.get_xlabel()
    low, high = side.get_xlim()
    assert low <= 0
    assert high > np.hypot(*survey_of_arm.tips[:, :2].T).max() * 0.99
    assert any("40,000 samples" in text and "m³ ±" in text for text in texts_of(figure))
    (least, greatest), _ = seen_boxes(figure)
    assert np.all(least >= 0)
    assert greatest[0] < figure.bbox.width * 0.6


def test_workspace_of_a_planar_arm(tmp_path: Path, saved_figures: list[Any]) -> None:
    plot_workspace(workspace(PLANAR, 5000, keep=5000), str(tmp_path / "cloud.svg"), colour="reach")
    [figure] = saved_figures
    plane, bar = figure.axes
    assert plane.get_aspect() == 1.0
    assert bar.get_ylabel() == "distance from the base / mm"


@pytest.mark.parametrize("end", ["png", "svg"])
def test_same_input_same_file_other_input_other_file(tmp_path: Path, end: str) -> None:
    paths = [tmp_path / f"{name}.{end}" for name in "abc"]
    for path, q in zip(paths, (POSE, POSE, POSE + 0.2), strict=True):
        plot_poses(THREE_DOF, q, str(path))
    a, b, c = (path.read_bytes() for path in paths)
    assert a == b
    assert a != c
    if end == "svg":
        assert ElementTree.fromstring(a).tag == "{http://www.w3.org/2000/svg}svg"


def test_same_survey_same_picture(tmp_path: Path, survey_of_arm: Workspace) -> None:
    for name in "ab":
        plot_workspace(survey_of_arm, str(tmp_path / f"{name}.png"), colour="z")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_the_callers_style_is_left_alone(tmp_path: Path) -> None:
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    plot_poses(THREE_DOF, POSE, str(tmp_path / "arm.png"))
    assert dict(mpl.rcParams) == before


def test_tick_steps_are_round() -> None:
    assert [tick_step(size) for size in (0.3, 75, 76, 455, 1400, 3e5)] == [0.05, 10, 20, 100, 200, 50_000]


@pytest.mark.parametrize(
    ("q", "options", "message"),
    [
        ([1, 2], {}, "three_dof has 3 joints (q1, q2, q3): expected 3 values on the last axis, got 2"),
        ([1, 2, np.nan], {}, "joint values must be finite to be drawn"),
        (np.zeros((20_001, 3)), {}, "20001 poses in one picture: give 1 to 20000"),
        (np.zeros((0, 3)), {}, "0 poses in one picture: give 1 to 20000"),
        (np.zeros((2, 3)), {"names": ["a"]}, "2 poses and 1 names: give each pose its name"),
    ],
)
def test_messages(tmp_path: Path, q: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError) as caught:
        plot_poses(THREE_DOF, q, str(tmp_path / "arm.png"), **options)
    assert str(caught.value) == message
    assert list(tmp_path.iterdir()) == []


def test_messages_of_workspace_pictures(tmp_path: Path) -> None:
    picture = str(tmp_path / "cloud.png")
    bare, with_samples = workspace(THREE_DOF, 50, volume=False), workspace(THREE_DOF, 50, volume=False, keep=50)
    for survey, colour, message in [
        (with_samples, "speed", "there is no colour 'speed'; there are manipulability, step_error, reach, z"),
        (with_samples, "step_error", "the survey has no step_error; ask for it with measures=['step_error']"),
        (bare, "z", "the survey kept no samples to draw; ask for them with keep=100_000"),
    ]:
        with pytest.raises(UsageError) as caught:
            plot_workspace(survey, picture, colour=colour)
        assert str(caught.value) == message
    assert list(tmp_path.iterdir()) == []


def test_files_that_cannot_be(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"a picture is written as .png or .svg"):
        plot_poses(THREE_DOF, POSE, str(tmp_path / "arm.jpg"))
    with pytest.raises(FileError, match="cannot write: there is no folder "):
        plot_poses(THREE_DOF, POSE, str(tmp_path / "no/arm.png"))


def test_extreme_arms_are_drawn(tmp_path: Path) -> None:
    point = from_links(np.tile(np.eye(4), (2, 1, 1)), [False])  # no extent at all
    plot_poses(point, [0.3], str(tmp_path / "point.png"))
    size_of_png(tmp_path / "point.png")


def test_without_matplotlib(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(MissingExtraError) as caught:
        plot_poses(THREE_DOF, POSE, str(tmp_path / "arm.png"))
    assert str(caught.value).startswith("pictures need matplotlib, which cannot be imported (")
    assert str(caught.value).endswith("); pip install matplotlib (armkin's extra: plot)")
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_importing_the_module_does_not_import_matplotlib() -> None:
    code = "import armkin.plot, sys; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(("view", "hidden"), [((90, -90), "z"), ((0, -90), "y"), ((0, 0), "x"), ((22, -60), "")])
def test_an_axis_seen_end_on_has_no_label(view: tuple[float, float], hidden: str) -> None:
    axes = space_axes(Figure(), [0, 0, 1, 1], view)
    assert [name for name in "xyz" if not getattr(axes, f"get_{name}label")()] == list(hidden)
