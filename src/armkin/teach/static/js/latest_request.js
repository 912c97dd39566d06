// @ts-check

/** One request under way; the newest one waits, older ones are dropped. */
export class Latest {
  /** @param {(fields: any) => Promise<void>} send @param {() => number} [pace] [ms] from one request to the next */
  constructor(send, pace = () => 0) {
    this.send = send;
    this.pace = pace;
    this.sent = -Infinity; // [ms] when the last one was
    this.busy = false;
    /** @type {any} */
    this.next = null;
    /** @type {Promise<void>} */
    this.done = Promise.resolve();
  }

  /** @param {any} fields */
  push(fields) {
    this.next = fields;
    if (!this.busy) this.done = this.run();
  }

  /** Until nothing is asked any more. */
  async idle() {
    while (this.busy) await this.done;
  }

  async run() {
    this.busy = true;
    while (this.next !== null) {
      const early = this.sent + this.pace() - performance.now();
      if (early > 0) await new Promise((resolve) => setTimeout(resolve, early));
      this.sent = performance.now();
      const fields = this.next;
      this.next = null;
      await this.send(fields);
    }
    this.busy = false;
  }
}
