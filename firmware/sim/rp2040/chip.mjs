// A Raspberry Pi Pico: rp2040js (npm) with a clock that counts system cycles, a PIO of our own (pio.mjs), and resets.
//
// rp2040js knows no boot ROM, no chip reset and no cost of an exception. Those are here.
import { RP2040 } from 'rp2040js';
import { Pio } from './pio.mjs';

export const CLOCK_HZ = 125_000_000;
const NANOS = 1e9 / CLOCK_HZ;
const FLASH = 0x10000000;
const BOOT_BLOCK = 0x20041f00;
const VTOR = 0x10000100;
const EXCEPTION_ENTRY = 15; // cycles (Cortex-M0+ TRM, 3.7); its return takes 13
const EXCEPTION_RETURN = 13;
const LOOK = 2500; // cycles between two looks outside: half a byte on the line
const BESIDE = 8; // cycles that the DMA may be behind the PIO
const CHIP_RESET = 0x40064;
const DMA_ABORT = 0x444;

/**
 * What the program may ask of the boot ROM (datasheet 2.8.3): a table of one function, reset_to_usb_boot, whose code is
 * UB, and the function that looks for a code in it. Pairs of address and word.
 */
const USB_BOOT = 0x130;
const ROM = [
  [0x14, 0x110], // where the table is
  [0x18, 0x101], // and the function
  [0x100, 0x428a8802], // ldrh r2, [r0]; cmp r2, r1
  [0x104, 0x8840d101], // bne over the next two; ldrh r0, [r0, #2]
  [0x108, 0x20004770], // bx lr; movs r0, #0
  [0x10c, 0x00004770], // bx lr
  [0x110, ((USB_BOOT | 1) << 16) | 0x4255], // UB
  [USB_BOOT, 0xe7fee7fe], // b .
];

/** The flash that a UF2 file describes (https://github.com/microsoft/uf2), after the checks of the boot ROM's loader. */
export function readUf2(file) {
  const blocks = [];
  for (let at = 0; at < file.length; at += 512) {
    const block = file.subarray(at, at + 512);
    const words = [0, 4, 8, 12, 16, 20, 24, 28].map((i) => block.readUInt32LE(i));
    const [first, second, flags, address, size, number, count, family] = words;
    if (first !== 0x0a324655 || second !== 0x9e5d5157 || block.readUInt32LE(508) !== 0x0ab16f30) {
      throw new Error(`block ${number}: no UF2`);
    }
    if (!(flags & 0x2000) || family !== 0xe48bff56 || size !== 256 || count * 512 !== file.length) {
      throw new Error(`block ${number}: not for the RP2040`);
    }
    blocks.push({ address, data: block.subarray(32, 32 + size) });
  }
  return blocks;
}

/** CRC-32 of the boot block: RP2040 datasheet, 2.8.1.3.1. */
function bootChecksum(bytes) {
  let crc = 0xffffffff;
  for (const byte of bytes) {
    crc = (crc ^ (byte << 24)) >>> 0;
    for (let i = 0; i < 8; i++) {
      crc = (crc & 0x80000000 ? (crc << 1) ^ 0x04c11db7 : crc << 1) >>> 0;
    }
  }
  return crc;
}

export class Chip {
  /** program: blocks of readUf2; attach(rp2040, chip): called whenever there is a new one. */
  constructor(program, attach, seed) {
    this.program = program;
    this.attach = attach;
    this.cycle = 0;
    this.resets = 0;
    this.lastReset = 'power';
    this.seed = seed >>> 0 || 1;
    /** What happens outside of the chip, and when: `next` is a cycle, `due(cycle)` does it. */
    this.outside = { next: Infinity, due: () => {} };
    this.sram = null;
    this.pendingReset = null;
    this.absent = 0; // cycles that the processor does nothing
    this.heldOff = 0; // cycles that every interrupt comes later
    this.slept = 0; // cycles in WFI
    this.boot('power');
  }

  random() {
    this.seed = (Math.imul(this.seed, 1664525) + 1013904223) >>> 0;
    return this.seed / 2 ** 32;
  }

  /** kind: power, brownout, external or watchdog. Memory outlasts the last two. */
  boot(kind) {
    const kept = kind === 'external' || kind === 'watchdog' ? this.rp2040.sram : null;
    const rp = (this.rp2040 = new RP2040());
    this.clock = rp.clock;
    this.clock.nanosCounter = this.cycle * NANOS;
    rp.logger = { debug() {}, info() {}, warn() {}, error: (where, what) => console.error(where, what) };
    if (kept) {
      rp.sram.set(kept);
    } else {
      for (let i = 0; i < rp.sram.length; i++) {
        rp.sram[i] = this.random() * 256;
      }
    }
    for (const { address, data } of this.program) {
      rp.flash.set(data, address - FLASH);
    }
    this.lastReset = kind;
    this.#count();
    this.#system(kind);
    this.#pio();
    this.attach(rp, this);
    this.#bootRom();
  }

  /** Every exception costs what it costs. */
  #count() {
    const core = this.rp2040.core;
    const entry = core.exceptionEntry.bind(core);
    const back = core.exceptionReturn.bind(core);
    this.extra = 0;
    core.exceptionEntry = (number) => {
      this.extra += EXCEPTION_ENTRY + this.heldOff;
      entry(number);
    };
    // With interrupts off, WFI ends when one is pending, and it is taken once they are on again; rp2040js takes it at once.
    const check = core.checkForInterrupts.bind(core);
    core.checkForInterrupts = () => {
      if (core.waiting && core.PM) {
        core.waiting = !(core.pendingInterrupts & core.enabledInterrupts);
        return false;
      }
      return check();
    };
    core.exceptionReturn = (value) => {
      this.extra += EXCEPTION_RETURN;
      back(value);
    };
  }

  /** Why the chip was reset (datasheet 2.12.7), and the watchdog's bite. */
  #system(kind) {
    const had = { power: 1 << 8, brownout: 1 << 8, external: 1 << 16, watchdog: 1 << 8 }[kind];
    this.rp2040.peripherals[CHIP_RESET] = {
      readUint32: (offset) => (offset === 8 ? had : 0),
      writeUint32Atomic() {},
    };
    const watchdog = this.rp2040.peripherals[0x40058];
    watchdog.reason = kind === 'watchdog' ? 1 : 0;
    watchdog.onWatchdogTrigger = () => {
      watchdog.alarm.enable = false; // or it would be due again at once
      this.pendingReset = 'watchdog';
    };
  }

  /** What the boot ROM does with a flash that is there (datasheet 2.8.1): the first 256 bytes, if their checksum holds, run in RAM. */
  #bootRom() {
    const { core, flash, sram, bootrom } = this.rp2040;
    ROM.forEach(([at, word]) => {
      bootrom[at / 4] = word;
    });
    this.bootDrive = false;
    const block = flash.subarray(0, 256);
    this.booted = bootChecksum(block.subarray(0, 252)) === Buffer.from(block).readUInt32LE(252);
    if (this.booted) {
      sram.set(block, BOOT_BLOCK - 0x20000000);
      core.VTOR = VTOR;
      core.SP = BOOT_BLOCK;
      core.LR = 0;
      core.PC = BOOT_BLOCK;
    }
  }

  #pio() {
    this.pio = [0, 1].map((number) => new Pio(this.rp2040, this, number, 7 + 2 * number));
    this.pio.forEach((block, number) => {
      this.rp2040.pio[number] = block;
      this.rp2040.peripherals[0x50200 + 0x100 * number] = block;
    });
    const { dma } = this.rp2040; // an abort is over at once
    const read = dma.readUint32.bind(dma);
    dma.readUint32 = (offset) => (offset === DMA_ABORT ? 0 : read(offset));
  }

  /** The cycle of what a pin is doing just now. */
  get now() {
    return this.pio[0].now ?? this.pio[1].now ?? Math.round(this.clock.nanosCounter / NANOS);
  }

  // ---- time

  /** Runs to a cycle, or until stop() says so. */
  runUntil(end, stop = () => false) {
    while (this.cycle < end && !stop()) {
      this.#runTo(Math.min(end, this.outside.next, this.cycle + LOOK));
      if (this.pendingReset) {
        const kind = this.pendingReset;
        this.pendingReset = null;
        this.resets++;
        this.boot(kind);
      }
      if (this.outside.next <= this.cycle) {
        this.outside.due(this.cycle);
      }
    }
  }

  #runTo(end) {
    const { clock, rp2040 } = this;
    const { core } = rp2040;
    if (this.booted && core.PC === USB_BOOT) {
      this.booted = false;
      this.bootDrive = true;
    }
    if (!this.booted) {
      this.cycle = end;
      clock.nanosCounter = end * NANOS;
      return;
    }
    while (this.cycle < end && !this.pendingReset) {
      const alarm = clock.nextAlarm ? clock.nextAlarm.nanos / NANOS : Infinity;
      if (core.waiting && core.pendingInterrupts & core.enabledInterrupts) {
        core.waiting = false; // an interrupt that was pending before WFI ends it at once, which rp2040js misses
      }
      let to = this.cycle;
      if (this.absent) {
        to += this.absent;
        this.absent = 0;
      } else if (core.waiting) {
        const next = Math.min(end, Math.ceil(alarm), this.pio[0].next, this.pio[1].next);
        to = Math.max(next, this.cycle + 1);
        this.slept += to - this.cycle;
      } else {
        to += core.executeInstruction() + this.extra;
        this.extra = 0;
      }
      this.#pass(to);
    }
  }

  /** What goes on beside the processor up to a cycle: PIO, and the DMA and timers that the clock has. */
  #pass(to) {
    const { clock } = this;
    const [one, other] = this.pio;
    while (this.cycle < to) {
      const next = Math.min(one.next, other.next); // until then only the processor and the DMA go on
      this.cycle = next > to ? to : Math.min(to, Math.max(this.cycle + BESIDE, next));
      if (next <= this.cycle) {
        one.run(this.cycle);
        other.run(this.cycle);
      }
      const nanos = this.cycle * NANOS;
      if (clock.nextAlarm && clock.nextAlarm.nanos / NANOS <= this.cycle) {
        clock.tick(nanos - clock.nanosCounter);
      } else {
        clock.nanosCounter = nanos;
      }
    }
  }
}
