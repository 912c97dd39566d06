"""How far the stack of a compiled AVR program can grow: every path through its machine code, and an interrupt on top.

avr-gcc has no -fstack-usage for this chip, and it would know neither the interrupts by hand nor the libraries. Followed
are push and pop, calls, frames taken from the stack pointer, jumps into other functions. What cannot be followed (an
indirect jump, a path that meets another one at another depth, a call in a circle) is an error.
"""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

LINE = re.compile(r"^ +([0-9a-f]+):\t(\S+)[ \t]*([^;\n]*)(?:;\s*(0x[0-9a-f]+))?", re.M)
SYMBOL = re.compile(r"^([0-9a-f]+) <(\S+)>:$", re.M)
BRANCH = re.compile(r"br(?!eak)\w\w")
READS = ("cp", "cpi", "cpc", "cpse", "push", "st", "std", "sts", "out", "mul", "tst", "sbrc", "sbrs")
SKIPS = ("cpse", "sbrc", "sbrs", "sbic", "sbis")


@dataclass(frozen=True)
class Instruction:
    name: str
    operands: tuple[str, ...]
    target: int  # of a jump, a branch or a call; else -1
    after: int  # address of the next one


@dataclass(frozen=True)
class At:
    """Bytes on the stack since the function's first instruction; and the frame pointer, relative to the stack's."""

    depth: int
    frame: int | None = None  # depth that Y points to


@dataclass(frozen=True)
class Deepest:
    """Bytes, and the calls that lead there."""

    size: int
    path: tuple[str, ...]


class Program:
    """The machine code of an ELF file."""

    def __init__(self, elf: Path) -> None:
        self.elf = elf
        command = ["avr-objdump", "-d", "--no-show-raw-insn", str(elf)]
        text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        self.names: dict[int, str] = {int(address, 16): name for address, name in SYMBOL.findall(text)}
        listed = [(int(a, 16), n, o, t) for a, n, o, t in LINE.findall(text)]
        self.code: dict[int, Instruction] = {}
        for (address, name, operands, target), (after, *_) in zip(listed, [*listed[1:], (-1,)], strict=True):
            parts = tuple(part.strip() for part in operands.split(",") if part.strip())
            goes = int(target, 16) if target else int(parts[0], 16) if name in ("call", "jmp") else -1
            if name in ("rjmp", "rcall") or BRANCH.fullmatch(name):
                goes = after + int(parts[-1].lstrip(".")) if not target else goes
            self.code[address] = Instruction(name, parts, goes, after)
        self.known: dict[int, Deepest] = {}
        self.open: list[int] = []

    @cached_property
    def address_size(self) -> int:
        """Bytes that a call pushes."""
        header = subprocess.run(["avr-readelf", "-h", str(self.elf)], capture_output=True, text=True, check=True).stdout
        return 3 if "avr:6" in header else 2

    def symbol(self, name: str) -> int:
        return next(address for address, symbol_name in self.names.items() if symbol_name == name)

    def name(self, address: int) -> str:
        return self.names.get(address, f"{address:x}")

    def deepest(self, entry: int) -> Deepest:
        """What a function takes from the stack at most, without its own return address."""
        if entry in self.known:
            return self.known[entry]
        if entry in self.open:
            raise ValueError(f"{self.name(entry)} calls itself")
        self.open.append(entry)
        best, visited, left = Deepest(0, ()), dict[int, At](), [(entry, At(0))]
        while left:
            address, state = left.pop()
            if address in visited:
                if visited[address].depth != state.depth:
                    raise ValueError(f"{self.name(entry)}: two depths at {address:x}")
                continue
            visited[address] = state
            instruction = self.code[address]
            if instruction.name in ("call", "rcall") and instruction.target != instruction.after:
                inner = self.deepest(instruction.target)
                reached = Deepest(
                    state.depth + self.address_size + inner.size, (self.name(instruction.target), *inner.path)
                )
            else:
                reached = Deepest(state.depth, ())
            best = max(best, reached, key=lambda deep: deep.size)
            left += self.onwards(address, state)
        self.open.pop()
        self.known[entry] = best
        return best

    def onwards(self, address: int, state: At) -> list[tuple[int, At]]:
        """What may come next, and how deep the stack is there."""
        instruction = self.code[address]
        name, after = instruction.name, instruction.after
        if name in ("ret", "reti"):
            return []
        if name in ("icall", "ijmp", "eicall", "eijmp"):
            raise ValueError(f"{address:x}: {name}")
        if name in ("jmp", "rjmp"):
            return [(instruction.target, state)]
        if BRANCH.fullmatch(name):
            return [(instruction.target, state), (after, state)]
        if name in SKIPS:
            return [(after, state), (self.code[after].after, state)]
        return [(after, self.moved(instruction, state))]

    def moved(self, instruction: Instruction, state: At) -> At:
        name, operands = instruction.name, instruction.operands
        if name == "push":
            return At(state.depth + 1, state.frame)
        if name == "pop":
            lost = operands[0] in ("r28", "r29")
            return At(state.depth - 1, None if lost else state.frame)
        if name in ("call", "rcall"):  # to the next instruction: two or three bytes more
            return (
                At(state.depth + self.address_size, state.frame) if instruction.target == instruction.after else state
            )
        if name == "in" and operands == ("r28", "0x3d"):
            return At(state.depth, state.depth)
        if operands[:1] == ("r28",) and name not in READS:
            return At(state.depth, self.frame(instruction, state.frame))
        if name == "out" and operands == ("0x3d", "r28"):
            if state.frame is None:
                raise ValueError(f"a stack pointer from nowhere before {instruction.after:x}")
            return At(state.frame, state.frame)
        return state

    def frame(self, instruction: Instruction, frame: int | None) -> int | None:
        """Where Y points after an instruction that changes it; None: nobody knows, or nowhere on the stack."""
        if frame is None or instruction.name not in ("sbiw", "adiw", "subi"):
            return None
        number = int(instruction.operands[1], 16)
        if instruction.name != "subi":
            return frame + (number if instruction.name == "sbiw" else -number)
        high = self.code[instruction.after]  # the high byte comes with the next instruction
        if high.operands == ("r29", "r1"):  # 0
            return frame + number
        if high.name != "sbci" or high.operands[0] != "r29":
            return None
        number |= int(high.operands[1], 16) << 8
        return frame + (number - 0x10000 if number & 0x8000 else number)


@dataclass(frozen=True)
class Bound:
    main: Deepest
    interrupt: Deepest
    total: int
    variables: int
    ram: int

    @property
    def free(self) -> int:
        """Bytes that are never touched, whatever happens."""
        return self.ram - self.variables - self.total


def stack_bound(elf: Path, ram: int) -> Bound:
    """Of main() and what it calls, and of the one interrupt that may come then."""
    program = Program(elf)
    main = program.deepest(program.symbol("main"))
    vectors = [address for address, name in program.names.items() if re.fullmatch(r"__vector_\d+", name)]
    interrupt = max((program.deepest(address) for address in vectors), key=lambda deep: deep.size)
    table = subprocess.run(["avr-size", "-A", str(elf)], capture_output=True, text=True, check=True).stdout
    variables = sum(int(size) for size in re.findall(r"^\.(?:data|bss|noinit)\s+(\d+)", table, re.M))
    total = main.size + interrupt.size + 2 * program.address_size
    return Bound(main, interrupt, total, variables, ram)
