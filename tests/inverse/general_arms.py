"""Arms without a closed form (and some with one), and forward kinematics independent of the package."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]
Arm = tuple[Array, Bool]  # links (7, 4, 4) [mm], prismatic (6,)

PRISMATIC_PATTERNS = [
    *("PRRRRR", "RPRRRR", "RRPRRR", "RRRPRR", "RRRRPR", "RRRRRP"),
    *("PPRRRR", "PRRRPR", "PRRRRP", "RRPPRR", "RRPRPR", "RRRPPR", "RRRRPP", "RRPRRP", "PRPRRR"),
    *("PPPRRR", "RRRPPP", "PRPRPR", "RPRPRP", "PRRPRP", "RPPRPR", "PPRRRP", "PRRRPP"),
]


def dh_arm(alpha: list[float], a: list[float], d: list[float], theta: list[float], pattern: str = "RRRRRR") -> Arm:
    """Standard DH [deg, mm] as ``link[0] Z1 link[1] ..``: link i is Rz(theta) Tz(d) Tx(a) Rx(alpha)."""
    link = np.zeros((7, 4, 4))
    link[0] = np.eye(4)
    for i in range(6):
        ca, sa = np.cos(np.radians(alpha[i])), np.sin(np.radians(alpha[i]))
        ct, st = np.cos(np.radians(theta[i])), np.sin(np.radians(theta[i]))
        link[i + 1] = [
            [ct, -st * ca, st * sa, a[i] * ct],
            [st, ct * ca, -ct * sa, a[i] * st],
            [0, sa, ca, d[i]],
            [0, 0, 0, 1],
        ]
    return link, np.array([letter == "P" for letter in pattern])


def random_arm(seed: int, pattern: str = "RRRRRR") -> Arm:
    """An arm with nothing special about it."""
    rng = np.random.default_rng(seed)
    angles, lengths = rng.uniform(-180, 180, (2, 6)), rng.uniform(-500, 500, (2, 6))
    return dh_arm(list(angles[0]), list(lengths[0]), list(lengths[1]), list(angles[1]), pattern)


ZERO = [0.0] * 6
DEGREE = 180 / np.pi
ARMS: dict[str, Arm] = {
    # Kinovarobotics/kinova-ros kinova_arm_kinematics.cpp (j2n6)
    "JACO": dh_arm(
        [90, 180, 90, 60, 60, 180],
        [0, 410, 0, 0, 0, 0],
        [275.5, 0, -9.8, -250.081655, -85.56331, -202.781655],
        [0, -90, 90, 0, -180, 90],
    ),
    # the shape of a Fanuc CRX-10iA: parallel shoulder and elbow, offset wrist
    "CRX": dh_arm([-90, 180, -90, 90, -90, 180], [0, 540, 0, 0, 0, 0], [0, 0, 0, -540, 150, -160], ZERO),
    # Manseur and Doty 1989, "A robot manipulator with 16 real inverse kinematic solution sets"
    "MD16": dh_arm([90, DEGREE, 90, DEGREE, 90, 0], [300, 1000, 0, 1500, 0, 0], [0, 0, 200, 0, 0, 0], ZERO),
    # Manocha and Canny 1994, Table I, twists of one degree
    "MC": dh_arm([90, 1, 90, 1, 90, 1], [300, 1000, 0, 1500, 0, 0], [0, 0, 200, 0, 0, 0], ZERO),
    # the shape of a Kinova Gen3 Lite
    "GEN3L": dh_arm(
        [90, 180, 90, 90, 90, 0],
        [0, 280, 0, 0, 0, 0],
        [243.3, 30, 20, 245, 57, 235],
        [0, 90, 90, 90, 180, 90],
    ),
    "UR5e": dh_arm([90, 0, 0, 90, -90, 0], [0, -425, -392.2, 0, 0, 0], [162.5, 0, 0, 133.3, 99.7, 99.6], ZERO),
    "IRB2400": dh_arm(
        [-90, 0, -90, 90, -90, 0],
        [100, 705, 135, 0, 0, 0],
        [615, 0, 0, 755, 0, 85],
        [0, -90, 0, 0, 0, 180],
    ),
    "PUMA": dh_arm([90, 0, -90, 90, -90, 0], [0, 431.8, 20.3, 0, 0, 0], [671.83, 0, 150.05, 431.8, 0, 0], ZERO),
    "STANFORD": dh_arm([-90, 90, 0, -90, 90, 0], ZERO, [412, 154, 0, 0, 0, 263], [0, 0, -90, 0, 0, 0], "RRPRRR"),
}


def pose_of(arm: Arm, q: Array) -> Array:
    """Poses (..., 4, 4) of joint values (..., 6), by plain matrix products."""
    link, prismatic = arm
    T = np.broadcast_to(link[0], (*q.shape[:-1], 4, 4))
    for i in range(6):
        Z = np.zeros((*q.shape[:-1], 4, 4)) + np.eye(4)
        if prismatic[i]:
            Z[..., 2, 3] = q[..., i]
        else:
            Z[..., 0, 0] = Z[..., 1, 1] = np.cos(q[..., i])
            Z[..., 1, 0] = np.sin(q[..., i])
            Z[..., 0, 1] = -np.sin(q[..., i])
        T = T @ Z @ link[i + 1]
    return T


def arm_size(arm: Arm) -> float:
    """The unit [mm] in which lengths are compared with radians: the sum of the links' lengths."""
    total = float(np.linalg.norm(arm[0][1:, :3, 3], axis=1).sum())
    return total if total else 300.0


def random_joints(arm: Arm, count: int, seed: int) -> Array:
    """Joint values (count, 6): whole turns, or +-500 mm."""
    rng = np.random.default_rng(seed)
    return np.where(arm[1], rng.uniform(-500, 500, (count, 6)), rng.uniform(-np.pi, np.pi, (count, 6)))


def joint_distance(arm: Arm, q: Array, q_other: Array) -> Array:
    """Largest joint difference, modulo whole turns and in scaled lengths; infinite where a row is NaN."""
    step = q - q_other
    step = np.where(arm[1], step / arm_size(arm), step - 2 * np.pi * np.round(step / (2 * np.pi)))
    return np.asarray(np.nan_to_num(np.abs(step).max(axis=-1), nan=np.inf))


def nearest_distance(arm: Arm, q: Array, branches: Array) -> Array:
    """How far the nearest of the answers (N, B, 6) is from the joints (N, 6) that made the target."""
    return np.asarray(joint_distance(arm, branches, q[:, None]).min(axis=1, initial=np.inf))


def pose_residual(arm: Arm, branches: Array, T: Array) -> float:
    """The largest pose error of all answers (N, B, 6) for targets (N, 4, 4), lengths scaled."""
    difference = pose_of(arm, branches) - T[:, None]
    difference[..., :3, 3] /= arm_size(arm)
    return float(np.nanmax(np.sqrt(np.sum(difference**2, axis=(-2, -1))), initial=0.0))


def random_motions(rng: np.random.Generator, count: int) -> Array:
    """Random rigid motions (count, 4, 4)."""
    Q, _ = np.linalg.qr(rng.standard_normal((count, 3, 3)))
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, :3, :3] = Q * np.sign(np.linalg.det(Q))[:, None, None]
    T[:, :3, 3] = rng.standard_normal((count, 3))
    return T
