// A PIO block: four state machines, their FIFOs and registers (RP2040 datasheet, 3.7), in step with the processor.
//
// It stands in place of rp2040js's, which runs freely beside the processor and knows no delays, no clock's fraction and no joined FIFO.
import { BasePeripheral } from 'rp2040js';
import { Machine, RX_UNDER, TX_OVER, TX_STALL } from './machine.mjs';

const CTRL = 0x00, FSTAT = 0x04, FDEBUG = 0x08, FLEVEL = 0x0c, TXF0 = 0x10, RXF0 = 0x20, IRQ = 0x30, IRQ_FORCE = 0x34, BYPASS = 0x38;
const PADOUT = 0x3c, PADOE = 0x40, CFGINFO = 0x44, INSTR_MEM0 = 0x48, SM0 = 0xc8, INTR = 0x128, INTE = 0x12c;
const DREQ_TX = [0, 8]; // of each block's first machine; RX four later (2.5.3.1)

const turned = (bits, by) => (bits << (by & 31)) | (by & 31 ? bits >>> (32 - (by & 31)) : 0);

export class Pio extends BasePeripheral {
  /** chip: where time is (chip.cycle); firstIrq: of the processor. */
  constructor(rp2040, chip, number, firstIrq) {
    super(rp2040, `PIO${number}`);
    Object.assign(this, { chip, number, firstIrq, irq: 0, stalls: 0, pinValues: 0, pinDirections: 0, bypass: 0 });
    this.instructions = new Uint16Array(32);
    this.states = [0, 1, 2, 3].map((i) => new Machine(this, i));
    this.machines = []; // rp2040js's pins look here for machines of its own
    this.due = [Infinity, Infinity, Infinity, Infinity]; // [1/256 cycle] when each machine acts next
    this.enables = [0, 0, 0, 0]; // INTE and INTF of both interrupts
    this.now = null; // the cycle in which a machine acts just now
    this.next = Infinity; // cycle
    this.states.forEach((m) => this.#requests(m));
  }

  // ---- time

  /** Levels at the inputs, without the two cycles of their synchronisers. */
  get pins() {
    return this.chip.levels ?? this.rp2040.gpioValues >>> 0;
  }

  /** All that happens up to a cycle, that one included. */
  run(cycle) {
    while (this.next <= cycle) {
      let first = 0;
      for (let i = 1; i < 4; i++) {
        first = this.due[i] < this.due[first] ? i : first;
      }
      this.#turn(this.states[first]);
      this.#schedule();
    }
  }

  #turn(machine) {
    const { index, period } = machine;
    const idle = machine.idle;
    if (idle) { // a loop that counts: nobody else sees it
      machine.skip(idle);
      this.due[index] += idle * period;
      return;
    }
    this.now = Math.floor(this.due[index] / 256);
    machine.step();
    this.#show();
    this.now = null;
    const waits = machine.stalled === 'tx' && !machine.tx.length;
    this.due[index] = waits ? Infinity : this.due[index] + period;
  }

  #schedule() {
    const [a, b, c, d] = this.due;
    this.next = Math.floor(Math.min(a, b, c, d) / 256);
  }

  /** A machine that slept goes on with the next of its clock's cycles. */
  #wake(machine) {
    const { index, period } = machine;
    if (machine.enabled && this.due[index] === Infinity) {
      this.due[index] = Math.ceil(((this.chip.cycle + 1) * 256) / period) * period;
      this.#schedule();
    }
  }

  // ---- what the machines ask for

  flag(bits, index) {
    this.stalls |= bits << index;
  }

  raise(bits) {
    this.irq |= bits;
    this.#interrupts();
  }

  clear(bits) {
    this.irq &= ~bits;
    this.#interrupts();
  }

  write(value, base, count, directions) {
    const low = count >= 32 ? -1 : (1 << count) - 1;
    const mask = turned(low, base); // pins go round behind 31 (3.5.6)
    const bits = turned(value & low, base);
    if (directions) {
      this.pinDirections = (this.pinDirections & ~mask) | bits;
    } else {
      this.pinValues = (this.pinValues & ~mask) | bits;
    }
  }

  take(machine) {
    const word = machine.tx.shift();
    this.#requests(machine);
    return word;
  }

  give(machine, word) {
    machine.rx.push(word);
    this.#requests(machine);
  }

  #requests(machine) {
    const { dma } = this.rp2040;
    const tx = DREQ_TX[this.number] + machine.index;
    dma[machine.tx.length < machine.txDepth ? 'setDREQ' : 'clearDREQ'](tx);
    dma[machine.rx.length ? 'setDREQ' : 'clearDREQ'](tx + 4);
    this.#interrupts();
  }

  #show() {
    const changed = (this.shownDirections ^ this.pinDirections) | (this.shownValues ^ this.pinValues);
    if (changed) {
      this.shownDirections = this.pinDirections;
      this.shownValues = this.pinValues;
      const { gpio } = this.rp2040;
      for (let left = changed & 0x3fffffff; left; left &= left - 1) {
        gpio[31 - Math.clz32(left & -left)]?.checkForUpdates();
      }
    }
  }

  // ---- registers

  get raw() {
    let bits = (this.irq & 15) << 8;
    for (const m of this.states) {
      bits |= (m.tx.length < m.txDepth ? 0x10 << m.index : 0) | (m.rx.length ? 1 << m.index : 0);
    }
    return bits;
  }

  #status(which) {
    return (this.raw & this.enables[2 * which]) | this.enables[2 * which + 1];
  }

  #interrupts() {
    for (const which of [0, 1]) {
      this.rp2040.setInterrupt(this.firstIrq + which, this.#status(which) !== 0);
    }
  }

  #gathered(of) {
    return this.states.reduce((sum, m) => sum | of(m), 0) >>> 0;
  }

  readUint32(offset) {
    if (offset >= SM0 && offset < INTR) {
      const machine = this.states[Math.floor((offset - SM0) / 24)];
      const { clkdiv, execctrl, shiftctrl, pc, pinctrl, stalled, forced } = machine;
      const busy = stalled && forced !== null ? 2 ** 31 : 0;
      return [clkdiv, execctrl + busy, shiftctrl, pc, forced ?? this.instructions[pc], pinctrl][((offset - SM0) % 24) / 4] >>> 0;
    }
    if (offset >= RXF0 && offset < IRQ) {
      return this.#read(this.states[(offset - RXF0) / 4]);
    }
    if (offset >= INTE && offset < INTE + 24) {
      const [which, part] = [Math.floor((offset - INTE) / 12), ((offset - INTE) % 12) / 4];
      return part === 2 ? this.#status(which) : this.enables[2 * which + part];
    }
    switch (offset) {
      case CTRL:
        return this.#gathered((m) => (m.enabled ? 1 : 0) << m.index);
      case FSTAT:
        return this.#gathered(
          (m) =>
            ((m.rx.length >= m.rxDepth ? 1 : 0) | (m.rx.length ? 0 : 1 << 8) | (m.tx.length >= m.txDepth ? 1 << 16 : 0) | (m.tx.length ? 0 : 1 << 24)) <<
            m.index,
        );
      case FDEBUG:
        return this.stalls >>> 0;
      case FLEVEL:
        return this.#gathered((m) => (m.tx.length | (m.rx.length << 4)) << (8 * m.index));
      case IRQ:
        return this.irq;
      case BYPASS:
        return this.bypass;
      case PADOUT:
        return this.pinValues >>> 0;
      case PADOE:
        return this.pinDirections >>> 0;
      case CFGINFO:
        return 0x200404;
      case INTR:
        return this.raw;
      default:
        return super.readUint32(offset);
    }
  }

  #read(machine) {
    if (!machine.rx.length) {
      this.flag(RX_UNDER, machine.index);
      return 0;
    }
    const word = machine.rx.shift();
    this.#requests(machine);
    return word >>> 0;
  }

  writeUint32(offset, value) {
    if (offset >= INSTR_MEM0 && offset < SM0) {
      this.instructions[(offset - INSTR_MEM0) / 4] = value;
    } else if (offset >= SM0 && offset < INTR) {
      this.#setMachine(this.states[Math.floor((offset - SM0) / 24)], ((offset - SM0) % 24) / 4, value >>> 0);
    } else if (offset >= TXF0 && offset < RXF0) {
      this.#feed(this.states[(offset - TXF0) / 4], value >>> 0);
    } else if (offset >= INTE && offset < INTE + 24 && (offset - INTE) % 12 < 8) {
      this.enables[2 * Math.floor((offset - INTE) / 12) + ((offset - INTE) % 12) / 4] = value & 0xfff;
      this.#interrupts();
    } else if (offset === CTRL) {
      this.#control(value);
    } else if (offset === FDEBUG) {
      this.stalls &= ~this.rawWriteValue;
      this.states.filter((m) => m.enabled && m.stalled === 'tx').forEach((m) => this.flag(TX_STALL, m.index)); // each stalled cycle says so again
    } else if (offset === IRQ) {
      this.clear(this.rawWriteValue);
    } else if (offset === IRQ_FORCE) {
      this.raise(this.rawWriteValue & 0xff);
    } else if (offset === BYPASS) {
      this.bypass = value;
    } else {
      super.writeUint32(offset, value);
    }
    this.#show();
  }

  #setMachine(machine, register, value) {
    if (register === 4) {
      machine.force(value & 0xffff);
    } else if (register === 2) {
      if ((machine.shiftctrl ^ value) >>> 30) { // joining empties both
        machine.tx = [];
        machine.rx = [];
      }
      machine.shiftctrl = value;
      this.#requests(machine);
    } else if (register !== 3) {
      machine[{ 0: 'clkdiv', 1: 'execctrl', 5: 'pinctrl' }[register]] = value;
    }
  }

  #feed(machine, word) {
    if (machine.tx.length >= machine.txDepth) {
      this.flag(TX_OVER, machine.index);
      return;
    }
    machine.tx.push(word);
    this.#requests(machine);
    this.#wake(machine);
  }

  #control(value) {
    for (const machine of this.states) {
      machine.enabled = !!((value >>> machine.index) & 1);
      if ((value >>> (4 + machine.index)) & 1) {
        machine.restart();
      }
      if (!machine.enabled || (value >>> (8 + machine.index)) & 1) {
        this.due[machine.index] = Infinity;
      }
    }
    for (const machine of this.states) {
      this.#wake(machine);
    }
    this.#schedule();
  }
}
