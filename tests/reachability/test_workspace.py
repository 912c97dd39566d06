"""The workspace: samples, bounds, volumes known by hand, measures, files, memory."""

import csv
import math
import subprocess
import sys
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.errors import FileError, UsageError
from armkin.forward import fk, jacobian, position
from armkin.model.arm import Arm, from_links
from armkin.model.rotation import transform
from armkin.motors import joints_per_pulse, rounding
from armkin.reachability import workspace
from armkin.reachability.dexterity import measure_function
from armkin.reachability.sampling import CHUNK, Random, joint_grid
from armkin.reachability.volume import extent

ROOT = Path(__file__).parents[2]
THREE_DOF = armkin.load(ROOT / "robots/three_dof.yaml")
PAN_TILT = armkin.load(ROOT / "robots/pan_tilt.yaml")
PLANAR = armkin.load(ROOT / "robots/planar_2dof.yaml")
FREE = (-math.inf, math.inf)
TURN_X, TURN_Y = transform((0, 0, 0), (90, 0, 0)), transform((0, 0, 0), (0, 90, 0))


def chain_arm(*links: np.ndarray, kinds: str, limits: Sequence[Any]) -> Arm:
    """An arm of R and P joints with limits in degrees and mm."""
    scale = [[1.0] if kind == "P" else [math.pi / 180] for kind in kinds]
    return from_links(np.array(links), [k == "P" for k in kinds], limits=np.array(limits) * scale)


def shift_along_x(x: float) -> np.ndarray:
    return transform((x, 0, 0), (0, 0, 0))


def planar_2r(*limits: tuple[float, float]) -> Arm:
    return chain_arm(np.eye(4), shift_along_x(200), shift_along_x(300), kinds="RR", limits=list(limits))


def yaw_2r(*limits: tuple[float, float], base: np.ndarray | None = None) -> Arm:
    """A yaw and two links in its plane: everything between two spheres."""
    first = np.eye(4) if base is None else base
    return chain_arm(first, TURN_X, shift_along_x(200), shift_along_x(300), kinds="RRR", limits=list(limits))


ANNULUS = math.pi * (500**2 - 100**2)
SHELL = 4 / 3 * math.pi * (500**3 - 100**3)
TUBE = math.pi * (300**2 - 100**2) * 200
TILTED = transform((100, 200, 300), (30, 40, 50))
WRIST = [
    TURN_X,
    shift_along_x(200),
    shift_along_x(300) @ TURN_Y,
    TURN_X,
    TURN_X,
    transform((0, 0, 80), (0, 0, 0)) @ np.eye(4),
]

KNOWN = {
    "2R, no limits": (planar_2r(FREE, FREE), ANNULUS, 0.0005),
    "2R, a quarter of base": (planar_2r((-45, 45), (0, 180)), ANNULUS / 4, 0.0005),
    "2R, both elbows": (planar_2r((-180, 180), (-180, 180)), ANNULUS, 0.0005),
    "yaw and 2R": (yaw_2r(FREE, FREE, FREE), SHELL, 0.005),
    "yaw and 2R, tilted": (yaw_2r(FREE, FREE, FREE, base=TILTED), SHELL, 0.005),
    # The arm also reaches backwards over its shoulder: the base's quarter counts twice.
    "yaw of 90": (yaw_2r((-45, 45), FREE, FREE), SHELL / 2, 0.01),
    "yaw of 5": (yaw_2r((-2.5, 2.5), FREE, FREE), SHELL / 36, 0.01),
    "yaw of 240, forwards and backwards": (yaw_2r((-120, 120), FREE, FREE), SHELL, 0.005),
    "PP": (chain_arm(np.eye(4), TURN_X, np.eye(4), kinds="PP", limits=[(0, 100), (-20, 180)]), 20_000.0, 0.0005),
    "PPP, tilted": (
        chain_arm(TILTED, TURN_X, TURN_Y, np.eye(4), kinds="PPP", limits=[(0, 100), (0, 200), (-50, 300)]),
        7e6,
        0.02,
    ),
    "RPP": (
        chain_arm(np.eye(4), np.eye(4), TURN_Y, np.eye(4), kinds="RPP", limits=[FREE, (0, 200), (100, 300)]),
        TUBE,
        0.01,
    ),
    "PRP": (
        chain_arm(np.eye(4), np.eye(4), TURN_Y, np.eye(4), kinds="PRP", limits=[(0, 200), FREE, (100, 300)]),
        TUBE,
        0.02,
    ),
}


@pytest.mark.parametrize("name", KNOWN)
def test_volume_is_the_known_one_within_its_own_error(name: str) -> None:
    arm, volume, tolerance = KNOWN[name]
    size = extent(arm)
    assert abs(size.value - volume) <= size.error
    assert size.value == pytest.approx(volume, rel=tolerance)
    assert size.error <= 2.5 * tolerance * volume
    assert size.dimensions == (2 if volume < 1e6 else 3)


def test_volume_of_an_arm_with_a_wrist() -> None:
    """Redundant for the position; its outer shell is hard to reach by chance."""
    links = [
        np.eye(4),
        TURN_X,
        shift_along_x(200),
        shift_along_x(300) @ TURN_Y,
        TURN_X,
        TURN_X,
        transform((0, 80, 0), (0, 0, 0)),
    ]
    arm = chain_arm(*links, kinds="RRRRRR", limits=[FREE] * 6)
    tip = position(arm, np.random.default_rng(0).uniform(-math.pi, math.pi, (100_000, 6)))
    far = np.linalg.norm(tip, axis=1).max()
    assert 560 < far < 580  # chance alone does not get to the end
    size = extent(arm)
    volume = 4 / 3 * math.pi * (580**3 - 20**3)
    assert abs(size.value - volume) <= size.error <= 0.01 * volume


@pytest.mark.parametrize(
    ("arm", "dimensions", "why"),
    [
        (PAN_TILT, 3, "exact: the tip stays on a surface"),
        (chain_arm(np.eye(4), shift_along_x(100), kinds="R", limits=[FREE]), 2, "exact: the tip stays on a curve"),
        (chain_arm(np.eye(4), np.eye(4), kinds="R", limits=[FREE]), 2, "exact: the tip does not move"),
    ],
)
def test_volume_of_a_surface_is_nothing(arm: Arm, dimensions: int, why: str) -> None:
    size = extent(arm)
    assert (size.dimensions, size.value, size.error, size.method) == (dimensions, 0.0, 0.0, why)


@pytest.mark.parametrize("degrees", [1e-300, 1e-9, 1e-8, 1e-7, 1e-6])
def test_volume_of_an_arm_that_hardly_moves_is_next_to_nothing(degrees: float) -> None:
    """Its section is narrower than floats can tell apart; no warning (they are errors here)."""
    tight = np.deg2rad([-degrees, degrees])
    size = extent(chain_arm(np.eye(4), TURN_X, shift_along_x(200), shift_along_x(300), kinds="RRR", limits=[tight] * 3))
    assert 0.0 <= size.value < 1e-6


def test_volume_is_repeatable() -> None:
    assert extent(PLANAR, seed=5) == extent(PLANAR, seed=5)


def test_random_samples_are_within_limits_and_repeatable() -> None:
    sampling = Random(THREE_DOF, CHUNK + 10, seed=3)
    assert sampling.parts == 2
    first, second = map(sampling.part, range(2))
    assert (len(first), len(second)) == (CHUNK, 10)
    assert np.all((first >= THREE_DOF.lower) & (first <= THREE_DOF.upper))
    assert np.array_equal(sampling.part(0), first)
    assert not np.array_equal(Random(THREE_DOF, 10, seed=4).part(0), first[:10])
    # A short run is the beginning of a long one.
    assert np.array_equal(Random(THREE_DOF, 10, seed=3).part(0), first[:10])


def test_grid_has_both_limits_and_a_half_open_turn() -> None:
    q = joint_grid(THREE_DOF, (3, 2, 1)).part(0)
    assert np.rad2deg(q).round(9).tolist() == [[a, b, 0] for a, b in product((-120, 0, 120), (-20, 120))]
    q = joint_grid(PAN_TILT, (4, 2)).part(0)
    assert np.rad2deg(q).round(9).tolist() == [list(pair) for pair in product((-180, -90, 0, 90), (-180, 0))]
    assert joint_grid(THREE_DOF, [5]).points == (5, 5, 5)


def test_grid_across_chunks_is_the_whole_grid() -> None:
    sampling = joint_grid(THREE_DOF, (7, 101, 211))
    parts = [sampling.part(i) for i in range(sampling.parts)]
    assert len(parts) > 1
    q = np.concatenate(parts)
    assert len(np.unique(q, axis=0)) == sampling.count == 7 * 101 * 211
    assert q.max(axis=0).tolist() == THREE_DOF.upper.tolist()


def test_the_homeworks_sweep() -> None:
    """50 x 200 poses of pan and tilt over a full turn each: all on one sphere."""
    w = workspace(PAN_TILT, grid_points=(50, 200))
    assert w.samples == 10_000
    far = math.hypot(1000, 1500)
    assert w.reach == pytest.approx((far, far), rel=1e-12)
    assert w.low.tolist() == pytest.approx([-far, -far, -1500], rel=2e-3)
    assert w.high.tolist() == pytest.approx([far, far, 1500], rel=2e-3)
    assert w.extent is not None
    assert w.extent.value == 0.0


def test_bounds_are_those_of_the_tips() -> None:
    w = workspace(THREE_DOF, 5000, seed=9, volume=False, keep=10_000)
    tips = fk(THREE_DOF, w.joints)[:, :3, 3]
    assert len(tips) == 5000  # asked for more than there are: all
    assert np.allclose(tips, w.tips, atol=1e-9)
    assert (w.low.tolist(), w.high.tolist()) == (w.tips.min(axis=0).tolist(), w.tips.max(axis=0).tolist())
    assert w.reach == pytest.approx((np.linalg.norm(tips, axis=1).min(), np.linalg.norm(tips, axis=1).max()))
    assert w.extent is None


def test_kept_samples_are_a_share_of_all() -> None:
    w = workspace(THREE_DOF, 300_000, volume=False, keep=3000)
    assert 2700 < len(w.joints) < 3300


def test_step_error_is_the_worst_of_all_signs() -> None:
    q = np.random.default_rng(5).uniform(THREE_DOF.lower, THREE_DOF.upper, (50, 3))
    J = jacobian(THREE_DOF, q)[:, :3] @ joints_per_pulse(THREE_DOF)
    worst = np.max([np.linalg.norm(J @ (0.5 * np.array(s)), axis=1) for s in product((-1, 1), repeat=3)], axis=0)
    assert measure_function(THREE_DOF, "step_error")(q) == pytest.approx(worst, rel=1e-12)
    postures = np.random.default_rng(6).uniform(THREE_DOF.lower, THREE_DOF.upper, (20_000, 3))
    ratio = rounding(THREE_DOF, postures).error / measure_function(THREE_DOF, "step_error")(postures)
    assert 0.9 < ratio.max() < 1.001  # a bound, and a tight one


def test_tip_manipulability() -> None:
    q = np.random.default_rng(7).uniform(-2, 2, (30, 3))
    values = np.linalg.svd(jacobian(THREE_DOF, q)[:, :3], compute_uv=False)
    assert measure_function(THREE_DOF, "manipulability")(q) == pytest.approx(values.prod(axis=1), rel=1e-9)
    # Planar arm: a1 a2 |sin q2| (Yoshikawa 1985, eq. 26); and the same in a plane that stands askew.
    tilted = chain_arm(TILTED, shift_along_x(200), shift_along_x(300), kinds="RR", limits=[FREE, FREE])
    for arm in (PLANAR, tilted):
        assert measure_function(arm, "manipulability")(q[:, :2]) == pytest.approx(
            200 * 300 * np.abs(np.sin(q[:, 1])), rel=1e-9
        )
    # Two joints in space: the area of the parallelogram.
    J = jacobian(PAN_TILT, q[:, :2])[:, :3]
    area = np.linalg.norm(np.cross(J[..., 0], J[..., 1]), axis=1)
    assert measure_function(PAN_TILT, "manipulability")(q[:, :2]) == pytest.approx(area, rel=1e-6)


def read_csv(path: Path) -> tuple[list[str], np.ndarray]:
    with path.open(newline="") as file:
        heading, *rows = csv.reader(file)
    return heading, np.array(rows, dtype=float)


def test_files_hold_the_same_samples(tmp_path: Path) -> None:
    count = CHUNK + 100
    names = ["manipulability", "step_error"]
    for end in ("csv", "npz", "ply"):
        workspace(THREE_DOF, count, seed=1, out=str(tmp_path / f"cloud.{end}"), measures=names, volume=False)
    heading, rows = read_csv(tmp_path / "cloud.csv")
    assert heading == ["q1", "q2", "q3", "x", "y", "z", "manipulability", "step_error"]
    assert rows.shape == (count, 8)
    with np.load(tmp_path / "cloud.npz") as z:
        assert z["joint_names"].tolist() == ["q1", "q2", "q3"]
        assert {name: z[name].shape for name in ("joints", "position", *names)} == {
            "joints": (count, 3),
            "position": (count, 3),
            "manipulability": (count,),
            "step_error": (count,),
        }
        table = np.column_stack([z["joints"], z["position"], z["manipulability"], z["step_error"]])
    np.testing.assert_allclose(rows, table, rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(fk(THREE_DOF, np.deg2rad(table[:, :3]))[:, :3, 3], table[:, 3:6], atol=1e-9)
    header, _, body = (tmp_path / "cloud.ply").read_bytes().partition(b"end_header\n")
    assert header.decode().split("\n")[:4] == [
        "ply",
        "format binary_little_endian 1.0",
        "comment three_dof, tip positions in mm, by armkin",
        f"element vertex {count}",
    ]
    assert header.count(b"property float") == 5
    np.testing.assert_allclose(np.frombuffer(body, "<f4").reshape(count, 5), table[:, 3:], rtol=1e-6, atol=1e-3)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cloud.csv", "cloud.npz", "cloud.ply"]


@pytest.mark.parametrize("end", ["csv", "npz", "ply"])
def test_a_file_is_the_same_every_time(tmp_path: Path, end: str) -> None:
    for name in "ab":
        workspace(PLANAR, 100, out=str(tmp_path / f"{name}.{end}"), volume=False)
    assert (tmp_path / f"a.{end}").read_bytes() == (tmp_path / f"b.{end}").read_bytes()


@pytest.mark.parametrize("end", ["csv", "npz", "ply"])
def test_an_interrupt_leaves_no_file(tmp_path: Path, end: str) -> None:
    def stop(done: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        workspace(THREE_DOF, 1000, out=str(tmp_path / f"cloud.{end}"), progress=stop, volume=False)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("end", ["csv", "npz", "ply"])
def test_a_file_that_cannot_be_written(tmp_path: Path, end: str) -> None:
    with pytest.raises(FileError, match="cannot write: there is no folder "):
        workspace(THREE_DOF, 1000, out=str(tmp_path / f"no/cloud.{end}"), volume=False)


@pytest.mark.parametrize("end", ["csv", "npz", "ply"])
def test_a_full_disk_leaves_no_file(tmp_path: Path, end: str) -> None:
    """A limit on the size of files stands in for the full disk."""
    code = (
        "import resource, signal, sys, armkin\n"
        "arm = armkin.load(sys.argv[1])\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))\n"
        "try:\n"
        "    armkin.workspace(arm, 200_000, out=sys.argv[2], volume=False)\n"
        "except armkin.FileError as error:\n"
        "    print(error)\n"
    )
    robot, target = str(ROOT / "robots/three_dof.yaml"), str(tmp_path / f"cloud.{end}")
    run = subprocess.run([sys.executable, "-c", code, robot, target], capture_output=True, text=True, check=True)
    assert run.stdout == f"{target}: cannot write: File too large\n"
    assert list(tmp_path.iterdir()) == []


def test_memory_does_not_grow_with_the_samples(tmp_path: Path) -> None:
    """2 million samples with everything on, under 150 MB; tests/bench has the 10 million."""
    code = (
        "import re, sys, armkin\n"
        "arm = armkin.load(sys.argv[1])\n"
        "armkin.workspace(arm, int(sys.argv[2]), keep=20_000, out=sys.argv[3])\n"
        # The process's own peak: getrusage would count pytest's, which it was forked from.
        "print(re.search(r'VmHWM:\\s+(\\d+) kB', open('/proc/self/status').read())[1])\n"
    )
    peak = []
    for count in (200_000, 2_000_000):
        words = [str(ROOT / "robots/three_dof.yaml"), str(count), str(tmp_path / "cloud.npz")]
        run = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=True)
        peak.append(int(run.stdout) / 1024)
    assert peak[1] < 150
    assert peak[1] < peak[0] + 20


def bad_calls() -> Iterator[tuple[dict[str, object], str]]:
    yield {"samples": 0}, "0 samples: give 1 to 10,000,000,000"
    yield {"samples": 10**16}, "10000000000000000 samples: give 1 to 10,000,000,000"
    yield {"samples": 5, "seed": -1}, "seed -1: give 0 or more"
    yield {"samples": 5, "grid_points": [2]}, "samples (random) and a grid: give one of the two"
    yield (
        {"grid_points": [2, 3]},
        ("three_dof has 3 joints (q1, q2, q3): a grid needs 3 numbers of points, or one for all; got 2"),
    )
    yield {"grid_points": [2, 0, 2]}, "a grid needs at least 1 point on every joint, not 0"
    yield {"grid_points": [10**6]}, "the grid has 1,000,000,000,000,000,000 points; 10,000,000,000 at most"
    yield {"measures": ["speed"]}, "there is no measure 'speed'; there are manipulability, step_error"
    yield (
        {"out": "cloud.txt"},
        ("cloud.txt: a cloud is written as .csv, .npz or .ply; end the file's name with one of them"),
    )


@pytest.mark.parametrize(("arguments", "message"), list(bad_calls()))
def test_messages(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(UsageError) as caught:
        workspace(THREE_DOF, **arguments)  # type: ignore[arg-type]
    assert str(caught.value) == message


def test_an_endless_slide_is_an_error() -> None:
    arm = from_links(np.tile(np.eye(4), (3, 1, 1)), [False, True], name="mast")
    for arguments in ({"samples": 5}, {"grid_points": [5]}):
        with pytest.raises(UsageError, match="prismatic joint q2 of mast has no limits; give it limits"):
            workspace(arm, **arguments)


def test_progress_counts_to_the_end() -> None:
    counts: list[int] = []
    workspace(THREE_DOF, CHUNK + 5, progress=counts.append, volume=False)
    assert counts == [CHUNK, CHUNK + 5]


def test_few_samples_do_not_wait_for_the_volume() -> None:
    """The whole effort for the volume took half a second, whatever was asked for."""
    one_sample, samples = armkin.workspace(THREE_DOF, 1), armkin.workspace(THREE_DOF, 100_000)
    assert one_sample.extent is not None
    assert samples.extent is not None
    assert one_sample.seconds < 0.5 * samples.seconds
    assert abs(one_sample.extent.value - samples.extent.value) < one_sample.extent.error + samples.extent.error
    assert samples.extent.error < one_sample.extent.error < 0.1 * one_sample.extent.value
