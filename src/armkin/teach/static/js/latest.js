// @ts-check

/** One request under way; the newest one waits, older ones are dropped. */
export class Latest {
  /** @param {(fields: any) => Promise<void>} send */
  constructor(send) {
    this.send = send;
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
      const fields = this.next;
      this.next = null;
      await this.send(fields);
    }
    this.busy = false;
  }
}
