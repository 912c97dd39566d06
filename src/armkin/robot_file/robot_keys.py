"""The robot file as pydantic sees it: every key, its unit, its bounds and its help text.

Strict: no unknown keys, no text or booleans for numbers, finite numbers only; immutable. What needs
several values to judge (limits against home, axes against the board) stands in ``cross_key_checks``, and ``robot``
puts the two together.
Angles are degrees and lengths millimetres here; ``armkin.model.arm`` turns them into radians, once.
"""

import math
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

from armkin import board_catalogue
from armkin.errors import UsageError
from armkin.robot_file.key_types import Angle, Length, Model

MAX_JOINTS = 12
MAX_MOTORS = 24  # motors, at most: two on each joint
MAX_POSES = 100

Triple = tuple[float, float, float]
Convention = Literal["standard", "modified", "screws"]
JointType = Literal["revolute", "prismatic"]
Task = Literal["xy", "xy_theta", "xyz", "xyz_pitch", "xyz_yaw", "xyz_pitch_roll", "xyz_roll", "xyz_axis", "pose"]
Driver = Literal["A4988", "DRV8825", "TMC2208", "TMC2209"]


def _check_kind(kind: str) -> str:
    if not board_catalogue.kind_exists(kind):
        *names, last = map(repr, board_catalogue.kind_names())
        raise PydanticCustomError(
            "literal_error", "Input should be {expected}", {"expected": f"{', '.join(names)} or {last}"}
        )
    return kind


def _add_kinds(schema: dict[str, Any]) -> None:
    schema["enum"] = list(board_catalogue.kind_names())


BoardKind = Annotated[str, AfterValidator(_check_kind), Field(json_schema_extra=_add_kinds)]

# Bounds that no arm comes near: they catch slips of units, and keep every later product finite.
Value = Annotated[float, Field(ge=-1e6, le=1e6)]  # of a joint: degrees or millimetres
Rate = Annotated[float, Field(ge=1e-6, le=1e6)]  # less would take ages, and overflow what divides by it
Unit = Annotated[float, Field(ge=-1e3, le=1e3)]  # a component of a direction
# A name may stand in `J3=20` on the command line and in tables: no spaces, commas, colons or equal signs.
Name = Annotated[str, Field(max_length=32, pattern="^[A-Za-z_][A-Za-z0-9_.-]*$")]
# An int and not a Literal, which would take `true` for 1; 0 is for `cross_key_checks` to find.
Sign = Annotated[int, Field(ge=-1, le=1, json_schema_extra={"enum": [1, -1]})]


Size = Annotated[float, Field(ge=0, le=1e6)]


def _keep_out(values: Any) -> Any:
    """The entries of `armkin.robot_file.keep_out_keys`, whose models are built for files that have some alone."""
    from armkin.robot_file import keep_out_keys

    return keep_out_keys.read_keep_outs(values)


KeepOut = Annotated[tuple[Any, ...], BeforeValidator(_keep_out)]


def dot(a: Triple, b: Triple) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Triple, b: Triple) -> Triple:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _teeth_to_ratio(value: Any) -> Any:
    """Teeth ``{motor: 16, joint: 80}`` to the reduction 5.0; a number stays what it is."""
    if not isinstance(value, dict):
        return value
    motor, joint = value.get("motor", 0), value.get("joint", 0)
    are_teeth = type(motor) is type(joint) is int and len(value) == 2
    if are_teeth and 1 <= motor <= 10_000 and 1 <= joint <= 10_000:
        return joint / motor
    raise PydanticCustomError("problem", "teeth are whole numbers from 1 to 10000: {motor: 16, joint: 80}")


_TEETH = {"type": "integer", "minimum": 1, "maximum": 10_000}
Ratio = Annotated[
    float,
    Field(ge=1e-6, le=1e6),
    BeforeValidator(_teeth_to_ratio),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "number", "minimum": 1e-6, "maximum": 1e6},
                {
                    "type": "object",
                    "properties": {"motor": _TEETH, "joint": _TEETH},
                    "required": ["motor", "joint"],
                    "additionalProperties": False,
                },
            ]
        }
    ),
]


class Pose(Model):
    """A fixed frame: a position, then R = Rz(yaw) Ry(pitch) Rx(roll)."""

    xyz: tuple[Length, Length, Length] = Field((0.0, 0.0, 0.0), description="Position [x, y, z] in mm.")
    rpy: tuple[Angle, Angle, Angle] = Field(
        (0.0, 0.0, 0.0), description="Roll, pitch, yaw in degrees: R = Rz(yaw) Ry(pitch) Rx(roll)."
    )


class Body(Model):
    """What a joint moves: capsules along its part of the arm's skeleton."""

    radius: Size = Field(description="In mm; 0: no body.")


class Base(Pose):
    """The fixed frame before joint 1, and the body that stands there."""

    body: Body | None = Field(None, description="What stands before joint 1, for keep-outs: {radius: 60}, in mm.")


class DH(Model):
    """One row of a Denavit-Hartenberg table."""

    alpha: Angle = Field(description="Twist in degrees; with convention modified it stands before the joint.")
    a: Length = Field(description="Link length in mm; with convention modified it stands before the joint.")
    d: Length = Field(description="Link offset in mm; a prismatic joint's value is added to it.")
    theta: Angle = Field(0.0, description="Offset in degrees: DH angle = sign x joint value + theta.")


class Screw(Model):
    """A joint's screw axis at the zero pose, in the base frame."""

    w: tuple[Unit, Unit, Unit] = Field(
        description="Direction of the axis, of length 1; [0, 0, 0] for a prismatic joint."
    )
    v: tuple[Length, Length, Length] | None = Field(
        None,
        description="Linear part -w x q, q on the axis; a prismatic joint's direction, of length 1.",
    )
    q: tuple[Length, Length, Length] | None = Field(
        None, description="A point on the axis of a revolute joint, in mm, instead of `v`."
    )


class Drive(Model):
    """One motor: a stepper with its chain to the joint, an RC servo, or a servo on a serial bus."""

    kind: Literal["stepper", "servo", "bus", "spindle"] = Field(
        "stepper",
        description="A stepper (default), an RC servo, or a bus servo with an absolute position; spindle: "
        "a gripper on GRBL's M3 output.",
    )
    axis: Name | None = Field(
        None,
        description="The board's output: X, Y, Z, A (CNC shield); X, Y, Z, E0, E1 (RAMPS); S0... (servos).",
    )
    invert: bool = Field(False, description="Wiring: the motor turns the other way. (A joint's `sign` is geometry.)")
    full_steps: Annotated[int, Field(ge=1, le=100_000)] | None = Field(
        None, description="Stepper: full steps per motor turn, mostly 200."
    )
    microsteps: Annotated[int, Field(ge=1, le=65_536)] | None = Field(
        None, description="Stepper: microsteps per full step, as the driver's jumpers set it."
    )
    gear: Ratio = Field(
        1.0, description="Stepper: motor turns per joint turn, a number or teeth {motor: 16, joint: 80}."
    )
    pulley: Ratio = Field(1.0, description="Stepper: a second reduction, like gear; the two multiply.")
    lead: Annotated[float, Field(ge=1e-6, le=1e4)] | None = Field(
        None, description="Stepper on a prismatic joint: mm per turn after gear and pulley."
    )
    travel: tuple[Angle, Angle] | None = Field(
        None, description="Servo: its own angles in degrees at the two pulse widths, [0, 180] for most."
    )
    pulse_us: tuple[Annotated[int, Field(ge=100, le=5000)], Annotated[int, Field(ge=100, le=5000)]] | None = Field(
        None, description="Servo: pulse widths in microseconds at the two ends of `travel`."
    )
    zero: Angle = Field(
        0.0, description="Where the joint value is 0: an RC servo's own angle in degrees, a bus servo's count."
    )
    id: Annotated[int, Field(ge=0, le=253)] | None = Field(None, description="Bus servo: its number on the bus.")
    counts: Annotated[int, Field(ge=16, le=1_000_000)] | None = Field(
        None, description="Bus servo: counts per joint turn, 4096 for a Feetech STS3215 without gears."
    )

    def pulses_per_turn(self) -> float:
        """A stepper's pulses per joint turn: full_steps x microsteps x gear x pulley."""
        return (self.full_steps or 0) * (self.microsteps or 0) * self.gear * self.pulley

    def pulses_per_unit(self) -> float:
        """Pulses (microseconds, counts) per degree, or per mm if there is a lead; `invert` is not in it."""
        if self.kind == "bus":
            return (self.counts or 0) / 360.0
        if self.kind == "spindle":
            return 1.0
        if self.kind == "servo":
            (a0, a1), (p0, p1) = self.travel or (0.0, 1.0), self.pulse_us or (0, 0)
            return (p1 - p0) / (a1 - a0)
        return self.pulses_per_turn() / (self.lead if self.lead is not None else 360.0)


class Motor(Drive):
    """One motor of an arm whose motors and joints are not one to one."""

    name: Name = Field(description="The motor's name in messages and results.")
    joints: dict[str, Value] = Field(
        description="Weights: motor angle before its ratio = sum of weight x joint value.",
        min_length=1,
        max_length=MAX_JOINTS,
    )


class Gripper(Drive):
    """The gripper's motor and its two positions, in degrees of the drive (mm with a lead; S words of a spindle)."""

    open: Value = Field(
        description="Position when open, in the drive's degrees (mm with a lead), or a spindle's S word."
    )
    closed: Value = Field(
        description="Position when closed, in the drive's degrees (mm with a lead), or a spindle's S word."
    )
    max_speed: Rate | None = Field(None, description="deg/s or mm/s of the drive; needed to grip.")
    max_accel: Rate | None = Field(None, description="deg/s2 or mm/s2 of the drive; needed to grip.")

    def check_value(self, value: float) -> None:
        """Raise UsageError for a value, in the drive's units, that is not from open to closed."""
        low, high = sorted((self.open, self.closed))
        if not low <= value <= high:
            raise UsageError(f"grip: {value:g} is outside of the gripper's {low:g} to {high:g}")


class Homing(Model):
    """How a joint finds its limit switch."""

    switch: Name = Field(description="The board's limit input, for example X.")
    direction: Sign = Field(description="1: the switch is at the joint's upper end; -1: at the lower.")
    at: Value = Field(description="Joint value where the switch closes, in degrees or mm.")
    speed: Rate = Field(description="Approach speed in deg/s or mm/s; the second approach is slower.")
    backoff: Annotated[float, Field(ge=1e-6, le=1e6)] = Field(
        description="How far to back off the switch, in degrees or mm."
    )
    order: Annotated[int, Field(ge=1, le=99)] | None = Field(
        None, description="1 homes first, one joint after another; equal numbers in the file's order, absent ones last."
    )
    normally: Literal["open", "closed"] = Field(
        description="The switch when it is not pressed: `closed` also notices a cut wire."
    )


class Board(Model):
    """The controller that drives the motors."""

    kind: BoardKind = Field(
        description="One with armkin's firmware; grbl: GRBL 1.1 and its kin; feetech: a servo bus; klipper: Klipper."
    )
    driver: Driver | None = Field(None, description="Stepper driver: it sets the pulse timing.")
    enable: Literal["low", "high"] | None = Field(
        None, description="Level of the ENABLE pin that switches the drivers on; low for the listed ones."
    )
    abort: Literal["open", "closed"] | None = Field(
        None, description="The abort input when it is not pressed: open (default), or closed to ground."
    )
    power: Literal["A1", "A4", "GP27"] | None = Field(
        None,
        description="Input that is high while the motors have power (Uno A1, RAMPS A4, Pico GP27): a cut is noticed.",
    )


class Joint(Model):
    """One joint, its place in the chain, its range and its motor."""

    name: Name = Field(description="The joint's name in tables, in messages and on the command line.")
    type: JointType = Field("revolute", description="revolute (default) or prismatic.")
    dh: DH | None = Field(None, description="The DH row (conventions standard and modified).")
    screw: Screw | None = Field(None, description="The screw axis (convention screws).")
    sign: Sign = Field(1, description="1 or -1: the joint counts against the axis of its row or screw.")
    ratio: Annotated[float, Field(ge=0.5, le=2.0)] = Field(
        1.0, description="Actual turn (or mm) per commanded one, as calibration finds it; joint values are commanded."
    )
    limits: tuple[Value, Value] | None = Field(None, description="[lower, upper] in degrees or mm. Absent: unlimited.")
    home: Value = Field(0.0, description="The pose from which pulses are counted, in degrees or mm.")
    max_speed: Rate | None = Field(None, description="deg/s or mm/s; needed to send motion.")
    max_accel: Rate | None = Field(None, description="deg/s2 or mm/s2; needed to send motion.")
    max_jerk: Rate | None = Field(None, description="deg/s3 or mm/s3; absent: acceleration may change at once.")
    body: Body | None = Field(
        None, description="What this joint moves, for keep-outs: {radius: 40}, in mm. Absent: 2 % of the reach."
    )
    drive: Drive | None = Field(None, description="The joint's own motor; coupled joints use motors.")
    homing: Homing | None = Field(None, description="The limit switch; absent: `armkin home` refuses.")
    hard_limits: bool | None = Field(
        None, description="Whether the limit switch stops every motion into it; true where homing is, unless said."
    )

    def twist(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Screw axis (w, v) without the rounding of printed tables.

        Revolute: w of length 1 and v perpendicular to it; prismatic: w = 0 and v of length 1.
        """
        if self.screw is None:
            raise ValueError(f"joint {self.name} has no screw")
        w, v, q = self.screw.w, self.screw.v, self.screw.q
        if self.type == "prismatic":
            length = math.hypot(*(v or ()))
            return (0.0, 0.0, 0.0), tuple(x / length for x in v or ())
        length = math.hypot(*w)
        w = (w[0] / length, w[1] / length, w[2] / length)
        if v is None:
            v = cross(q or (0.0, 0.0, 0.0), w)
        else:  # the screw as a whole is scaled: (w, v) is one six-vector
            v = (v[0] / length, v[1] / length, v[2] / length)
            pitch = dot(v, w)
            v = (v[0] - pitch * w[0], v[1] - pitch * w[1], v[2] - pitch * w[2])
        return w, v


class RobotKeys(Model):
    """A robot file's keys, before `robot.RobotFile` holds them to the rules between them."""

    name: Annotated[str, Field(min_length=1, max_length=80)] = Field(description="The arm's name, one line.")
    description: str = Field("", description="Free text.")
    source: str = Field("", description="Where the numbers come from.")
    compared: str = Field("", description="What the geometry was compared with: a maker's figure, or only a URDF.")
    convention: Convention = Field(
        description="standard (Rz Tz Tx Rx) or modified (Craig: Rx Tx Rz Tz) DH, or screws; never guessed."
    )
    task: Task | None = Field(
        None, description="What `armkin ik` solves for. Absent: by structure; `armkin info` shows it."
    )
    pitch_offset: Angle = Field(
        0.0, description="Degrees added to the sum of the parallel joints' angles in the tasks with a pitch."
    )
    base: Base = Field(Base.model_construct(), description="Fixed frame before joint 1.")
    tool: Pose = Field(Pose.model_construct(), description="Fixed frame after the last joint: the TCP.")
    zero_pose: Pose | None = Field(
        None, description="Convention screws: the end frame in the base frame when all joints are 0."
    )
    joints: tuple[Joint, ...] = Field(
        description="The joints, from the base outwards.", min_length=1, max_length=MAX_JOINTS
    )
    motors: tuple[Motor, ...] | None = Field(
        None,
        description="Motors that are not one to one with joints, instead of the joints' drives.",
        min_length=1,
        max_length=MAX_MOTORS,
    )
    gripper: Gripper | None = Field(None, description="A servo or stepper with `open` and `closed`.")
    board: Board | None = Field(None, description="The controller, for `armkin send`.")
    poses: dict[Name, tuple[Value, ...]] | None = Field(
        None,
        description="Named joint values in degrees or mm, as {park: [0, 90, -90]}; `home` is always one.",
        max_length=MAX_POSES,
    )
    clearance: Size = Field(0.0, description="How far the arm keeps from every keep-out, in mm.")
    keep_out: KeepOut = Field((), description="Where the arm must not go: self, floors, boxes, capsules.")

    def motor_list(self) -> tuple[Motor, ...]:
        """The motors, whether they are written as `motors` or as the joints' drives; () if there are none."""
        if self.motors is not None:
            return self.motors
        motors = []
        for joint in self.joints:
            if (drive := joint.drive) is not None:
                keys = drive.model_fields_set | {"name", "joints"}
                motors.append(Motor.model_construct(keys, **dict(drive), name=joint.name, joints={joint.name: 1.0}))
        return tuple(motors)
