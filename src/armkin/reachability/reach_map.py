"""`armkin.reach`: a map of reached positions, with share of orientations, number of branches, and measures."""

from __future__ import annotations

import io
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from armkin import __version__
from armkin.columns import npz
from armkin.columns.finished_chunks import Parts
from armkin.columns.formats import format_of
from armkin.columns.parquet import require_pyarrow
from armkin.columns.table import Table
from armkin.engines.ordered_chunks import Engine
from armkin.errors import UsageError
from armkin.files import check_writable, file_ending, write_whole
from armkin.formula.arrays import Array
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.model.arm import actual_arm
from armkin.model.units import TURN
from armkin.reachability import kept_chunks
from armkin.reachability.cell_answers import CellQuestion, cell_columns
from armkin.reachability.reach_cells import Grid

if TYPE_CHECKING:
    from armkin.model.arm import Arm

CHUNK_SOLVES = 40_000  # solves of a chunk: about a second with all measures and a closed form
ELIMINATION_COST = 40  # cost of a solve by elimination, in solves by a closed form
FAMILY_COST = 1_000  # cost of a solve whose answers are curves, in solves by a closed form
BLOCK_SOLVES = 2_048  # solves made together, so that their words fit the cache
KEPT_CELLS = 5_000_000  # most cells that a result holds as arrays if there is a file
UNITS = {
    "x_mm": "mm", "y_mm": "mm", "z_mm": "mm", "share": "1", "share_any": "1", "branches": "1", "single": "1",
    "manipulability": "mm^k", "limit_margin": "1", "step_error_mm": "mm",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Reach:
    """Columns by name, one row a cell, and what they come to; `units` has each column's unit.

    Each column is an attribute, too, (cells,). x_mm, y_mm, z_mm: the cell's centre in the frame of targets. share,
    share_any: of its orientations, reached within limits, and limits and keep-outs apart. branches: legal ones, mean
    over reached orientations. single: share that exactly one legal branch reaches. manipulability (of the tip, as
    `workspace` measures it), limit_margin: best, step_error_mm: least over all legal answers. nan where no orientation
    is reached, or nothing is to be measured.

    Attributes:
        grid: which cells and orientations were asked.
        columns: name -> (cells,); empty where they are in a file alone, beyond 5,000,000 cells.
        method: "arcs" where one solve answers a whole ring, else "poses".
        cells: how many there are.
        answers: cells times orientations.
        solves: targets that were solved for them.
        reached: cells of which some orientation is reached within limits.
        volume_mm3: [mm3] of these cells.
        seconds: [s] that it took.
    """

    grid: Grid
    columns: dict[str, Array]  # empty where they are in a file alone
    method: str  # "arcs" | "poses"
    cells: int
    answers: int
    solves: int
    reached: int
    volume_mm3: float
    seconds: float
    units = UNITS

    def __getattr__(self, name: str) -> Array:
        if name in UNITS and name in self.__dict__.get("columns", ()):
            column: Array = self.columns[name]
            return column
        raise AttributeError(f"Reach has no '{name}'; its columns are {', '.join(UNITS)}")

    @property
    def orientations(self) -> int:
        """Number of orientations of a cell."""
        return self.grid.orientations


class RingChunk(NamedTuple):
    """Some rings, with the index of the chunk."""

    number: int
    rings: Array


def reach(
    arm: Arm,
    *,
    grid: float = 50.0,
    azimuths: int = 36,
    directions: int = 100,
    rolls: int = 12,
    tool_down: bool = False,
    measures: bool = True,
    out: str | os.PathLike[str] | None = None,
    workers: int = 1,
    cluster: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> Reach:
    """Ask every cell of a grid about joint 1's axis for every orientation; cells: `armkin.reachability.reach_cells`.

    Args:
        arm: the arm, as `armkin.load` gives it.
        grid: [mm] height and radial width of a cell.
        azimuths: cells of a ring.
        directions: directions of the tool's z axis (or pitches, yaws) that are asked of each cell.
        rolls: turns about that axis that are asked of each direction.
        tool_down: straight down is the only direction.
        measures: False leaves the columns nan that need Jacobians.
        out: a .npz, .parquet or .csv file of all columns; run again after a kill, it goes on.
        workers: processes of this machine.
        cluster: address of a Dask scheduler, tcp://HOST:PORT, in place of workers.
        progress: called with the number of cells done.

    Returns:
        The map, (cells,) a column.

    Raises:
        UsageError: a number is out of range, no cell is within reach, no task fits the arm, out has another ending, or
            parts of another question stand beside it.
        FileError: the file cannot be written, or another run works on it.
        MissingExtraError: .parquet without pyarrow, a cluster without Dask.
        ClusterError: the cluster cannot be reached, or a worker fails.

    >>> import armkin
    >>> found = armkin.reach(armkin.load("robots/three_dof.yaml"), grid=100.0, azimuths=12)
    >>> found.method, found.cells, found.reached
    ('arcs', 744, 200)
    """
    start_time = time.perf_counter()
    cells = Grid(
        arm=arm,
        step=float(grid),
        azimuths=int(azimuths),
        directions=int(directions),
        rolls=int(rolls),
        tool_down=bool(tool_down),
    )
    question = CellQuestion(cells, measures)
    rings = question.grid.rings
    if not len(rings):
        raise UsageError(f"grid: {grid:g} mm: no cell within a reach of {arm.reach:.0f} mm; take a finer grid")
    run = _Run(question, None if out is None else os.fspath(out), Engine(workers, cluster), progress)
    columns = run.answer_all(list(chunks(question)))
    return Reach(
        grid=question.grid,
        columns=columns,
        method="arcs" if question.by_arcs else "poses",
        cells=len(rings) * question.grid.azimuths,
        answers=len(rings) * question.grid.azimuths * question.grid.orientations,
        solves=run.solves,
        reached=run.reached,
        volume_mm3=run.volume,
        seconds=time.perf_counter() - start_time,
    )


def chunks(question: CellQuestion) -> Iterator[RingChunk]:
    """All rings in chunks, the same for every engine."""
    rings = question.grid.rings
    rings_each = max(CHUNK_SOLVES // _cost(question) // question.solves_a_ring, 1)
    for number, start in enumerate(range(0, len(rings), rings_each)):
        yield RingChunk(number, rings[start : start + rings_each])


def _cost(question: CellQuestion) -> int:
    """How many times as long as by a closed form a solve takes, roughly."""
    arm, task = question.grid.arm, question.grid.task
    if arm.n > task.constraints:
        return FAMILY_COST
    return 1 if solver(actual_arm(arm), task.name)[1].pairs is not None else ELIMINATION_COST


def answer_chunk(question: CellQuestion, chunk: RingChunk) -> tuple[int, Table]:
    """The columns of a chunk; a pure function, whose result does not depend on the engine."""
    grid, M = question.grid, question.grid.azimuths
    rings_each = max(BLOCK_SOLVES // question.solves_a_ring, 1)
    parts = [cell_columns(question, chunk.rings[i : i + rings_each]) for i in range(0, len(chunk.rings), rings_each)]
    cells = len(chunk.rings) * M
    ring = np.repeat(chunk.rings, M, axis=0)
    positions = grid.positions(ring, np.tile(np.arange(M) * (TURN / M), len(chunk.rings)))
    table: Table = {f"{name}_mm": np.ascontiguousarray(positions[:, i]) + 0.0 for i, name in enumerate("xyz")}
    for name in [name for name in UNITS if name not in table]:
        table[name] = np.concatenate([part[name] for part in parts]) if name in parts[0] else np.full(cells, np.nan)
    return chunk.number, table


class _Run:
    """The making of a map: its chunks, its file, and its sums."""

    def __init__(
        self, question: CellQuestion, out: str | None, engine: Engine, progress: Callable[[int], None] | None
    ) -> None:
        self.question, self.out = question, out
        self.engine, self.progress = engine, progress
        self.cells = self.reached = self.solves = 0
        self.volume = 0.0
        self.parts: Parts | None = None
        if out is not None:
            end = file_ending(out, "a map is", (".npz", ".parquet", ".csv"))
            check_writable(out)
            if end == ".parquet":
                require_pyarrow()
            self.parts = Parts(out, _dependencies(question))

    def answer_all(self, all_chunks: list[RingChunk]) -> dict[str, Array]:
        """Compute all chunks and return the columns; empty if they are in a file and too many."""
        kept_tables: dict[int, Table] = {}
        cells = sum(len(chunk.rings) for chunk in all_chunks) * self.question.grid.azimuths
        keeps_tables = self.parts is None or cells <= KEPT_CELLS
        with kept_chunks.hold_parts(self.parts, len(all_chunks)):
            for number, columns in kept_chunks.chunk_tables(
                self.engine, answer_chunk, self.question, all_chunks, self.parts
            ):
                self._count(all_chunks[number], columns)
                if keeps_tables:
                    kept_tables[number] = columns
            if self.out is not None:
                self._write(len(all_chunks), kept_tables)
        tables = [kept_tables[number] for number in sorted(kept_tables)]
        return {name: np.concatenate([np.asarray(t[name]) for t in tables]) for name in UNITS} if keeps_tables else {}

    def _count(self, chunk: RingChunk, table: Table) -> None:
        grid = self.question.grid
        is_reached = np.asarray(table["share"]) > 0
        radius = np.repeat((chunk.rings[:, 0] + 0.5) * grid.step, grid.azimuths)
        self.volume += float(radius[is_reached].sum()) * grid.step**2 * TURN / grid.azimuths
        self.reached += int(is_reached.sum())
        self.solves += len(chunk.rings) * self.question.solves_a_ring
        self.cells += len(is_reached)
        if self.progress is not None:
            self.progress(self.cells)

    def _write(self, count: int, kept_tables: dict[int, Table]) -> None:
        """Write all cells to the file that was named, chunk after chunk; what was kept beside it goes."""
        assert self.out is not None
        assert self.parts is not None
        file_format, parts = format_of(self.out), self.parts

        is_npz = file_format.name == "npz"

        def tables() -> Iterator[Any]:
            for number in range(count):
                encoded = parts.read(number) if parts.is_held else npz.encode_table(kept_tables[number])
                yield io.BytesIO(encoded if is_npz else file_format.encoded(npz.decode_table(encoded)))

        with write_whole(self.out, "wb") as file:
            if file_format.name == "csv":
                file.write((",".join(UNITS) + "\n").encode())
            file_format.write_parts(file, tables)
        if parts.is_held:
            parts.remove()


def _dependencies(question: CellQuestion) -> dict[str, Any]:
    """The inputs that the columns depend on."""
    grid, arm = question.grid, question.grid.arm
    names = ("step", "azimuths", "directions", "rolls", "tool_down")
    settings = {("grid" if name == "step" else name): getattr(grid, name) for name in names}
    arm_is = {"robot file": arm.sha256, "scene": arm.scene_sha256, "joints": arm.n, "reach": arm.reach}
    return {"command": "reach", "armkin": __version__, **arm_is, **settings, "measures": question.measures}
