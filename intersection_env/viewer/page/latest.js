// One question at a time; of those that come meanwhile, the last one.

export class Latest {
  constructor(ask, take, fail) {
    Object.assign(this, { ask, take, fail, next: null, busy: false });
  }

  async request(body) {
    this.next = body;
    if (this.busy) return;
    this.busy = true;
    while (this.next) {
      const asked = this.next;
      this.next = null;
      try {
        this.take(await this.ask(asked), asked);
      } catch (error) {
        this.fail(error, asked);
      }
    }
    this.busy = false;
  }
}
