"""The emulated board for tests: the compiled program for the real chip, behind a pseudo-terminal.

    with EmulatedBoard("uno_cnc_shield") as board:
        with serial.Serial(board.port, 250000) as port: ...
        board.control("switch X 1")
        assert board.stats()["axes"]["X"]["net"] == -1067

Simulated time follows the clock (``speed=1``), the host (``speed="max"``) or the test (``speed="step"``:
it moves in `run` only, so that the test repeats to the cycle). The commands of `control` and what they mean:
firmware/sim/README.md.
"""

from __future__ import annotations

import atexit
import fcntl
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

FIRMWARE = Path(__file__).resolve().parents[2] / "firmware"
BUILD = FIRMWARE / "build"
CLOCK_HZ = 16_000_000
PICO = "pico6"  # its emulator is another one: firmware/sim/rp2040
CYCLES_HZ = {PICO: 125_000_000}  # of the emulator's cycles, where they are not CLOCK_HZ
MCU = {"uno_cnc_shield": "atmega328p", "uno_servos": "atmega328p", "mega_ramps14": "atmega2560"}


# Emulated Picos whose tests are over, for `renew`: a new process of node takes a second of a core until it is as fast.
_WARM: list[subprocess.Popen[bytes]] = []


@atexit.register
def _end_warm() -> None:
    for process in _WARM:
        process.communicate()


class BoardError(RuntimeError):
    """The emulator refused a command, or died."""


def run_make(*arguments: str) -> None:
    """Run make in one process at a time (tests run in parallel); its output only if it fails."""
    BUILD.mkdir(exist_ok=True)
    with (BUILD / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        completed = subprocess.run(["make", *arguments], capture_output=True, text=True, check=False)
    if completed.returncode:
        raise BoardError(f"make {' '.join(arguments)}:\n{completed.stdout}{completed.stderr}")


def build_simulator(board: str = "uno_cnc_shield") -> list[str]:
    """The command that starts the emulator of a board."""
    if board == PICO:
        run_make("-C", str(FIRMWARE / "sim" / "rp2040"))
        return [sys.executable, str(FIRMWARE / "sim" / "rp2040" / "simboard.py")]
    run_make("-C", str(FIRMWARE / "sim"))
    return [str(BUILD / "simboard")]


def build_firmware(board: str) -> Path:
    """The program as its emulator takes it: an ELF, or a UF2 file."""
    run_make("-C", str(FIRMWARE), f"BOARD={board}")
    return BUILD / f"{board}.{'uf2' if board == PICO else 'elf'}"


def compile_program(source: Path, board: str, into: Path, *options: str) -> Path:
    """A single C file to an ELF for the board's chip."""
    elf = into / f"{source.stem}.{board}.elf"
    chip = [f"-mmcu={MCU[board]}", f"-DF_CPU={CLOCK_HZ}UL"]
    warnings = ["-Wall", "-Wextra", "-Werror"]
    subprocess.run(
        ["avr-gcc", *chip, "-Os", *warnings, *options, "-o", str(elf), str(source)],
        check=True,
    )
    return elf


@dataclass(frozen=True)
class Trace:
    """Every edge of the board's pins, with the cycle it came at (16 MHz, since power-on).

    `cycle`: (k,) uint64; `signal`: (k,) numbers; `value`: (k,) level or byte. `names`: signal -> number.
    """

    names: Mapping[str, int]
    cycle: NDArray[np.int64]
    signal: NDArray[np.uint8]
    value: NDArray[np.uint8]

    @classmethod
    def read(cls, path: Path) -> Trace:
        with path.open("rb") as file:
            head = json.loads(file.readline())
            data = file.read()
        records = np.frombuffer(data[: len(data) // 8 * 8], dtype="<u8")
        names = {name: i for i, name in enumerate(head["signals"])}
        names |= {"uart.in": 250, "uart.out": 251, "reset": 252, "mark": 253}
        return cls(
            names,
            (records >> np.uint64(16)).astype(np.int64),
            (records >> np.uint64(8) & np.uint64(255)).astype(np.uint8),
            (records & np.uint64(255)).astype(np.uint8),
        )

    def edges(self, name: str) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
        """Cycles and new levels of one signal: "X.STEP", "X.DIR", "ENABLE", "A3", "uart.in", "reset" ..."""
        if name not in self.names:
            raise BoardError(f"no signal {name!r} in the trace; there are {', '.join(self.names)}")
        mine = self.signal == self.names[name]
        return self.cycle[mine], self.value[mine]

    def rises(self, name: str) -> NDArray[np.int64]:
        cycle, level = self.edges(name)
        rising: NDArray[np.int64] = cycle[level == 1]
        return rising

    def steps(self, axis: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Cycle and direction (+1: DIR low, -1: DIR high) of every step of an axis."""
        rises = self.rises(f"{axis}.STEP")
        turned, level = self.edges(f"{axis}.DIR")
        levels = np.concatenate([[0], level]).astype(np.int64)
        return rises, 1 - 2 * levels[np.searchsorted(turned, rises, side="right")]

    def positions(self, axis: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Cycle of every step of an axis and its net steps after it."""
        cycle, direction = self.steps(axis)
        return cycle, np.cumsum(direction)


class EmulatedBoard:
    """One emulated board, from `with` to the end of its block.

    `elf`: the program; default: the firmware, built for this board.
    `speed`: simulated seconds per second; "max": free-running until `ahead_ms` after the host's last byte,
    then 1; "step": only in `run`.
    `patience`: seconds of silence after which simulated time waits for a host that has the port open, at a speed
    that follows the clock: a busy machine may give the host no time for longer than the firmware waits for it. A host
    asks ten times a second. 0, here or by `control("patience off")`: it never waits.
    `bootloader`: milliseconds that a bootloader takes after an external reset; it hides the reset's cause.
    `loader`: a real boot loader, in Intel HEX, which every reset starts; without `elf` the flash is empty then.
    `commands`: of the control channel, carried out before the program starts: ("pin A0 0",).
    `baud`: the host's true rate, if it shall differ from what the board has set.
    `by`: which of a Pico's lines the port is.
    """

    def __init__(
        self,
        board: str = "uno_cnc_shield",
        *,
        elf: Path | None = None,
        speed: float | Literal["max", "step"] = 1,
        ahead_ms: float = 50,
        patience: float = 0.12,
        bootloader: float | None = None,
        loader: Path | None = None,
        reset_on_open: bool = True,
        driver: str = "a4988",
        commands: Sequence[str] = (),
        baud: int | None = None,
        trace: bool = False,
        seed: int = 1,
        link: Literal["uart", "usb"] = "uart",
    ) -> None:
        self.board = board
        self.clock_hz = CYCLES_HZ.get(board, CLOCK_HZ)
        self.port = ""
        self._elf, self._blank = elf, loader is not None and elf is None
        self._options = ["--speed", str(speed), "--ahead", str(ahead_ms)]
        self._options += ["--driver", driver, "--seed", str(seed)]
        if speed not in ("max", "step"):
            self._options += ["--patience", str(patience * 1e3)]
        if bootloader is not None:
            self._options += ["--bootloader", str(bootloader)]
        if loader is not None:
            self._options += ["--loader", str(loader)]
        if not reset_on_open:
            self._options.append("--no-reset-on-open")
        if baud is not None:
            self._options += ["--baud", str(baud)]
        if link != "uart":
            self._options += ["--by", link]
        for command in commands:
            self._options += ["--do", command]
        self._traced = trace
        self._warm = board == PICO and speed == "step"
        self._folder = Path()
        self._process: subprocess.Popen[bytes] | None = None
        self._unread = b""

    def __enter__(self) -> EmulatedBoard:
        simulator = build_simulator(self.board)
        program = [] if self._blank else ["--elf", str(self._elf or build_firmware(self.board))]
        self._folder = Path(tempfile.mkdtemp(prefix="armkin-board-"))
        options = ["--board", self.board, *program, "--stdin", *self._options]
        if self._traced:
            options += ["--trace", str(self._folder / "trace")]
        try:
            if self._warm and _WARM:
                self._process = _WARM.pop()
                self.control(f"renew {json.dumps(options)}")
            else:
                command = [*simulator, *options, "--link", str(self._folder / "port")]
                self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
                self.port = str(self._answer(60)["port"])
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None and self._warm and self._process is not None:
            _WARM.append(self._process)
            self._process = None
        self.close()

    def close(self) -> None:
        """End the emulator, by force if it must be; its files go."""
        process, self._process = self._process, None
        if process is not None:
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.close()  # the emulator ends with its standard input
            try:
                process.wait(30)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            process.stdout.close()
        if self._folder != Path():
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder = Path()

    def _answer(self, timeout: float) -> dict[str, Any]:
        process = self._process
        if process is None or process.stdout is None:
            raise BoardError("the board is not running: use it in a with block")
        end = time.monotonic() + timeout
        while b"\n" not in self._unread:
            ready, _, _ = select.select([process.stdout], [], [], max(0.0, end - time.monotonic()))
            if not ready:
                raise BoardError(f"the emulator did not answer within {timeout} s")
            chunk = os.read(process.stdout.fileno(), 1 << 16)
            if not chunk:
                raise BoardError(f"the emulator ended with exit code {process.wait()}")
            self._unread += chunk
        line, _, self._unread = self._unread.partition(b"\n")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def control(self, command: str, timeout: float = 60) -> dict[str, Any]:
        """Give one command, return its answer; raises BoardError if it was refused."""
        if self._process is None or self._process.stdin is None:
            raise BoardError("the board is not running: use it in a with block")
        try:
            self._process.stdin.write(command.encode() + b"\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise BoardError(f"the emulator ended with exit code {self._process.wait()}") from None
        answer = self._answer(timeout)
        if "error" in answer:
            raise BoardError(f"{command!r}: {answer['error']}")
        return answer

    def stats(self) -> dict[str, Any]:
        """All figures (firmware/sim/README.md names them)."""
        return self.control("stats")

    def net(self) -> dict[str, int]:
        """Net steps of every axis since the emulator started; positive: DIR low."""
        return {axis: figures["net"] for axis, figures in self.stats()["axes"].items()}

    def wait(self, seconds: float) -> None:
        """Wait until so much simulated time has passed, whatever the machine's load.

        An opening of the port, and the reset that goes with it, come before this time.
        """
        end = self.control("cycles")["cycle"] + seconds * self.clock_hz
        while self.control("cycles")["cycle"] < end:
            time.sleep(0.001)

    def trace(self) -> Trace:
        """What was recorded so far; for a board made with trace=True."""
        if not self._traced:
            raise BoardError("no trace: make the board with trace=True")
        self.control("flush")
        return Trace.read(self._folder / "trace")

    def run(self, seconds: float, data: bytes = b"", until: bytes = b"") -> bytes:
        """With speed="step": put `data` on the line, let `seconds` pass, return what the board has sent.

        Returns early when the board sends the byte `until`. `data` goes out at the line's rate, so that a
        long one may still be under way afterwards.
        """
        command = f"run {round(seconds * self.clock_hz)}"
        if until:
            command += f" until {until.hex()}"
        if data:
            command += f" {data.hex()}"
        return bytes.fromhex(self.control(command)["out"])
