// The USB between host and board: rp2040js's CDC host sets the device up; then packets take the time that they take on a full-speed bus.
import { USBCDC } from 'rp2040js';
import { CLOCK_HZ } from './chip.mjs';

const PACKET = 64;
/** Cycles of a bulk packet with its token, handshake and gaps, 13 bytes in all (USB 2.0, table 5-9): 19 full ones a millisecond. */
const duration = (length) => Math.round(((length + 13) * 8 * CLOCK_HZ) / 12e6);

export class Usb {
  /** heard(byte, cycle): one has come from the board. */
  constructor(heard) {
    this.heard = heard;
    this.toBoard = [];
    this.reset();
    this.received = 0;
    this.sent = 0;
  }

  reset() {
    this.armed = false; // the board takes a packet
    this.busy = 0; // cycle until which the bus is taken
    this.going = null; // [cycle, what happens then]
    this.coming = null;
    this.ready = false;
  }

  attach(rp2040, chip) {
    const usb = (this.controller = rp2040.usbCtrl);
    this.reset();
    this.chip = chip;
    const cdc = new USBCDC(usb);
    this.cdc = cdc;
    cdc.onDeviceConnected = () => {
      this.ready = true;
    };
    cdc.onSerialData = (data) => this.#come(data);
    usb.onEndpointRead = (endpoint) => {
      if (endpoint === cdc.outEndpoint) {
        this.armed = true;
        this.#go();
      }
    };
    usb.writeDelayMicroseconds = 0;
    usb.readDelayMicroseconds = 0;
    // A packet to the host is off the board when the bus has carried it, not at once.
    const done = usb.indicateBufferReady.bind(usb);
    usb.indicateBufferReady = (endpoint, out) => {
      if (out || endpoint !== cdc.inEndpoint) {
        done(endpoint, out);
      } else {
        this.finish = () => done(endpoint, out);
      }
    };
  }

  /** SET_LINE_CODING: 8 data bits, no parity, one stop bit (USB CDC PSTN 1.2, 6.3.10). */
  lineCoding(rate) {
    const data = new Uint8Array(7);
    new DataView(data.buffer).setUint32(0, rate, true);
    data[6] = 8;
    const usb = this.controller;
    const read = usb.onEndpointRead;
    usb.onEndpointRead = (endpoint, length) => {
      if (endpoint === 0) {
        usb.onEndpointRead = read;
        usb.endpointReadDone(0, data, 0);
      } else {
        read(endpoint, length);
      }
    };
    usb.sendSetupPacket(Uint8Array.from([0x21, 0x20, 0, 0, 0, 0, 7, 0]));
  }

  #take(length) {
    this.busy = Math.max(this.busy, this.chip.cycle) + duration(length);
    return this.busy;
  }

  /** From the board: rp2040js hands the data over at once. */
  #come(data) {
    const finish = this.finish;
    this.coming = [
      this.#take(data.length),
      (cycle) => {
        finish();
        this.sent += data.length;
        for (const byte of data) {
          this.heard(byte, cycle);
        }
      },
    ];
  }

  /** The host writes. */
  write(bytes) {
    for (const byte of bytes) {
      this.toBoard.push(byte);
    }
    this.#go();
  }

  #go() {
    if (this.armed && this.ready && !this.going && this.toBoard.length) {
      const packet = Uint8Array.from(this.toBoard.splice(0, PACKET));
      this.armed = false;
      this.going = [
        this.#take(packet.length),
        () => {
          this.received += packet.length;
          this.controller.endpointReadDone(this.cdc.outEndpoint, packet, 0);
        },
      ];
    }
  }

  get next() {
    return Math.min(this.going?.[0] ?? Infinity, this.coming?.[0] ?? Infinity);
  }

  due(cycle) {
    for (const way of ['going', 'coming']) {
      const one = this[way];
      if (one && one[0] <= cycle) {
        this[way] = null;
        one[1](one[0]);
      }
    }
    this.#go();
  }

  stats() {
    return { connected: this.ready, received: this.received, sent: this.sent };
  }
}
