// What the pins do: edges, steps, servo pulses; what is connected to the inputs; the trace.
import fs from 'node:fs';
import { CLOCK_HZ } from './chip.mjs';

const US = CLOCK_HZ / 1e6;
const FIRST_SWITCH = 16;
/** The board's wiring, as firmware/src/boards/pico6.h has it. */
export const AXES = ['X', 'Y', 'Z', 'A', 'B', 'C'].map((name, i) => ({ name, step: 2 + i, dir: 8 + i, limit: FIRST_SWITCH + i }));
export const SERVOS = [14, 15];
const ENABLE = 22;
const PULLED_UP = [16, 17, 18, 19, 20, 21, 26];

const NAMES = [...AXES.map((a) => `${a.name}.STEP`), ...AXES.map((a) => `${a.name}.DIR`), 'ENABLE', 'GP14', 'GP15'];
const SIGNALS = new Map([
  ...AXES.map((a, i) => [a.step, i]),
  ...AXES.map((a, i) => [a.dir, 6 + i]),
  [ENABLE, 12],
  [14, 13],
  [15, 14],
]);

/** us: STEP high, low, DIR before and after STEP; ms: wake. From the data sheets. */
const DRIVERS = {
  a4988: { high: 1, low: 1, setup: 0.2, hold: 0.2, wake: 1 },
  drv8825: { high: 1.9, low: 1.9, setup: 0.65, hold: 0.65, wake: 1.7 },
  tmc2209: { high: 0.1, low: 0.1, setup: 0.02, hold: 0.02, wake: 0 },
};

function freshFigures() {
  return {
    positive: 0, negative: 0, first: null, last: null, high: Infinity, low: Infinity, setup: Infinity, hold: Infinity, interval: Infinity,
    violations: { high: 0, low: 0, dir_setup: 0, dir_hold: 0, disabled: 0, waking: 0 },
  };
}

export class Pins {
  constructor(driver, tracePath) {
    this.driver = DRIVERS[driver];
    if (!this.driver) {
      throw new Error(`no driver ${driver}; there are ${Object.keys(DRIVERS).join(', ')}`);
    }
    this.driverName = driver;
    this.net = AXES.map(() => 0);
    this.level = new Map();
    this.edge = AXES.map(() => ({ rise: -Infinity, fall: -Infinity, dir: -Infinity }));
    this.enabledAt = null; // cycle; null: the drivers are off
    this.driven = new Map(); // inputs by hand
    this.switches = [];
    this.clear();
    if (tracePath) {
      this.trace = fs.openSync(tracePath, 'w');
      fs.writeSync(this.trace, JSON.stringify({ armkin_trace: 1, board: 'pico6', clock_hz: CLOCK_HZ, signals: NAMES }) + '\n');
      this.records = [];
    }
  }

  clear() {
    this.figures = AXES.map(freshFigures);
    this.servo = SERVOS.map(() => ({ rise: null, period: [Infinity, 0], width: [Infinity, 0], pulses: 0 }));
  }

  /** Listens to a chip that has just been reset. */
  attach(rp2040, chip) {
    this.chip = chip;
    this.rp2040 = rp2040;
    for (const [gpio, signal] of SIGNALS) {
      const pin = rp2040.gpio[gpio];
      const look = () => {
        const driven = pin.outputEnable;
        this.#changed(gpio, signal, driven ? pin.outputValue : gpio === ENABLE);
      };
      pin.addListener(look);
      look();
    }
    this.inputs();
  }

  record(signal, value, cycle = this.chip.now) {
    if (this.trace !== undefined) {
      this.records.push((BigInt(Math.round(cycle)) << 16n) | BigInt((signal << 8) | value));
      if (this.records.length >= 1 << 14) {
        this.flush();
      }
    }
  }

  flush() {
    if (this.trace !== undefined && this.records.length) {
      fs.writeSync(this.trace, Buffer.from(BigUint64Array.from(this.records).buffer));
      this.records = [];
    }
  }

  /** Nothing more will be recorded. */
  end() {
    this.flush();
    if (this.trace !== undefined) {
      fs.closeSync(this.trace);
    }
  }

  #changed(gpio, signal, high) {
    const before = this.level.get(gpio) ?? gpio === ENABLE;
    this.level.set(gpio, high);
    if (high === before) {
      return;
    }
    const cycle = this.chip?.now ?? 0;
    this.record(signal, high ? 1 : 0, cycle);
    if (signal < 6) {
      (high ? this.#rise : this.#fall).call(this, signal, cycle);
    } else if (signal < 12) {
      this.#turned(signal - 6, cycle);
    } else if (gpio === ENABLE) {
      this.enabledAt = high ? null : cycle;
    } else {
      this.#pulse(this.servo[gpio - 14], high, cycle);
    }
  }

  #rise(i, cycle) {
    const f = this.figures[i];
    const edge = this.edge[i];
    const bad = f.violations;
    const back = this.level.get(AXES[i].dir);
    this.net[i] += back ? -1 : 1;
    f[back ? 'negative' : 'positive']++;
    f.first ??= cycle;
    f.last = cycle;
    const low = (cycle - edge.fall) / US;
    const setup = (cycle - edge.dir) / US;
    f.low = Math.min(f.low, low);
    f.setup = Math.min(f.setup, setup);
    f.interval = Math.min(f.interval, (cycle - edge.rise) / US);
    bad.low += low < this.driver.low;
    bad.dir_setup += setup < this.driver.setup;
    bad.disabled += this.enabledAt === null;
    bad.waking += this.enabledAt !== null && (cycle - this.enabledAt) / US < 1000 * this.driver.wake;
    edge.rise = cycle;
    this.#follow();
  }

  #fall(i, cycle) {
    const f = this.figures[i];
    const high = (cycle - this.edge[i].rise) / US;
    f.high = Math.min(f.high, high);
    f.violations.high += high < this.driver.high;
    this.edge[i].fall = cycle;
  }

  #turned(i, cycle) {
    const f = this.figures[i];
    const hold = (cycle - this.edge[i].rise) / US;
    f.hold = Math.min(f.hold, hold);
    f.violations.dir_hold += hold < this.driver.hold;
    this.edge[i].dir = cycle;
  }

  #pulse(s, high, cycle) {
    if (high) {
      if (s.rise !== null) {
        const period = (cycle - s.rise) / US;
        s.period = [Math.min(s.period[0], period), Math.max(s.period[1], period)];
      }
      s.rise = cycle;
    } else if (s.rise !== null) {
      const width = (cycle - s.rise) / US;
      s.width = [Math.min(s.width[0], width), Math.max(s.width[1], width)];
      s.pulses++;
    }
  }

  // ---- inputs

  /** GP26, 26; -> 26 */
  static number(name) {
    const n = Number(/^(?:GP)?(\d+)$/.exec(name)?.[1] ?? NaN);
    if (!(n >= 0 && n < 29)) {
      throw new Error(`no pin ${name}: GP0 ... GP28`);
    }
    return n;
  }

  /** value: true, false, or undefined: released. */
  drive(gpio, value) {
    if (value === undefined) {
      this.driven.delete(gpio);
    } else {
      this.driven.set(gpio, value);
    }
    this.inputs();
  }

  /** A switch to ground at an axis, pressed while its net steps are at most (below) or at least (above) `at`. */
  addSwitch(axis, gpio, at, below, closed) {
    this.switches = this.switches.filter((s) => s.gpio !== gpio);
    this.switches.push({ axis, gpio, at, below, closed, held: undefined, pressed: false });
    this.#follow();
    this.inputs();
  }

  #follow() {
    for (const s of this.switches) {
      const there = s.below ? this.net[s.axis] <= s.at : this.net[s.axis] >= s.at;
      const pressed = s.held ?? there;
      if (pressed !== s.pressed) {
        s.pressed = pressed;
        this.inputs();
      }
    }
  }

  /** pressed: true, false, or undefined: by position again. */
  hold(axis, pressed) {
    const gpio = AXES[axis].limit;
    if (!this.switches.some((s) => s.gpio === gpio)) {
      this.addSwitch(axis, gpio, Infinity, false, false);
    }
    this.switches.find((s) => s.gpio === gpio).held = pressed;
    this.#follow();
  }

  inputs() {
    for (const gpio of [...PULLED_UP, 27]) {
      const one = this.switches.find((s) => s.gpio === gpio);
      const contact = one ? one.pressed === one.closed : true; // high: no way to ground
      this.rp2040.gpio[gpio].setInputValue(this.driven.get(gpio) ?? (gpio === 27 ? false : contact));
    }
  }

  // ---- figures

  stats() {
    const us = (x) => (Number.isFinite(x) && x > 0 ? x : null);
    const axes = {};
    AXES.forEach(({ name }, i) => {
      const f = this.figures[i];
      axes[name] = {
        net: this.net[i], positive: f.positive, negative: f.negative, enabled: this.enabledAt !== null,
        high_min_us: us(f.high), low_min_us: us(f.low), dir_setup_min_us: us(f.setup), dir_hold_min_us: us(f.hold),
        interval_min_us: us(f.interval), max_rate_hz: us(f.interval) ? 1e6 / f.interval : null,
        first_step_cycle: f.first ?? 0, last_step_cycle: f.last ?? 0, violations: f.violations,
      };
    });
    const servos = {};
    SERVOS.forEach((gpio, i) => {
      const s = this.servo[i];
      servos[`GP${gpio}`] = {
        width_min_us: us(s.width[0]), width_max_us: us(s.width[1]), period_min_us: us(s.period[0]), period_max_us: us(s.period[1]), pulses: s.pulses,
      };
    });
    return { driver: this.driverName, axes, servos };
  }
}
