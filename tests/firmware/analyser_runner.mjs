// The analyser's program in the emulator, with a waveform at its pins: [[cycle, levels of GP2 ... GP9], ...] on stdin, its lines out.
import fs from 'node:fs';
import { Chip, readUf2 } from '../../firmware/sim/rp2040/chip.mjs';
import { Usb } from '../../firmware/sim/rp2040/usb.mjs';

const BEGIN = 2_000_000; // cycles: by then the USB is set up
const edges = JSON.parse(fs.readFileSync(0, 'utf8'));
let text = '';
const usb = new Usb((byte) => {
  text += String.fromCharCode(byte);
});
const chip = new Chip(readUf2(fs.readFileSync(process.argv[2])), (rp2040, self) => usb.attach(rp2040, self), 1);
let next = 0;
Object.defineProperty(chip, 'levels', {
  get() {
    const cycle = (chip.pio[0].now ?? chip.cycle) - BEGIN;
    while (next + 1 < edges.length && edges[next + 1][0] <= cycle) {
      next++;
    }
    return edges[next][1] << 2;
  },
});
chip.outside = {
  get next() {
    return usb.next;
  },
  due: (cycle) => usb.due(cycle),
};
const end = BEGIN + edges[edges.length - 1][0];
chip.runUntil(end + 3_500_000, () => chip.cycle > end && text.endsWith('\n'));
process.stdout.write(text);
