// One PIO state machine, written from the RP2040 datasheet (3.2 to 3.5): what each of its cycles does.
//
// A cycle either executes an instruction, waits out one's delay, or stalls. Side-set takes effect in the first cycle of an
// instruction, stalled or not; the delay follows when it is done (3.4.1, 3.5.1). Pins change with the cycle that writes them.

export const TX_STALL = 1 << 24;
export const TX_OVER = 1 << 16;
export const RX_UNDER = 1 << 8;
export const RX_STALL = 1 << 0;
const ones = (bits) => (bits >= 32 ? 0xffffffff : (1 << bits) - 1);
const field = (word, at, bits) => (word >>> at) & ones(bits);

function reversed(x) {
  let out = 0;
  for (let i = 0; i < 32; i++) {
    out = (out << 1) | ((x >>> i) & 1);
  }
  return out >>> 0;
}

export class Machine {
  /** block: what all four share: instructions, irq, pins (input), write(value, base, count, directions), flag(bits, index). */
  constructor(block, index) {
    Object.assign(this, { block, index, enabled: false, x: 0, y: 0, pc: 0, isr: 0, osr: 0 });
    Object.assign(this, { clkdiv: 1 << 16, execctrl: 0x1f << 12, shiftctrl: 0b11 << 18, pinctrl: 5 << 26 });
    this.tx = [];
    this.rx = [];
    this.restart();
  }

  restart() {
    this.isrCount = 0;
    this.osrCount = 32;
    this.isr = 0;
    this.delay = 0;
    this.stalled = null; // 'tx', 'rx', 'pin' or 'irq'
    this.forced = null; // an instruction from INSTR, or from OUT EXEC or MOV EXEC
  }

  get txDepth() {
    return field(this.shiftctrl, 31, 1) ? 0 : field(this.shiftctrl, 30, 1) ? 8 : 4;
  }

  get rxDepth() {
    return field(this.shiftctrl, 30, 1) ? 0 : field(this.shiftctrl, 31, 1) ? 8 : 4;
  }

  get pushThreshold() {
    return field(this.shiftctrl, 20, 5) || 32;
  }

  get pullThreshold() {
    return field(this.shiftctrl, 25, 5) || 32;
  }

  get autopull() {
    return field(this.shiftctrl, 17, 1) === 1;
  }

  /** In 1/256 system cycle (3.5.5). */
  get period() {
    const { clkdiv } = this;
    return clkdiv >>> 16 ? clkdiv >>> 8 : 65536 * 256;
  }

  /** One cycle. */
  step() {
    if (this.delay > 0) {
      this.delay--;
      this.#refill();
      return;
    }
    const forced = this.forced;
    this.#execute(forced ?? this.block.instructions[this.pc], forced === null);
  }

  /** INSTR: executed at once, without its delay's end in the program. */
  force(opcode) {
    this.stalled = null;
    this.delay = 0;
    this.forced = opcode;
    this.#execute(opcode, false);
  }

  /** How many cycles nothing but counting will happen: `jmp x--` (or y--) to itself. It may be told to have passed: skip(). */
  get idle() {
    const opcode = this.block.instructions[this.pc];
    const counts = (opcode & 0xe0e0) === 0x0040 || (opcode & 0xe0e0) === 0x0080;
    if (!counts) {
      return 0;
    }
    const alone = !this.stalled && this.forced === null && this.delay === 0 && (opcode & 0x1f) === this.pc;
    if (!alone || opcode & 0x1f00) {
      return 0;
    }
    return opcode & 0x40 ? this.x : this.y;
  }

  skip(cycles) {
    if (this.block.instructions[this.pc] & 0x40) {
      this.x -= cycles;
    } else {
      this.y -= cycles;
    }
    this.#refill();
  }

  #refill() {
    if (this.autopull && this.osrCount >= this.pullThreshold && this.tx.length) {
      this.osr = this.block.take(this);
      this.osrCount = 0;
    }
  }

  #execute(opcode, ofProgram) {
    const sides = field(this.pinctrl, 29, 3);
    const optional = field(this.execctrl, 30, 1);
    const delayBits = 5 - sides;
    const isOut = opcode >>> 13 === 3;
    this.jumped = false;
    this.next = null; // an instruction that this one leaves to execute
    const first = this.stalled === null;
    const done = this.#do(opcode >>> 13, field(opcode, 5, 3), field(opcode, 0, 5), first);
    if (!isOut) {
      this.#refill();
    }
    if (sides && first && (!optional || opcode & 0x1000)) { // over what the instruction itself writes (3.5.6)
      const count = sides - optional;
      this.block.write(field(opcode, 8 + delayBits, count), field(this.pinctrl, 10, 5), count, field(this.execctrl, 29, 1));
    }
    if (!done) {
      return;
    }
    this.stalled = null;
    this.forced = this.next;
    this.delay = this.next === null ? field(opcode, 8, delayBits) : 0; // EXEC's own delay is not heeded (3.4.5)
    if (ofProgram && !this.jumped) {
      this.pc = this.pc === field(this.execctrl, 12, 5) ? field(this.execctrl, 7, 5) : (this.pc + 1) & 31;
    }
  }

  #stall(why) {
    this.stalled = why;
    if (why === 'tx') {
      this.block.flag(TX_STALL, this.index);
    } else if (why === 'rx') {
      this.block.flag(RX_STALL, this.index);
    }
    return false;
  }

  #jump(to) {
    this.pc = to & 31;
    this.jumped = true;
  }

  #irq(operand) {
    return operand & 0x10 ? (operand & 4) | ((operand + this.index) & 3) : operand & 7;
  }

  /** False: it stalls. kind, what, operand: the opcode's three parts; first: not stalled before. */
  #do(kind, what, operand, first) {
    switch (kind) {
      case 0:
        if (this.#condition(what)) {
          this.#jump(operand);
        }
        return true;
      case 1:
        return this.#wait(what >>> 2, what & 3, operand);
      case 2:
        return this.#in(this.#source(what), operand || 32, first);
      case 3:
        return this.#out(what, operand || 32);
      case 4:
        return what & 4 ? this.#pull(what & 2, what & 1) : this.#push(what & 2, what & 1);
      case 5:
        return this.#move(what, operand >>> 3, this.#source(operand & 7, true));
      case 6:
        return this.#raise(what, this.#irq(operand), first);
      default:
        return this.#set(what, operand);
    }
  }

  #condition(what) {
    const { x, y } = this;
    switch (what) {
      case 0:
        return true;
      case 1:
        return x === 0;
      case 2:
        this.x = (x - 1) >>> 0;
        return x !== 0;
      case 3:
        return y === 0;
      case 4:
        this.y = (y - 1) >>> 0;
        return y !== 0;
      case 5:
        return x !== y;
      case 6:
        return field(this.block.pins, field(this.execctrl, 24, 5), 1) === 1;
      default:
        return this.osrCount < this.pullThreshold;
    }
  }

  #wait(level, what, operand) {
    if (what === 2) {
      const flag = 1 << this.#irq(operand);
      if (!!(this.block.irq & flag) !== !!level) {
        return this.#stall('irq');
      }
      if (level) {
        this.block.clear(flag);
      }
      return true;
    }
    const pin = what === 1 ? (operand + field(this.pinctrl, 15, 5)) & 31 : operand;
    return field(this.block.pins, pin, 1) === level || this.#stall('pin');
  }

  #source(what, ofMove = false) {
    const base = field(this.pinctrl, 15, 5);
    const { pins } = this.block;
    const fifo = this.execctrl & 0x10 ? this.rx : this.tx;
    switch (what) {
      case 0:
        return base ? ((pins >>> base) | (pins << (32 - base))) >>> 0 : pins;
      case 1:
        return this.x;
      case 2:
        return this.y;
      case 5:
        return ofMove && fifo.length < field(this.execctrl, 0, 4) ? 0xffffffff : 0;
      case 6:
        return this.isr;
      case 7:
        return this.osr;
      default:
        return 0;
    }
  }

  #in(value, bits, first) {
    if (first) {
      const taken = (value & ones(bits)) >>> 0;
      const right = field(this.shiftctrl, 18, 1);
      const rest = bits === 32 ? 0 : right ? this.isr >>> bits : this.isr << bits;
      this.isr = (right ? rest | (taken << (32 - bits)) : rest | taken) >>> 0;
      this.isrCount = Math.min(32, this.isrCount + bits);
    }
    if (field(this.shiftctrl, 16, 1) && this.isrCount >= this.pushThreshold) {
      if (this.rx.length >= this.rxDepth) {
        return this.#stall('rx');
      }
      this.block.give(this, this.isr);
      this.isr = this.isrCount = 0;
    }
    return true;
  }

  #out(where, bits) {
    if (this.autopull && this.osrCount >= this.pullThreshold) { // it cannot be filled and used in one cycle (3.5.4.2)
      this.#refill();
      return this.osrCount ? this.#stall('tx') : this.#stall('osr');
    }
    const right = field(this.shiftctrl, 19, 1);
    const value = right ? (this.osr & ones(bits)) >>> 0 : this.osr >>> (32 - bits);
    this.osr = bits === 32 ? 0 : (right ? this.osr >>> bits : this.osr << bits) >>> 0;
    this.osrCount = Math.min(32, this.osrCount + bits);
    this.#refill();
    return this.#to(where, value, bits);
  }

  /** Where OUT and MOV put their value: they agree but in 3, 4 and 7. */
  #to(where, value, bits) {
    const base = field(this.pinctrl, 0, 5);
    const count = field(this.pinctrl, 20, 6);
    switch (where) {
      case 0:
        this.block.write(value, base, count, 0);
        break;
      case 1:
        this.x = value;
        break;
      case 2:
        this.y = value;
        break;
      case 4:
        this.block.write(value, base, count, 1);
        break;
      case 5:
        this.#jump(value);
        break;
      case 6:
        this.isr = value;
        this.isrCount = bits;
        break;
      case 7:
        this.next = value & 0xffff;
        break;
      default: // null
    }
    return true;
  }

  #push(ifFull, block) {
    if (ifFull && this.isrCount < this.pushThreshold) {
      return true;
    }
    if (this.rx.length < this.rxDepth) {
      this.block.give(this, this.isr);
    } else {
      this.block.flag(RX_STALL, this.index);
      if (block) {
        return this.#stall('rx');
      }
    }
    this.isr = this.isrCount = 0;
    return true;
  }

  #pull(ifEmpty, block) {
    if ((ifEmpty || this.autopull) && this.osrCount < this.pullThreshold) {
      return true;
    }
    if (this.tx.length) {
      this.osr = this.block.take(this);
    } else if (block) {
      return this.#stall('tx');
    } else {
      this.osr = this.x;
    }
    this.osrCount = 0;
    return true;
  }

  #move(where, how, value) {
    const moved = how === 1 ? ~value >>> 0 : how === 2 ? reversed(value) : value;
    switch (where) {
      case 3:
        return true;
      case 4:
        this.next = moved & 0xffff;
        return true;
      case 7:
        this.osr = moved;
        this.osrCount = 0;
        return true;
      default:
        return this.#to(where, moved, 0);
    }
  }

  #raise(what, number, first) {
    const flag = 1 << number;
    if (what & 2) {
      this.block.clear(flag);
      return true;
    }
    if (first) {
      this.block.raise(flag);
      return !(what & 1) || this.#stall('irq');
    }
    return !(this.block.irq & flag) || this.#stall('irq');
  }

  #set(where, value) {
    if (where === 1) {
      this.x = value;
    } else if (where === 2) {
      this.y = value;
    } else if (where === 0 || where === 4) {
      this.block.write(value, field(this.pinctrl, 5, 5), field(this.pinctrl, 26, 3), where === 4 ? 1 : 0);
    }
    return true;
  }
}
