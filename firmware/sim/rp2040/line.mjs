// The UART between host and board: ten bits a byte both ways, noise, a cable that can be cut.
import { CLOCK_HZ } from './chip.mjs';

const FIFO = 32; // bytes (datasheet 4.2.2)
const FULL = 1 << 5; // UARTFR: the transmitter takes no more

/** A small generator, so that noise repeats. */
export class Random {
  constructor(seed) {
    this.state = BigInt(seed) + 1n;
  }
  next() {
    this.state = (this.state * 6364136223846793005n + 1442695040888963407n) & 0xffffffffffffffffn;
    return Number(this.state >> 33n) / 2 ** 31;
  }
}

class Way {
  constructor() {
    Object.assign(this, { flip: 0, drop: 0, cut: false, bytes: 0, flipped: 0, dropped: 0, cut_off: 0 });
  }

  /** What arrives of a byte: itself, or nothing (null). */
  pass(byte, random) {
    this.bytes++;
    if (this.cut) {
      this.cut_off++;
      return null;
    }
    if (this.drop && random.next() < this.drop) {
      this.dropped++;
      return null;
    }
    if (this.flip && random.next() < this.flip) {
      this.flipped++;
      return byte ^ (1 << Math.floor(random.next() * 8));
    }
    return byte;
  }
}

export class Line {
  /** heard(byte, cycle): a byte has left the board; spoken(byte, cycle): one has arrived there. */
  constructor(baud, heard, spoken) {
    this.spoken = spoken;
    this.byteCycles = (10 * CLOCK_HZ) / baud;
    this.heard = heard;
    this.ways = { in: new Way(), out: new Way() };
    this.random = new Random(1);
    this.toBoard = [];
    this.head = 0;
    this.free = 0; // cycle from which the line to the board is free
    this.out = []; // [cycle, byte] that the board has in its transmitter
    this.outFree = 0;
    this.overruns = 0;
    this.received = 0;
    this.sent = 0;
  }

  attach(rp2040, chip) {
    const uart = rp2040.uart[0];
    this.uart = uart;
    this.chip = chip;
    this.out = [];
    this.outFree = 0;
    uart.onByte = (byte) => {
      this.outFree = Math.max(this.outFree, chip.cycle) + this.byteCycles;
      this.out.push([this.outFree, byte]);
      };
    const flags = Object.getOwnPropertyDescriptor(Object.getPrototypeOf(uart), 'flags').get;
    Object.defineProperty(uart, 'flags', { get: () => flags.call(uart) | (this.out.length > FIFO ? FULL : 0) });
  }

  /** The host writes. */
  write(bytes) {
    const now = this.chip.cycle;
    for (const byte of bytes) {
      this.free = Math.max(this.free, now) + this.byteCycles;
      this.toBoard.push([this.free, byte]);
    }
  }

  get next() {
    const arriving = this.head < this.toBoard.length ? this.toBoard[this.head][0] : Infinity;
    return Math.min(arriving, this.out.length ? this.out[0][0] : Infinity);
  }

  due(cycle) {
    while (this.head < this.toBoard.length && this.toBoard[this.head][0] <= cycle) {
      const byte = this.ways.in.pass(this.toBoard[this.head++][1], this.random);
      if (byte !== null) {
        this.overruns += this.uart.rxFIFO.full ? 1 : 0;
        this.received++;
        this.uart.feedByte(byte);
        this.spoken(byte, cycle);
      }
    }
    if (this.head > 4096) {
      this.toBoard.splice(0, this.head);
      this.head = 0;
    }
    while (this.out.length && this.out[0][0] <= cycle) {
      const [at, byte] = this.out.shift();
      this.sent++;
      const arrived = this.ways.out.pass(byte, this.random);
      if (arrived !== null) {
        this.heard(arrived, at);
      }
    }
  }

  stats() {
    return { received: this.received, sent: this.sent, overruns: this.overruns };
  }
}
