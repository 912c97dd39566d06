// simboard for the Pico: what firmware/sim is for the AVR boards, with the same options, commands and answers (firmware/sim/README.md).
// Started by simboard.py, which holds the pseudo-terminal; the port's bytes go through the descriptor --fd.
import fs from 'node:fs';
import net from 'node:net';
import readline from 'node:readline';
import { parseArgs } from 'node:util';
import { CLOCK_HZ, Chip, readUf2 } from './chip.mjs';
import { Commands } from './commands.mjs';
import { Line } from './line.mjs';
import { Pins } from './pins.mjs';
import { Usb } from './usb.mjs';

const SLICE = CLOCK_HZ / 4000;

/** @param {string[]} args */
const read = (args) => parseArgs({
  args,
  options: {
    board: { type: 'string' }, elf: { type: 'string' }, port: { type: 'string', default: '' }, stdin: { type: 'boolean' },
    speed: { type: 'string', default: '1' }, ahead: { type: 'string', default: '50' }, patience: { type: 'string', default: '0' },
    'no-reset-on-open': { type: 'boolean' },
    driver: { type: 'string', default: 'a4988' }, do: { type: 'string', multiple: true, default: [] }, baud: { type: 'string', default: '250000' },
    trace: { type: 'string' }, seed: { type: 'string', default: '1' }, fd: { type: 'string' },
    by: { type: 'string', default: 'uart' },
  },
}).values;
let options = read(process.argv.slice(2));

const stepped = options.speed === 'step';
const pace = {
  speed: options.speed === 'max' || stepped ? 0 : Number(options.speed), ahead: Number(options.ahead) / 1e3,
  patience: Number(options.patience) / 1e3,
};
const MOST_PATIENCE = 10_000_000_000n; // [ns] whoever is silent for so long has closed the port, which is not seen here
let pins, line, usb, host, chip, commands;

/** A board that has just been switched on. */
function make() {
  const heard = []; // bytes from the board that nobody has taken yet
  pins = new Pins(options.driver, options.trace);
  line = new Line(
    Number(options.baud),
    (byte, cycle) => {
      heard.push(byte);
      pins.record(251, byte, cycle);
    },
    (byte, cycle) => pins.record(250, byte, cycle),
  );
  usb = new Usb((byte, cycle) => {
    heard.push(byte);
    pins.record(251, byte, cycle);
  });
  host = options.by === 'usb' ? usb : line; // what the port is connected to
  chip = new Chip(
    readUf2(fs.readFileSync(options.elf)),
    (rp2040, self) => {
      pins.attach(rp2040, self);
      line.attach(rp2040, self);
      usb.attach(rp2040, self);
    },
    Number(options.seed),
  );
  commands = new Commands({ chip, pins, line, usb, host, heard, stepped });
  chip.outside = {
    get next() {
      return Math.min(line.next, usb.next, commands.next);
    },
    due(cycle) {
      line.due(cycle);
      usb.due(cycle);
      commands.due(cycle);
    },
  };
  for (const command of options.do) {
    const answer = commands.carryOut(command);
    if (answer.error) {
      process.stderr.write(`simboard: ${command}: ${answer.error}\n`);
      process.exit(2);
    }
  }
  say({ ok: true, port: options.port, board: 'pico6' });
}

function say(answer) {
  process.stdout.write(JSON.stringify(answer) + '\n');
}

make();
if (options.stdin || process.stdin.isTTY) {
  const lines = readline.createInterface({ input: process.stdin });
  lines.on('line', (text) => {
    if (stepped && text.startsWith('renew ')) { // another board, with its options in JSON: this process is warm
      pins.end();
      options = read(JSON.parse(text.slice(6)));
      make();
    } else {
      say(commands.carryOut(text));
    }
  });
  if (options.stdin) {
    lines.on('close', end);
  }
}

function end() {
  pins.flush();
  process.exit(0);
}

// ---- free time: it follows the clock, or the host

let port = null;
let spoken = 0; // cycle at which the host last said something
let spokenAt = 0n; // [ns] the clock then; nobody has spoken yet
let from = { cycle: chip.cycle, time: process.hrtime.bigint() };

/** The cycle that it is by the clock. */
function clock() {
  const seconds = Number(process.hrtime.bigint() - from.time) / 1e9;
  return from.cycle + seconds * (pace.speed || 1) * CLOCK_HZ;
}

/** The cycle that it may be by now: time waits for a host that is silent. */
function allowed() {
  const patient = pace.patience > 0 && process.hrtime.bigint() < spokenAt + MOST_PATIENCE;
  return patient ? Math.min(clock(), spoken + pace.patience * CLOCK_HZ) : clock();
}

function free() {
  return pace.speed === 0 && chip.cycle < spoken + pace.ahead * CLOCK_HZ;
}

function turn() {
  const until = process.hrtime.bigint() + 2_000_000n; // then the host gets a look
  while (process.hrtime.bigint() < until && (free() || chip.cycle < allowed())) {
    chip.runUntil(chip.cycle + SLICE);
    if (commands.heard.length) {
      port.write(Buffer.from(commands.heard.splice(0)));
    }
  }
  if (free() || clock() - chip.cycle > 0.05 * CLOCK_HZ) {
    from = { cycle: chip.cycle, time: process.hrtime.bigint() }; // a busy machine lets time slip
  }
  if (free() || chip.cycle < allowed()) {
    setImmediate(turn);
  } else {
    setTimeout(turn, 1);
  }
}

if (!stepped) {
  port = new net.Socket({ fd: Number(options.fd), readable: true, writable: true });
  port.on('data', (data) => {
    host.write(data);
    spoken = chip.cycle;
    spokenAt = process.hrtime.bigint();
  });
  port.on('error', end);
  port.on('close', end);
  turn();
}
