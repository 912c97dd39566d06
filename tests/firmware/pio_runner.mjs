// One PIO machine of the emulator, cycle by cycle: cases come as JSON on stdin, what the pins did goes out as JSON.
import fs from 'node:fs';
import { Pio } from '../../firmware/sim/rp2040/pio.mjs';

const SM0 = { clkdiv: 0xc8, execctrl: 0xcc, shiftctrl: 0xd0, instr: 0xd8, pinctrl: 0xdc };

function run(one) {
  const rp2040 = { gpio: [], gpioValues: 0, dma: { setDREQ() {}, clearDREQ() {} }, setInterrupt() {} };
  const chip = { cycle: -1, levels: 0 };
  const pio = new Pio(rp2040, chip, 0, 7);
  const write = (offset, value) => pio.writeUint32Atomic(offset, value, 0);
  one.program.forEach((word, i) => write(0x48 + 4 * i, word));
  for (const name of ['clkdiv', 'execctrl', 'shiftctrl', 'pinctrl']) {
    if (one[name] !== null) {
      write(SM0[name], one[name]);
    }
  }
  one.before.forEach((word) => write(SM0.instr, word));
  const later = new Map(one.tx);
  if (later.has(0)) {
    later.get(0).forEach((word) => write(0x10, word));
  }
  write(0, 1);
  const inputs = new Map(one.inputs);
  let pins = '';
  for (let cycle = 0; cycle < one.cycles; cycle++) {
    chip.levels = inputs.get(cycle) ?? chip.levels;
    pio.run(cycle);
    chip.cycle = cycle;
    pins += ((pio.pinValues >>> one.pin) & 1).toString();
    if (cycle && later.has(cycle)) {
      later.get(cycle).forEach((word) => write(0x10, word));
    }
  }
  const rx = [];
  while (!(pio.readUint32(4) & (1 << 8))) {
    rx.push(pio.readUint32(0x20));
  }
  return { pins, rx, stalled: pio.readUint32(8), irq: pio.irq };
}

process.stdout.write(JSON.stringify(JSON.parse(fs.readFileSync(0, 'utf8')).map(run)));
