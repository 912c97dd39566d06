"""Robot files with one fault each, by name; their messages are in snapshots/robot_file_errors.txt."""

DH = """\
name: arm
convention: standard
task: xyz
base: {xyz: [0, 0, 0], rpy: [0, 0, 0]}
tool: {xyz: [0, 0, 0], rpy: [0, 0, 0]}
joints:
  - name: q1
    dh: {alpha: 90, a: 0, d: 170, theta: 0}
    limits: [-120, 120]
    home: 0
    max_speed: 60
    max_accel: 120
    drive: {axis: X, full_steps: 200, microsteps: 16, gear: 2.5, pulley: 4}
  - name: q2
    type: prismatic
    dh: {alpha: 0, a: 197, d: -10}
    sign: -1
    limits: [0, 120]
    max_speed: 20
    drive: {axis: Y, full_steps: 200, microsteps: 8, lead: 8}
    homing: {switch: Y, direction: -1, at: -2, speed: 10, backoff: 3, order: 1, normally: closed}
  - name: q3
    dh: {alpha: 0, a: 258, d: 0}
gripper: {kind: servo, axis: S0, travel: [0, 180], pulse_us: [500, 2500], open: 30, closed: 120}
board: {kind: uno_cnc_shield, driver: A4988}
"""

SCREWS = """\
name: arm
convention: screws
zero_pose: {xyz: [300, 0, 115]}
joints:
  - name: q1
    screw: {w: [0, 0, 1], v: [0, 0, 0]}
  - name: q2
    type: prismatic
    screw: {w: [0, 0, 0], v: [0, 0, 1]}
  - name: q3
    screw: {w: [0, -1, 0], q: [0, 0, 115]}
"""

MOTORS = """\
name: arm
convention: modified
joints:
  - name: J1
    dh: {alpha: 0, a: 0, d: 100}
  - name: J2
    dh: {alpha: 90, a: 0, d: 0}
  - name: J3
    type: prismatic
    dh: {alpha: 90, a: 0, d: 0}
motors:
  - {name: M1, axis: X, joints: {J1: 1, J2: 2}, full_steps: 200, microsteps: 16, gear: 5}
  - {name: M2, axis: Y, joints: {J1: -1, J2: 2}, full_steps: 200, microsteps: 16, gear: 5}
  - {name: M3, axis: Z, joints: {J3: 1}, full_steps: 200, microsteps: 16, lead: 8}
"""

SERVO = """\
name: arm
convention: standard
joints:
  - name: q1
    dh: {alpha: 90, a: 0, d: 115}
    limits: [-90, 90]
    drive: {kind: servo, axis: S0, travel: [0, 180], pulse_us: [500, 2500], zero: 90}
  - name: q2
    dh: {alpha: 0, a: 120, d: 0}
    drive: {kind: servo, axis: S1, travel: [0, 180], pulse_us: [500, 2500], zero: 90, invert: true}
board: {kind: uno_servos}
"""

VALID = {"DH": DH, "SCREWS": SCREWS, "MOTORS": MOTORS, "SERVO": SERVO}


def _edits() -> dict[str, tuple[str, str, str]]:
    """name: (file, what, by what)."""
    limits, drive, row = "[-120, 120]", "gear: 2.5, pulley: 4", "alpha: 90, a: 0, d: 170, theta: 0"
    return {
        # YAML 1.1's traps
        "teeth as 80:16": (DH, "gear: 2.5", "gear: 80:16"),
        "teeth as 16:80": (DH, "gear: 2.5", "gear: 16:80"),
        "base 60 with hours": (DH, "d: 170", "d: 1:30:00"),
        "octal": (DH, "microsteps: 16", "microsteps: 016"),
        "leading zero that is not octal": (DH, "home: 0", "home: 09"),
        "leading zero of a decimal": (DH, "home: 0", "home: -00.5"),
        "octal of YAML 1.2": (DH, "microsteps: 16", "microsteps: 0o20"),
        "hexadecimal": (DH, "microsteps: 16", "microsteps: 0x10"),
        "exponent without point": (DH, "max_speed: 60", "max_speed: 1e3"),
        "exponent without sign": (DH, "max_speed: 60", "max_speed: 1.5e3"),
        "negative without zero": (DH, "home: 0", "home: -.5"),
        "plus without zero": (DH, "home: 0", "home: +.5"),
        "underscores": (DH, "max_speed: 60", "max_speed: 1_000"),
        "not a number": (DH, "d: 170", "d: .nan"),
        "infinity": (DH, limits, "[-.inf, .inf]"),
        "infinity with a capital": (DH, limits, "[-120, .Inf]"),
        "overflow": (DH, "d: 170", "d: 1.0e+400"),
        "nan as a word": (DH, "d: 170", "d: nan"),
        "off": (DH, drive, f"{drive}, invert: off"),
        "Yes": (DH, drive, f"{drive}, invert: Yes"),
        "on as a key": (DH, "home: 0", "on: 0"),
        "date": (DH, "name: arm", "name: 2015-06-01"),
        "no value": (DH, "home: 0", "home:"),
        "null": (DH, "home: 0", "home: ~"),
        "null in a list": (DH, limits, "[-120, null]"),
        "duplicate key": (DH, "home: 0", "home: 0\n    home: 10"),
        "duplicate key at the top": (DH, "task: xyz", "task: xyz\nname: other"),
        "duplicate key in braces": (DH, "a: 0, d: 170", "a: 0, a: 10, d: 170"),
        "anchor": (DH, f"limits: {limits}", f"limits: &range {limits}"),
        "alias": (DH, f"limits: {limits}", "limits: *range"),
        "merge key": (DH, "home: 0", "<<: {home: 0}"),
        "tag": (DH, "d: 170", "d: !!float 170"),
        "python tag": (DH, "d: 170", "d: !!python/object/apply:os.system [id]"),
        "own tag": (DH, "d: 170", "d: !mm 170"),
        "number as a key": (DH, "home: 0", "1: 0"),
        "list as a key": (DH, "home: 0", "[1, 2]: 0"),
        "second document": (DH, "gripper:", "---\ngripper:"),
        "tab": (DH, "    home: 0", "\thome: 0"),
        "wrong indentation": (DH, "    home: 0", "   home: 0"),
        "colon without space": (DH, "home: 0", "home:0"),
        "colon in text": (DH, "name: arm", "name: arm: the second"),
        "open bracket": (DH, limits, "[-120, 120"),
        "open brace": (DH, f"{{{row}}}", f"{{{row}"),
        "open quote": (DH, "name: arm", "name: 'arm"),
        "percent": (DH, "name: arm", "name: %arm"),
        "terminal escape": (DH, "name: arm", 'name: "\\e[2Jarm"'),
        "control character": (DH, "name: arm", "name: a\x07rm"),
        "line separator": (DH, "name: arm", "name: a\u2028rm"),
        # keys
        "misspelt key": (DH, "limits:", "limit:"),
        "misspelt key in dh": (DH, "alpha: 90", "alfa: 90"),
        "synonym": (DH, "theta: 0", "offset: 0"),
        "long key of two lines": (DH, "home: 0", f'"home\\n{"x" * 300}": 0'),
        "long key without a value": (DH, "home: 0", f'"home\\n{"x" * 300}":'),
        "capital": (DH, "home: 0", "Home: 0"),
        "camel case": (DH, "max_speed: 60", "maxSpeed: 60"),
        "hyphen": (DH, "max_speed: 60", "max-speed: 60"),
        "key of another place": (DH, "home: 0", "alpha: 0"),
        "key of the joint in the drive": (DH, drive, f"{drive}, max_speed: 10"),
        "key of the top in a joint": (DH, "home: 0", "task: xyz"),
        "unheard-of key": (DH, "home: 0", "colour: red"),
        "unheard-of key at the top": (DH, "task: xyz", "units: mm"),
        "rpy as quaternion": (DH, "base: {xyz: [0, 0, 0], rpy:", "base: {xyz: [0, 0, 0], quat:"),
        # missing
        "no name": (DH, "name: arm\n", ""),
        "no convention": (DH, "convention: standard\n", ""),
        "no joint name": (DH, "  - name: q1\n    dh", "  - dh"),
        "no dh": (DH, f"    dh: {{{row}}}\n", ""),
        "no d": (DH, "a: 0, d: 170, theta: 0", "a: 0, theta: 0"),
        "empty dh": (DH, f"{{{row}}}", "{}"),
        "no full_steps": (DH, "full_steps: 200, microsteps: 16, ", ""),
        "no backoff": (DH, "backoff: 3, ", ""),
        # types
        "text for a number": (DH, "d: 170", "d: tall"),
        "number in quotes": (DH, "d: 170", "d: '170'"),
        "number with a unit": (DH, "d: 170", "d: 170mm"),
        "number in degrees": (DH, "alpha: 90", "alpha: 90°"),
        "number in centimetres": (DH, "d: 170", "d: 17 cm"),
        "decimal comma": (DH, "d: 170", "d: '170,5'"),
        "pi": (DH, "alpha: 90", "alpha: pi/2"),
        "boolean for a number": (DH, "d: 170", "d: true"),
        "list for a number": (DH, "d: 170", "d: [170]"),
        "mapping for a number": (DH, "home: 0", "home: {value: 0}"),
        "number for text": (DH, "name: arm", "name: 42"),
        "boolean for text": (DH, "name: arm", "name: true"),
        "number for a boolean": (DH, drive, f"{drive}, invert: 1"),
        "fraction for a whole number": (DH, "microsteps: 16", "microsteps: 16.5"),
        "point for a whole number": (DH, "microsteps: 16", "microsteps: 16.0"),
        "number for a list": (DH, limits, "120"),
        "text for a list": (DH, limits, "-120..120"),
        "one limit": (DH, limits, "[120]"),
        "no limits in the list": (DH, limits, "[]"),
        "three limits": (DH, limits, "[-120, 0, 120]"),
        "text in a list": (DH, limits, "[-120, wide]"),
        "two coordinates": (DH, "tool: {xyz: [0, 0, 0]", "tool: {xyz: [0, 0]"),
        "four coordinates": (DH, "tool: {xyz: [0, 0, 0]", "tool: {xyz: [0, 0, 0, 1]"),
        "list for a mapping": (DH, f"{{{row}}}", "[90, 0, 170, 0]"),
        "number for a mapping": (DH, "tool: {xyz: [0, 0, 0], rpy: [0, 0, 0]}", "tool: 120"),
        "joints in a mapping": (MOTORS, MOTORS[MOTORS.index("joints:") :], "joints: {J1: {dh: {a: 1}}}\n"),
        "joint as a word": (DH, "  - name: q3\n    dh: {alpha: 0, a: 258, d: 0}\n", "  - q3\n"),
        "empty joint name": (DH, "name: q1", 'name: ""'),
        "joint name with a space": (DH, "name: q1", "name: joint 1"),
        "joint name that begins with a digit": (DH, "name: q1", "name: 1st"),
        "joint name that is long": (DH, "name: q1", f"name: {'q' * 40}"),
        "joint name of two lines": (DH, "name: q1", 'name: "q\\n1"'),
        "joint name as a number": (DH, "name: q1", "name: 1"),
        "blank name": (DH, "name: arm", 'name: " "'),
        "empty name": (DH, "name: arm", 'name: ""'),
        "name of two lines": (DH, "name: arm", 'name: "arm\\nleg"'),
        "very long name": (DH, "name: arm", f"name: {'arm' * 40}"),
        # choices
        "misspelt convention": (DH, "convention: standard", "convention: standart"),
        "convention by its author": (DH, "convention: standard", "convention: craig"),
        "convention in capitals": (DH, "convention: standard", "convention: Standard"),
        "unheard-of convention": (DH, "convention: standard", "convention: hayati"),
        "unheard-of task": (DH, "task: xyz", "task: position"),
        "task with a hyphen": (DH, "task: xyz", "task: xyz-pitch"),
        "task none": (DH, "task: xyz", "task: none"),
        "joint type": (DH, "type: prismatic", "type: linear"),
        "board": (DH, "kind: uno_cnc_shield", "kind: uno"),
        "driver": (DH, "driver: A4988", "driver: a4988"),
        "drive kind": (DH, "{axis: X,", "{kind: dc, axis: X,"),
        "switch that is normally": (DH, "normally: closed", "normally: nc"),
        # bounds
        "huge length": (DH, "d: 170", "d: 1.0e+300"),
        "too large a length": (DH, "d: 170", "d: 20000000"),
        "huge angle": (DH, "alpha: 90", "alpha: -2000000"),
        "huge integer": (DH, "d: 170", f"d: {'9' * 400}"),
        "sign 0": (DH, "sign: -1", "sign: 0"),
        "sign 2": (DH, "sign: -1", "sign: 2"),
        "sign true": (DH, "sign: -1", "sign: true"),
        "sign as text": (DH, "sign: -1", "sign: '-'"),
        "gear 0": (DH, "gear: 2.5", "gear: 0"),
        "gear below 0": (DH, "gear: 2.5", "gear: -2.5"),
        "gear huge": (DH, "gear: 2.5", "gear: 1.0e+9"),
        "pulley 0": (DH, "pulley: 4", "pulley: 0.0"),
        "teeth 0": (DH, "gear: 2.5", "gear: {motor: 0, joint: 80}"),
        "teeth of one wheel": (DH, "gear: 2.5", "gear: {motor: 16}"),
        "teeth with a typo": (DH, "gear: 2.5", "gear: {motor: 16, joints: 80}"),
        "teeth that are fractions": (DH, "gear: 2.5", "gear: {motor: 16.5, joint: 80}"),
        "teeth as a fraction": (DH, "gear: 2.5", "gear: 80/16"),
        "teeth as a list": (DH, "gear: 2.5", "gear: [16, 80]"),
        "microsteps 0": (DH, "microsteps: 16", "microsteps: 0"),
        "full_steps below 0": (DH, "full_steps: 200", "full_steps: -200"),
        "lead 0": (DH, "lead: 8", "lead: 0"),
        "speed 0": (DH, "max_speed: 60", "max_speed: 0"),
        "acceleration below 0": (DH, "max_accel: 120", "max_accel: -120"),
        "pulses beyond counting": (DH, "gear: 2.5", "gear: 1000000"),
        # rules between values
        "limits reversed": (DH, limits, "[120, -120]"),
        "limits equal": (DH, limits, "[30, 30]"),
        "home outside limits": (DH, "home: 0", "home: 150"),
        "absent home outside limits": (DH, "limits: [0, 120]", "limits: [10, 120]"),
        "joint twice": (DH, "name: q3", "name: q1"),
        "axis twice": (DH, "axis: Y", "axis: X"),
        "axis that the board has not": (DH, "axis: Y", "axis: E0"),
        "stepper on a servo axis": (DH, "axis: Y", "axis: S0"),
        "servo axis that the board has not": (DH, "axis: S0", "axis: S3"),
        "screw with convention standard": (DH, f"dh: {{{row}}}", "screw: {w: [0, 0, 1], v: [0, 0, 0]}"),
        "zero_pose with convention standard": (DH, "task: xyz", "task: xyz\nzero_pose: {xyz: [1, 0, 0]}"),
        "pitch_offset without a pitch": (DH, "task: xyz", "task: xyz\npitch_offset: 90"),
        "prismatic stepper without lead": (DH, ", lead: 8", ""),
        "lead of a revolute joint": (DH, drive, "lead: 8"),
        "stepper with travel": (DH, drive, "travel: [0, 180]"),
        "homing switch that the board has not": (DH, "switch: Y", "switch: Y_MIN"),
        "gripper speed 0": (DH, "closed: 120", "closed: 120, max_speed: 0"),
        "abort input": (DH, "driver: A4988", "driver: A4988, abort: nc"),
        "homing direction 0": (DH, "direction: -1", "direction: 0"),
        "homing direction as text": (DH, "direction: -1", "direction: left"),
        "homing faster than the joint": (DH, "speed: 10", "speed: 30"),
        "gripper that does not move": (DH, "open: 30, closed: 120", "open: 30, closed: 30"),
        "gripper without closed": (DH, "open: 30, closed: 120", "open: 30"),
        "gripper beyond its travel": (DH, "closed: 120", "closed: 200"),
        "gripper without pulse widths": (DH, "pulse_us: [500, 2500], ", ""),
        "dh with convention screws": (SCREWS, "screw: {w: [0, 0, 1], v: [0, 0, 0]}", f"dh: {{{row}}}"),
        "screws without zero_pose": (SCREWS, "zero_pose: {xyz: [300, 0, 115]}\n", ""),
        "screw that is missing": (SCREWS, "    screw: {w: [0, 0, 1], v: [0, 0, 0]}\n", ""),
        "w too long": (SCREWS, "w: [0, 0, 1]", "w: [0, 1, 1]"),
        "w zero": (SCREWS, "w: [0, 0, 1]", "w: [0, 0, 0]"),
        "v with a pitch": (SCREWS, "v: [0, 0, 0]", "v: [0, 0, 10]"),
        "v and q": (SCREWS, "q: [0, 0, 115]", "q: [0, 0, 115], v: [115, 0, 0]"),
        "neither v nor q": (SCREWS, ", q: [0, 0, 115]", ""),
        "prismatic with w": (SCREWS, "w: [0, 0, 0]", "w: [0, 0, 1]"),
        "prismatic with q": (SCREWS, "v: [0, 0, 1]", "q: [0, 0, 1]"),
        "prismatic v too short": (SCREWS, "v: [0, 0, 1]", "v: [0, 0, 0.5]"),
        "prismatic v zero": (SCREWS, "v: [0, 0, 1]", "v: [0, 0, 0]"),
        "screw without w": (SCREWS, "w: [0, 0, 1], ", ""),
        "motor of an unknown joint": (MOTORS, "joints: {J3: 1}", "joints: {J4: 1}"),
        "motor twice": (MOTORS, "name: M2", "name: M1"),
        "motor of no joint": (MOTORS, "joints: {J3: 1}", "joints: {}"),
        "motor with a list of joints": (MOTORS, "joints: {J3: 1}", "joints: [J3]"),
        "motor with weight 0": (MOTORS, "{J1: 1, J2: 2}", "{J1: 1, J2: 0}"),
        "motor with a weight of next to nothing": (MOTORS, "{J1: 1, J2: 2}", "{J1: 1, J2: -5.0e-324}"),
        "motor with a weight in text": (MOTORS, "{J1: 1, J2: 2}", "{J1: 1, J2: two}"),
        "motors that do not suffice": (MOTORS, "{J1: -1, J2: 2}", "{J1: 2, J2: 4}"),
        "motors and a drive": (
            MOTORS,
            "d: 100}",
            "d: 100}\n    drive: {axis: A, full_steps: 200, microsteps: 1}",
        ),
        "lead of a mixed motor": (MOTORS, "joints: {J3: 1}", "joints: {J3: 1, J1: 1}"),
        "prismatic motor without lead": (MOTORS, ", lead: 8", ""),
        "motors empty": (MOTORS, MOTORS[MOTORS.index("motors:") :], "motors: []\n"),
        "motor without a name": (MOTORS, "name: M3, ", ""),
        "servo without travel": (SERVO, "travel: [0, 180], ", ""),
        "servo with microsteps": (SERVO, "zero: 90}", "zero: 90, microsteps: 16}"),
        "servo travel reversed": (SERVO, "travel: [0, 180]", "travel: [180, 0]"),
        "servo pulses reversed": (SERVO, "[500, 2500]", "[2500, 500]"),
        "servo pulses in milliseconds": (SERVO, "[500, 2500]", "[0.5, 2.5]"),
        "servo pulses too wide": (SERVO, "[500, 2500]", "[500, 25000]"),
        "servo that cannot reach a limit": (SERVO, "limits: [-90, 90]", "limits: [-90, 120]"),
        "servo that cannot reach home": (SERVO, "    limits: [-90, 90]\n", "    home: 120\n"),
        "servo on a prismatic joint": (SERVO, "  - name: q1\n", "  - name: q1\n    type: prismatic\n"),
        "servo with homing": (
            SERVO,
            "    limits: [-90, 90]\n",
            "    homing: {switch: X, direction: 1, at: 0, speed: 1, backoff: 1, normally: open}\n",
        ),
        "stepper on a servo board": (SERVO, "kind: servo, axis: S0, travel", "axis: S0, travel"),
        "driver of a servo board": (SERVO, "{kind: uno_servos}", "{kind: uno_servos, driver: A4988}"),
        # several at once
        "two problems": (DH, "home: 0\n    max_speed: 60", "home: tall\n    max_speed: -60"),
        "many problems": (DH, "a: ", "aa: "),
    }


def _edit_text(text: str, before: str, after: str) -> str:
    assert before in text, before
    return text.replace(before, after) if before == "a: " else text.replace(before, after, 1)


def _joint_rows(count: int) -> str:
    head = "name: arm\nconvention: standard\njoints:"
    rows = [f"\n  - {{name: q{i}, dh: {{alpha: 0, a: 10, d: 0}}}}" for i in range(count)]
    return head + ("".join(rows) or " []") + "\n"


def _motor_rows(count: int) -> str:
    row = "{{name: M{0}, joints: {{q{0}: 1}}, full_steps: 200, microsteps: 1}}"
    rows = "".join(f"  - {row.format(i)}\n" for i in range(count))
    return f"{_joint_rows(1)}motors:\n{rows}"


def hostile_files() -> dict[str, bytes]:
    """Every hostile file by its name."""
    texts = {name: _edit_text(*edit).encode() for name, edit in _edits().items()}
    bomb = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"{chr(98 + i)}: &{chr(98 + i)} [{', '.join([f'*{chr(97 + i)}'] * 9)}]\n" for i in range(9)
    )
    return texts | {
        "0 joints": _joint_rows(0).encode(),
        "13 joints": _joint_rows(13).encode(),
        "1000 joints": _joint_rows(1000).encode(),
        "empty file": b"",
        "blanks": b" \n\n  \n",
        "comments only": b"# name: arm\n",
        "end mark only": b"---\n...\n",
        "null document": b"--- ~\n",
        "one word": b"arm\n",
        "one number": b"42\n",
        "25 motors": _motor_rows(25).encode(),
        "1000 motors": _motor_rows(1000).encode(),
        "weights of 100 joints": MOTORS.replace(
            "joints: {J3: 1}", f"joints: {{{', '.join(f'J{i}: 1' for i in range(100))}}}"
        ).encode(),
        "a thousand unknown keys": b"".join(b"k%d: 1\n" % i for i in range(1000)),
        "a list": b"- name: arm\n- convention: standard\n",
        "an empty mapping": b"{}\n",
        "byte order mark alone": b"\xef\xbb\xbf",
        "UTF-16": DH.encode("utf-16"),
        "Latin-1": DH.replace("name: arm", "name: Gelenk für Übung").encode("latin-1"),
        "half a character": DH.encode() + b"\xc3",
        "zero bytes": b"\x00" * 100,
        "an ELF file": b"\x7fELF\x02\x01\x01" + bytes(range(256)),
        "a PNG file": b"\x89PNG\r\n\x1a\n" + bytes(range(256)),
        "a JSON list": b'[{"name": "arm"}]',
        "a URDF file": b'<?xml version="1.0"?>\n<robot name="arm">\n</robot>\n',
        "a Python file": b"import os\n\nos.system('id')\n",
        "billion laughs": bomb.encode(),
        "deep lists": b"a: " + b"[" * 100_000,
        "deep mappings": b"a: " + b"{a: " * 50_000,
        "deep block": "".join(f"{' ' * i}a:\n" for i in range(200)).encode(),
        "too many values": b"a: [" + b"1, " * 20_000 + b"1]\n",
        "too many keys": b"".join(b"k%d: 1\n" % i for i in range(20_000)),
        "too large": DH.encode() + b"# padding\n" * 30_000,
        "one endless word": b"a" * 200_000,
        "one endless number": b"name: " + b"1" * 200_000,
        "endless question marks": b"? " * 100_000,
        "endless dashes": b"- " * 100_000,
    }
