// The commands of the control channel: one a line, each answered by one object.
import { CLOCK_HZ } from './chip.mjs';
import { Random } from './line.mjs';
import { AXES, Pins } from './pins.mjs';

/** 5ms, 300us, 2s or cycles -> cycles */
function cycles(text) {
  const parts = /^([0-9.]+)(us|ms|s|)$/.exec(text ?? '');
  if (!parts) {
    throw new Error(`a time is wanted, as 5ms: ${text}`);
  }
  return Math.round(Number(parts[1]) * { us: CLOCK_HZ / 1e6, ms: CLOCK_HZ / 1e3, s: CLOCK_HZ, '': 1 }[parts[2]]);
}

function axis(name) {
  const found = AXES.findIndex((a) => a.name === name);
  if (found < 0) {
    throw new Error(`no axis ${name}: ${AXES.map((a) => a.name).join(', ')}`);
  }
  return found;
}

function bytes(hex) {
  if (!/^([0-9a-fA-F]{2})*$/.test(hex)) {
    throw new Error(`bytes in hex are wanted: ${hex}`);
  }
  return Buffer.from(hex, 'hex');
}

export class Commands {
  constructor(board) {
    Object.assign(this, board);
    this.timers = []; // [cycle, command]
    this.since = { cycle: 0, slept: 0 };
  }

  get next() {
    return this.timers.length ? this.timers[0][0] : Infinity;
  }

  due(cycle) {
    while (this.timers.length && this.timers[0][0] <= cycle) {
      this.carryOut(this.timers.shift()[1]);
    }
  }

  carryOut(text) {
    const [word, ...rest] = text.trim().split(/\s+/);
    const known = Object.hasOwn(Commands.all, word) ? Commands.all[word] : null;
    if (!known) {
      return { error: `no command ${word}: ${Object.keys(Commands.all).join(', ')}` };
    }
    try {
      return { ok: true, cycle: this.chip.cycle, ...known.call(this, rest) };
    } catch (error) {
      return { error: error.message };
    }
  }

  static all = {
    cycles() {},

    stats() {
      const { chip, pins, line, since } = this;
      const asleep = (chip.slept - since.slept) / Math.max(1, chip.cycle - since.cycle);
      return {
        board: 'pico6', mcu: 'rp2040', clock_hz: CLOCK_HZ, state: chip.booted ? 'running' : chip.bootDrive ? 'boot drive' : 'no boot block', seconds: chip.cycle / CLOCK_HZ,
        resets: chip.resets, last_reset: chip.lastReset, asleep, ...pins.stats(), uart: line.stats(), usb: this.usb.stats(), line: line.ways,
      };
    },

    clear() {
      this.pins.clear();
      this.since = { cycle: this.chip.cycle, slept: this.chip.slept };
    },

    reset([kind]) {
      if (!['power', 'brownout', 'external', 'watchdog'].includes(kind)) {
        throw new Error('reset power, brownout, external or watchdog');
      }
      this.chip.resets++;
      this.chip.boot(kind);
      this.pins.record(252, 1);
    },

    pin([name, level]) {
      if (!['0', '1', 'z'].includes(level)) {
        throw new Error('pin NAME 0, 1 or z');
      }
      this.pins.drive(Pins.number(name), level === 'z' ? undefined : level === '1');
    },

    'set-switch'([name, at, where, side, ...more]) {
      if (at !== 'at' || !['below', 'above'].includes(side) || !Number.isFinite(Number(where))) {
        throw new Error('set-switch AXIS at COUNT below|above [nc|no] [pin GP16]');
      }
      const number = axis(name);
      const pin = more.indexOf('pin');
      const gpio = pin < 0 ? AXES[number].limit : Pins.number(more[pin + 1] ?? '');
      this.pins.addSwitch(number, gpio, Number(where), side === 'below', more.includes('nc'));
    },

    switch([name, how]) {
      if (!['0', '1', 'auto'].includes(how)) {
        throw new Error('switch AXIS 1, 0 or auto');
      }
      this.pins.hold(axis(name), how === 'auto' ? undefined : how === '1');
    },

    noise(words) {
      const given = { flip: '0', drop: '0', seed: '1', dir: 'both' };
      for (let i = 0; i < words.length; i += 2) {
        if (!Object.hasOwn(given, words[i]) || words[i + 1] === undefined) {
          throw new Error('noise [flip 0.01] [drop 0.01] [seed 7] [dir in|out|both]');
        }
        given[words[i]] = words[i + 1];
      }
      this.line.random = new Random(Number(given.seed));
      for (const way of given.dir === 'both' ? ['in', 'out'] : [given.dir]) {
        Object.assign(this.line.ways[way], { flip: Number(given.flip), drop: Number(given.drop) });
      }
    },

    cut([dir]) {
      for (const way of dir === 'both' ? ['in', 'out'] : [dir]) {
        this.line.ways[way].cut = true;
      }
    },

    restore() {
      for (const way of Object.values(this.line.ways)) {
        Object.assign(way, { flip: 0, drop: 0, cut: false });
      }
    },

    after([time, ...command]) {
      this.timers.push([this.chip.cycle + cycles(time), command.join(' ')]);
      this.timers.sort((a, b) => a[0] - b[0]);
    },

    /** With --speed step: bytes on the line, time passes, what came. */
    run([time, ...rest]) {
      if (!this.stepped) {
        throw new Error('run needs --speed step');
      }
      const end = this.chip.cycle + cycles(time);
      const until = rest[0] === 'until' ? bytes(rest.splice(0, 2)[1])[0] : null;
      this.host.write(bytes(rest[0] ?? ''));
      const { heard } = this;
      let seen = 0;
      this.chip.runUntil(end, () => {
        for (; until !== null && seen < heard.length; seen++) {
          if (heard[seen] === until) {
            return true;
          }
        }
        return false;
      });
      return { cycle: this.chip.cycle, out: Buffer.from(heard.splice(0)).toString('hex') };
    },

    mark([number]) {
      this.pins.record(253, Number(number) & 255);
    },

    flush() {
      this.pins.flush();
    },

    /** The processor does nothing for so long. */
    absent([time]) {
      this.chip.absent = cycles(time);
    },

    /** Every interrupt comes so much later than it would. */
    'hold-off'([time]) {
      this.chip.heldOff = cycles(time);
    },

    /** The host opens the USB's port at another rate. */
    'line-coding'([rate]) {
      this.usb.lineCoding(Number(rate));
    },

    /** The program runs in a circle from here on. */
    hang() {
      const { core, sram } = this.chip.rp2040;
      sram.set([0xfe, 0xe7], 0x3ff00); // b .
      core.PM = true;
      core.waiting = false;
      core.PC = 0x2003ff00;
    },

    help() {
      return { commands: Object.keys(Commands.all).join(' ') };
    },

    quit() {
      this.pins.flush();
      setImmediate(() => process.exit(0));
    },
  };
}
