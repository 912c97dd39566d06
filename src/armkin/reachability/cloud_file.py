"""Writes a cloud of samples to a file chunk by chunk; after an error there is no file.

.csv  one row for each sample: joints [deg | mm], x, y, z [mm], measures; ten digits, at most nine decimals
.npz  arrays of doubles: joints (N, n) [deg | mm], position (N, 3) [mm], an array for each measure; joint_names
.ply  a point cloud for MeshLab, CloudCompare, Blender: x, y, z and the measures as floats
"""

from __future__ import annotations

import io
import os
import shutil
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import IO, TYPE_CHECKING

import numpy as np

from armkin.columns.joint_columns import joint_columns
from armkin.files import file_ending, write_whole
from armkin.formula.arrays import Array
from armkin.model import units

if TYPE_CHECKING:
    from armkin.model.arm import Arm

Write = Callable[[Array, Array, list[Array]], None]

_ENDS = (".csv", ".npz", ".ply")


def check_cloud(path: str) -> str:
    """The ending of a cloud's file; raises UsageError for another one."""
    return file_ending(path, "a cloud is", _ENDS)


@contextmanager
def open_cloud(path: str, arm: Arm, count: int, measures: Sequence[str]) -> Iterator[Write]:
    """The function that writes a chunk: joints (N, n) [rad | mm], tips (N, 3) [mm], measures (N,) each.

    count: samples in all. Raises FileError, after which there is no file.
    """
    writer = {".csv": _csv_writer, ".npz": _npz_writer, ".ply": _ply_writer}[check_cloud(path)]
    with write_whole(path, "wb") as file, writer(file, path, arm, count, measures) as write:
        yield write


@contextmanager
def _csv_writer(file: IO[bytes], path: str, arm: Arm, count: int, measures: Sequence[str]) -> Iterator[Write]:
    heading = [*joint_columns(arm.joint_names), "x", "y", "z", *measures]
    file.write(f"{','.join(heading)}\n".encode())
    row = ",".join(["%.10g"] * len(heading)) + "\n"

    def write(q: Array, tip: Array, values: list[Array]) -> None:
        table = np.round(np.column_stack([units.joints_out(arm, q), tip, *values]), 9) + 0.0  # + 0.0 turns -0 into 0
        for start in range(0, len(table), 4096):
            rows = table[start : start + 4096]
            file.write((row * len(rows) % tuple(rows.ravel().tolist())).encode())

    yield write


@contextmanager
def _ply_writer(file: IO[bytes], path: str, arm: Arm, count: int, measures: Sequence[str]) -> Iterator[Write]:
    lines = ["ply", "format binary_little_endian 1.0", f"comment {arm.name}, tip positions in mm, by armkin"]
    lines += [f"element vertex {count}", *(f"property float {name}" for name in ("x", "y", "z", *measures))]
    # the header must be ASCII, while the name of an arm may have other characters
    file.write("".join(f"{line}\n" for line in [*lines, "end_header"]).encode("ascii", "replace"))

    def write(q: Array, tip: Array, values: list[Array]) -> None:
        file.write(np.column_stack([tip, *values]).astype("<f4").tobytes())

    yield write


@contextmanager
def _npz_writer(file: IO[bytes], path: str, arm: Arm, count: int, measures: Sequence[str]) -> Iterator[Write]:
    """The writer of joints (count, n) [deg | mm], positions (count, 3) [mm] and measures (count,) for .npz files."""
    # a zip file takes one member after another, so each array is first written to an unnamed temporary file
    folder = os.path.dirname(os.path.realpath(path))
    shapes = {"joints": (count, arm.n), "position": (count, 3), **dict.fromkeys(measures, (count,))}
    with ExitStack() as stack:
        parts = {name: stack.enter_context(tempfile.TemporaryFile(dir=folder)) for name in shapes}

        def write(q: Array, tip: Array, values: list[Array]) -> None:
            for part, array in zip(parts.values(), [units.joints_out(arm, q), tip, *values], strict=True):
                part.write(np.ascontiguousarray(array, dtype="<f8").tobytes())

        yield write
        with zipfile.ZipFile(file, "w") as archive:
            with archive.open(_member("joint_names"), "w") as member:
                names = io.BytesIO()
                np.save(names, np.array(arm.joint_names))
                member.write(names.getvalue())
            for name, part in parts.items():
                part.seek(0)
                with archive.open(_member(name), "w", force_zip64=True) as member:
                    header = {"descr": "<f8", "fortran_order": False, "shape": shapes[name]}
                    np.lib.format.write_array_header_1_0(member, header)
                    shutil.copyfileobj(part, member, 1 << 20)


def _member(name: str) -> zipfile.ZipInfo:
    # a constant date gives identical files for identical samples
    return zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
