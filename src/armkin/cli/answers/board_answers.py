"""Answers about a board, and an arm on it: home, jog, status, setup, zero, grip, ports, flash."""

# No annotations as text here: a key that may be absent is known by NotRequired at run time.
from typing import Annotated, Literal, NotRequired, TypedDict

from armkin.board.json_summaries import Where
from armkin.cli.answers.shared_keys import Head

Port = Annotated[str, "the port that was used; sim: a simulated board"]


class Stands(Head, Where):
    """`home` and `jog`: where the arm stands after it."""

    port: Port


class LostSteps(TypedDict):
    """A switch that was met again, against the count that was held."""

    joint: Annotated[str, "name of the joint"]
    steps: Annotated[int | None, "by how many steps the count was ahead of the arm; null: the position was not known"]
    difference: Annotated[float | None, "the same at the joint [deg or mm]; null: the position was not known"]


class Home(Stands):
    """`home`: where the arm stands after it, and the steps that were lost before."""

    lost_steps: Annotated[
        NotRequired[list[LostSteps]],
        "one entry a joint that was homed; boards with armkin's firmware",
    ]


class StatusOfBoard(Stands):
    """`status`: what the board says."""

    board: Annotated[str, "kind of the board"]
    firmware: Annotated[str, "version of its firmware"]
    configured: Annotated[bool, "whether it is configured for this robot file"]
    state: Annotated[str, "what it does: idle, moving, holding, ..."]
    error: Annotated[str | None, "why the last session ended; null: it ended well"]
    drivers_on: Annotated[bool, "whether the steppers' drivers are switched on"]
    servo_pulses_on: Annotated[bool, "whether RC servos get their signal"]
    abort_input: Annotated[bool, "whether the abort input is active"]
    motor_power: Annotated[
        bool | None,
        "whether the motors have power; null: no input senses it, so a cut goes unnoticed",
    ]
    switches: Annotated[dict[str, bool], "level of each limit input: true is high"]
    boots: Annotated[int, "how often the board has started since its memory was last lost"]
    reset_cause: Annotated[int, "cause of the last start, a number of firmware/PROTOCOL.md"]


class StatusOfGrbl(Stands):
    """`status` of a board of kind grbl or klipper."""

    board: Annotated[str, "kind of the board"]
    firmware: Annotated[str, "its firmware, as it names itself"]
    state: Annotated[str, "the board's own word: idle, run, hold, alarm, ...; ready, shutdown, ..."]
    inputs: Annotated[str, "letters of the active inputs: limits X Y Z A B C, probe P, door D; Klipper tells none"]
    settings: Annotated[list[str], "settings that differ from the robot file, in words"]
    lost_because: Annotated[str | None, "why the position is lost, in words; null: it is not"]


class Servo(TypedDict):
    """What a bus servo says of itself."""

    name: Annotated[str, "name of the motor"]
    id: Annotated[int, "the servo's number on its bus"]
    torque: Annotated[bool, "whether its motor is on"]
    load_percent: Annotated[float, "load, in percent of its greatest torque"]
    voltage: Annotated[float, "supply voltage [V]"]
    temperature: Annotated[int, "temperature [deg C]"]
    errors: Annotated[list[str], "errors that it reports: voltage, angle sensor, overheating, overcurrent, overload"]


class StatusOfServos(Stands):
    """`status` of a board of kind feetech."""

    board: Annotated[str, "kind of the board"]
    firmware: Annotated[str, "what kind of servos they are"]
    servos: Annotated[list[Servo], "one entry a servo"]


class Difference(TypedDict):
    """A setting of a board that is not as the robot file wants it."""

    setting: Annotated[int, "its number: 100 is GRBL's $100"]
    what: Annotated[str, "what it sets, in words"]
    found: Annotated[float | None, "its value on the board; null: the board has no such setting"]
    wanted: Annotated[float, "value that the robot file asks for"]
    serious: Annotated[bool, "whether motion would be wrong or too fast; otherwise it is only slower"]


class Setup(Head):
    """`setup`: a board's settings against the robot file."""

    port: Port
    firmware: Annotated[str, "the board's firmware, as it names itself"]
    differences: Annotated[list[Difference], "settings that differ, as found, before anything was written"]
    written: Annotated[bool, "whether they were written to the board"]


class Option(TypedDict):
    """An option of Klipper's printer.cfg that is not as the robot file wants it."""

    setting: Annotated[str, "its section and name"]
    found: Annotated[str | None, "its value in the running configuration; null: it has none"]
    wanted: Annotated[str, "value that the robot file asks for"]


class SetupOfKlipper(Head):
    """`setup` of a board of kind klipper: the sections of printer.cfg."""

    port: Annotated[str | None, "the port that was used; null: nothing was compared"]
    firmware: Annotated[str | None, "the version that Klipper says; null: nothing was compared"]
    differences: Annotated[list[Option] | None, "options that differ; null: nothing was compared"]
    printer_cfg: Annotated[str, "the sections of printer.cfg that the arm needs, pins left open"]


class Zero(Head):
    """`zero`: where the zero of bus servos is."""

    port: Annotated[str | None, "the port that was used; null: none was needed"]
    counts: Annotated[list[int] | None, "counts of every servo in the pose given; null: with --from"]
    zero: Annotated[list[int | float], "counts of each motor where all joints are 0: `zero` of its drive"]
    gripper_zero: Annotated[int | float | None, "with --gripper or --from: the gripper's zero [counts]; else null"]
    limits: Annotated[NotRequired[list[list[float]]], "with --from: lower and upper limit of every joint [deg]"]
    invert: Annotated[NotRequired[list[bool]], "with --from: whether each drive turns the other way"]
    gripper_ends: Annotated[
        NotRequired[list[float] | None],
        "with --from: the gripper's value when open and when closed [deg]",
    ]


class GripOfServo(Head):
    """`grip` on a board without armkin's firmware."""

    port: Port
    gripper: Annotated[float, "where it came to rest, in its drive's degrees; of a spindle the S word that was sent"]
    target: Annotated[float, "where it was sent, in the same unit"]
    measured: Annotated[bool, "whether the servo measured it; false on GRBL, which measures nothing"]


class Grip(Head):
    """Where the gripper stands."""

    port: Port
    gripper: Annotated[float, "where it stands, in its drive's degrees (mm with a lead)"]
    counts: Annotated[int, "the same, as the board counts [pulses]"]


class Found(TypedDict):
    """A serial port."""

    device: Annotated[str, "name to give to --port"]
    description: Annotated[str, "what the system calls the device"]
    hardware: Annotated[str, "USB identifiers of the device, as the system gives them"]
    board: Annotated[str, "the board that it looks like; empty: unknown"]


class Ports(TypedDict):
    """Serial ports of this computer."""

    ports: Annotated[list[Found], "the serial ports, in the system's order"]


class Flash(TypedDict):
    """`flash --json`: what was written, and what the board then said."""

    board: Annotated[str, "kind of the board"]
    port: Annotated[str | None, "port on which the board answers; null: a Pico whose port has not come yet"]
    bytes: Annotated[int, "size of the program [bytes]"]
    uploader: Annotated[
        Literal["armkin", "avrdude", "UF2"],
        "what wrote it: armkin, avrdude, or the Pico's own boot drive (UF2)",
    ]
    firmware: Annotated[str | None, "version that the board then says; null: it was not asked, as `port` is null"]
