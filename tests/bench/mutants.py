"""How many deliberate errors the quick tests catch: 32 mutants over the rooms, one at a time, in a copy of the tree.

    python tests/bench/mutants.py [NUMBER ...]    # all, or only these; prints "caught 30 of 32"

A mutant is caught if a quick test of its room fails (`-m "not slow and not emulator"`); what survives there is run
against the room's slow tests, too. Signs, off by one, swapped units, dropped checks.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Mutant:
    """An error: the text it replaces in a file of src/armkin, and where tests of it stand."""

    file: str
    right: str
    wrong: str
    tests: str


MUTANTS = [
    Mutant(
        "model/build_arm.py", "[0, ca, -sa, 0], [0, sa, ca, 0]", "[0, ca, sa, 0], [0, -sa, ca, 0]", "test_published.py"
    ),
    Mutant("model/units.py", "dtype=float) * joint_scale(arm)", "dtype=float) / joint_scale(arm)", "test_published.py"),
    Mutant("motors.py", "(0.5 + tolerance)", "tolerance", "test_motors.py"),
    Mutant("robot_file/strict_yaml.py", "    if text in parent.items:", "    if text in parent.items and False:",
           "robot_file"),
    Mutant("inverse/branches/whole_turns.py", "(value >= low) & (value <= high)", "(value >= low)",
           "inverse/test_turns.py"),
    Mutant("inverse/branches/whole_turns.py", "upper >= first + TURN) or low", "upper >= first) or low",
           "inverse/test_turns.py inverse/test_single.py"),
    Mutant("board/firmware/wire/framing.py",
           " if struct.unpack(\"<I\", unstuffed[-4:])[0] == zlib.crc32(payload) else None", "",
           "board/test_protocol.py board/test_board_sim.py"),
    Mutant("board/firmware/jogging.py", "rate**2 / (2.0 *", "rate**2 / (4.0 *", "board keep_out"),
    Mutant("motion/timing/profile.py", "min(speed, math.sqrt(accel * length))",
           "min(speed, math.sqrt(2 * accel * length))", "motion board"),
    Mutant("keep_out/shapes/capsule.py", "np.clip(share, 0.0, 1.0)", "np.minimum(share, 1.0)", "keep_out"),
    Mutant("keep_out/shapes/capsule.py", "segment_distance(a, b, *ends) - self.radius",
           "segment_distance(a, b, *ends)", "keep_out"),
    Mutant("path_file/gcode.py", "self.feed / 60", "self.feed", "path_file"),
    Mutant("teach/page_key.py", "if not hmac.compare_digest(", "if False and not hmac.compare_digest(", "teach"),
    Mutant("flash/firmware_images.py", "if sums.get(path.name) != ", "if sums.get(path.name) == '' != ", "flash"),
    Mutant("flash/intel_hex.py", "or sum(record) % 256", "", "flash"),
    Mutant("flash/stk500v1.py", " or answer[-1] != _OK", "", "flash firmware/test_flash.py"),
    Mutant("export/urdf_writer.py", "_real_text(x / METRE)", "_real_text(x * METRE)", "export robot_file"),
    Mutant("reachability/reach_cells.py", "(3.0 - math.sqrt(5.0))", "(2.0 - math.sqrt(5.0))", "reachability"),
    Mutant("columns/csv_cells.py", "'\"' + text.replace('\"', '\"\"') + '\"'", "'\"' + text + '\"'",
           "columns test_doctests.py cli"),
    Mutant("calibration/dropped_rows.py", "/ K**2) ** -2)", "/ K**2) ** 0)", "calibration"),
    Mutant("compiled/toolchain.py", "return owner and not", "return not", "compiled"),
    Mutant("cli/exit_codes.py", "NO_SOLUTION = 3\nROBOT_FILE = 4", "NO_SOLUTION = 4\nROBOT_FILE = 3",
           "cli/test_cli_errors.py cli/test_cli_commands.py"),
    Mutant("motion/timing/limit_jerk.py", "(2 * accel / np.asarray", "(accel / np.asarray", "motion"),
    Mutant("keep_out/motion_proof.py", "(clearances[:-1] + clearances[1:] - motions) / 2",
           "(clearances[:-1] + clearances[1:]) / 2", "keep_out"),
    Mutant("motion/tool_path/corner_blend.py", "omega - np.cross(w, omega) / 2", "omega + np.cross(w, omega) / 2",
           "motion"),
    Mutant("path_file/svg_shapes.py", "0.0) if kind == \"skewX\" else", "0.0) if kind == \"skewY\" else", "path_file"),
    Mutant("board/grbl/trajectory_to_gcode.py", "max(60 * speed, MIN_FEED)", "max(speed, MIN_FEED)", "board"),
    Mutant("board/feetech/packet.py", "bytes([~sum(body) & 0xFF])", "bytes([sum(body) & 0xFF])",
           "board/test_feetech_bus.py"),
    Mutant("robot_file/urdf_reader.py", "(cr, sr), (cp, sp), (cy, sy)", "(cy, sy), (cp, sp), (cr, sr)", "robot_file"),
    Mutant("forward.py", "arrays.cross(z, lever)", "arrays.cross(lever, z)", "inverse/test_kinematics.py"),
    Mutant("inverse/choose_branch.py", "not branch.within_limits, hit, angle", "not branch.within_limits, angle, hit",
           "keep_out inverse/test_position_first.py"),
    Mutant("columns/finished_chunks.py", "if earlier_job.get(name) != self.job.get(name)", "if name not in earlier_job",
           "columns"),
]  # fmt: skip
QUICK = ["-m", "not slow and not emulator"]


def catching_test(mutant: Mutant, tree: Path, options: list[str]) -> str | None:
    """The first test that fails in a tree with that error; None: nothing does."""
    path = tree / "src" / "armkin" / mutant.file
    text = path.read_text(encoding="utf-8")
    if text.count(mutant.right) != 1:
        raise SystemExit(f"{mutant.file} no longer holds {mutant.right!r} once: mend the mutant")
    path.write_text(text.replace(mutant.right, mutant.wrong), encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-x", "-p", "no:cacheprovider", *options]
    command += [f"tests/{name}" for name in mutant.tests.split()]
    finds = {**os.environ, "PYTHONPATH": str(tree / "src")}
    try:
        completed = subprocess.run(command, cwd=tree, env=finds, capture_output=True, text=True, check=False)
    finally:
        path.write_text(text, encoding="utf-8")
    if completed.returncode in (0, 5):  # 5: the room has no such tests
        return None
    failed = [line for line in completed.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return failed[0][:110] if failed else completed.stdout[-200:]


def main() -> None:
    """Print a line a mutant, and the count."""
    wanted = [int(word) for word in sys.argv[1:]] or range(1, len(MUTANTS) + 1)
    quick = slow = 0
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        left = shutil.ignore_patterns(".git", "node_modules", "dist", "site", "build", "__pycache__")
        shutil.copytree(ROOT, tree, ignore=left, symlinks=True)
        if (ROOT / "node_modules").exists():
            (tree / "node_modules").symlink_to((ROOT / "node_modules").resolve())
        for number in wanted:
            mutant = MUTANTS[number - 1]
            by = catching_test(mutant, tree, QUICK)
            quick += by is not None
            if by is None and (by := catching_test(mutant, tree, ["-m", "slow and not emulator"])) is not None:
                slow += 1
                by = f"slow: {by}"
            print(f"{number:2} {mutant.file}: {mutant.wrong.strip() or 'dropped'}: {by or 'SURVIVES'}", flush=True)
    print(f"caught {quick} of {len(list(wanted))} by quick tests, {slow} more by slow ones")


if __name__ == "__main__":
    main()
