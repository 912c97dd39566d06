"""Finished chunks of a long command in a folder beside its file, FILE.parts: a later run goes on with them.

A part is one whole file: a line of JSON about it, then its bytes. It is written aside, flushed to the disk and renamed,
so that a part that is there is whole, whatever ended the run. `job.json` says what was asked: parts of another job are
never mixed in. `lock` keeps two runs from one folder, and the system opens it when its run ends, however that ends.
"""

import errno
import hashlib
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from armkin.errors import FileError, UnfinishedError, UsageError

HANDED_ON = 2.0  # time [s] until the processes of a run that was killed have ended, too
_UNFINISHED = ".writing"  # ending of the name of what is not whole yet


class Parts:
    """The parts of one file."""

    def __init__(self, path: str, job: Mapping[str, Any]) -> None:
        """path: of the file; job: what was asked, by names that a message can tell; values of JSON."""
        self.path = path
        self.folder = Path(f"{os.path.realpath(path)}.parts")
        self.job = {name: json.loads(json.dumps(value)) for name, value in job.items()}
        self._lock: Any = None

    @property
    def is_begun(self) -> bool:
        """Whether there is such a folder."""
        return self.folder.is_dir()

    @property
    def has_any(self) -> bool:
        """Whether a part is finished."""
        return any(self.folder.glob("[0-9]*[0-9]"))

    @property
    def is_held(self) -> bool:
        """Whether this run has the folder."""
        return self._lock is not None

    def refuse_begun(self) -> None:
        """Raise UnfinishedError if an earlier run has left its parts."""
        if self.is_begun:
            raise UnfinishedError(
                f"{self.path}.parts holds what an earlier run has finished", file=self.path, parts=str(self.folder)
            )

    def begin(self) -> None:
        """Take the folder, making it if there is none, and sweep what a killed run has left half written.

        Raises UsageError if its parts are of another job, FileError if another run has the folder.
        """
        from filelock import FileLock, Timeout

        with self._errors():
            self.folder.mkdir(exist_ok=True)
            lock = FileLock(self.folder / "lock")
            try:
                lock.acquire(timeout=HANDED_ON)
            except Timeout:
                raise FileError(f"{self.path}.parts: another run works on it", file=self.path) from None
            self._lock = lock
            try:
                self._check_job()
            except BaseException:
                self.leave()
                raise
            self._sweep()

    def _check_job(self) -> None:
        """Note what is asked, or raise UsageError where the parts on disk belong to another question."""
        place = self.folder / "job.json"
        try:
            earlier_job = json.loads(place.read_text("utf-8"))
        except FileNotFoundError:
            self._write(place, json.dumps(self.job).encode())
            return
        except ValueError:
            raise FileError(f"{place}: this is no job of armkin's; remove {self.folder}", file=str(place)) from None
        differing_names = [name for name in {**earlier_job, **self.job} if earlier_job.get(name) != self.job.get(name)]
        if differing_names:
            names = ", ".join(differing_names)
            raise UsageError(
                f"{self.path}.parts belongs to another job: {names} differ{'s' * (len(differing_names) == 1)} from "
                f"before; give them as they were, or remove {self.folder}",
                file=self.path,
                differs=differing_names,
            )

    def record_of(self, number: int) -> dict[str, Any] | None:
        """What was said of a part when it was kept; None if it is missing."""
        try:
            with open(self._place(number), "rb") as file:
                return dict(json.loads(file.readline()))
        except FileNotFoundError:
            return None

    def keep(self, number: int, record: Mapping[str, Any], data: bytes) -> None:
        """Keep a finished part. Raises UnfinishedError for a full disk: the parts so far stay.

        The run that holds the folder may let other processes of this machine keep what they have finished.
        """
        with self._errors():
            self._write(self._place(number), json.dumps(record).encode() + b"\n", data)

    def open_parts(self, count: int) -> Iterator[IO[bytes]]:
        """The bytes of the first parts, one file after the other: each is closed when the next is opened."""
        for number in range(count):
            with open(self._place(number), "rb") as file:
                file.readline()
                if file.tell() < os.fstat(file.fileno()).st_size:  # rows without values leave none
                    yield file

    def read(self, number: int) -> bytes:
        """A part's bytes."""
        with open(self._place(number), "rb") as file:
            file.readline()
            return file.read()

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_lock": None}  # another process may keep parts, and does not hold the folder

    def leave(self) -> None:
        """Let go of the folder: its finished parts stay, what a signal or a full disk has left half written goes."""
        if self._lock is not None:
            with suppress(OSError):
                self._sweep()
            self._lock.release()
            self._lock = None

    def remove(self) -> None:
        """The file is whole: the parts go."""
        self.leave()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _place(self, number: int) -> Path:
        return self.folder / f"{number:08d}"

    def _write(self, place: Path, *data: bytes) -> None:
        """Write a file aside and rename it; what stays half written is swept when the folder is left or taken again."""
        unfinished_path = Path(f"{place}{_UNFINISHED}")
        with open(unfinished_path, "wb") as file:
            file.writelines(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(unfinished_path, place)

    def _sweep(self) -> None:
        for unfinished_path in self.folder.glob(f"*{_UNFINISHED}"):
            unfinished_path.unlink()

    @contextmanager
    def _errors(self) -> Iterator[None]:
        """Errors of the disk as FileError, with what stays of the parts."""
        try:
            yield
        except OSError as error:
            reason = "the disk is full" if error.errno in (errno.ENOSPC, errno.EDQUOT) else error.strerror or error
            if not self.folder.exists():
                raise FileError(f"{self.path}: cannot write: {reason}", file=self.path) from None
            raise UnfinishedError(
                f"{self.path}: cannot write: {reason}; what is finished stays in {self.path}.parts",
                file=self.path,
                parts=str(self.folder),
            ) from None


def digest(content: bytes) -> str:
    """What tells inputs apart."""
    return hashlib.sha256(content).hexdigest()
