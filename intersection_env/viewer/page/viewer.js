// What is looked at: a place, a moment, the time, and what is changed there. Numbers of the model come from answers.

import { Latest } from "./latest.js";

const NO_ARM = 5; // whose colour is grey
const NEW_LENGTH = 4.5, NEW_WIDTH = 1.8, NEW_SPEED = 7; // [m], [m/s]; of a vehicle that is added

export class Viewer {
  constructor(source) {
    Object.assign(this, {
      source, opened: null, place: null, road: null, scene: null,
      moment: 0, clock: 0, // steps since the scene's begin; a prediction begins at the moment
      vehicles: null, // as changed; null: as recorded
      assigned: [], order: null, // pairs [first, second]; the row that is shown happening
      prediction: null, ranking: null, selected: null,
      known: new Map(), // the prediction's vehicles by id
      predicts: false, // whether bodies are those of the prediction, and outlines the recorded ones
      outlines: true, fans: true, adds: false, playing: false, pace: 1, sortedBy: "gain",
      message: "", stale: false, frames: 0, epoch: 0, good: null, listeners: [],
    });
    const fail = (error, asked) => this.refused(error, asked);
    const ask = (kind) => (asked) => source.ask(kind, asked.request);
    this.predicting = new Latest(ask("predicted"), (answer, asked) => this.takePrediction(answer, asked), fail);
    this.comparing = new Latest(ask("ranked"), (answer, asked) => this.takeRanking(answer, asked), fail);
  }

  listen(listener) { this.listeners.push(listener); }
  changed(what = "all") { for (const listener of this.listeners) listener(what); }

  async open() {
    this.opened = await this.source.ask("opened");
    const { place, scene, step } = this.opened.start;
    await this.openPlace(place, scene, this.source.moments?.[0] ?? step);
  }

  async openPlace(name, scene = undefined, step = null) {
    this.place = this.opened.places.find((one) => one.name === name);
    const wanted = scene === undefined ? this.place.scenes[0]?.id : scene;
    this.road = await this.source.ask("road", { place: name });
    this.routes = Object.fromEntries(this.road.routes.map((route) => [route.id, route]));
    await this.openScene(wanted ?? null, step);
    this.changed("place");
  }

  async openScene(id, step = null) {
    this.scene = id === null ? null : await this.source.ask("scene", { place: this.place.name, scene: id });
    this.moveTo(step ?? this.scene?.busiest ?? 0);
    this.changed("scene");
  }

  get horizon() { return this.opened.steps; }
  get last() { return this.scene ? this.scene.steps - 1 : this.horizon; }
  get ahead() { return this.clock - this.moment; } // steps into the prediction
  get edited() { return this.vehicles !== null && (this.scene !== null || this.vehicles !== this.place.example); }
  get canEdit() { return this.source.editable && this.clock === this.moment && this.prediction !== null; }
  seconds(steps) { return steps * this.opened.step; }

  // Another moment: what was changed belonged to the one before.
  moveTo(step) {
    this.moment = this.clock = Math.max(0, Math.min(Math.round(step), this.last));
    this.vehicles = this.scene ? null : this.place.example;
    Object.assign(this, { assigned: [], order: null, prediction: null, ranking: null, good: null, message: "" });
    this.known = new Map();
    this.epoch++;
    this.ask();
    this.changed();
  }

  // Asks for the prediction, and for the ranking where it may have changed.
  ask({ ranks = true } = {}) {
    const { vehicles, assigned, order } = this;
    const state = { vehicles, assigned, order };
    this.stale = true;
    this.predicting.request(this.asked(state, order ? { priorities: order.priorities } : { assigned }));
    if (ranks) this.comparing.request(this.asked(state, { assigned }));
  }

  asked(state, bound) {
    const traffic = state.vehicles ? { vehicles: state.vehicles } : { scene: this.scene.id, step: this.moment };
    return { epoch: this.epoch, state, request: { place: this.place.name, ...traffic, ...bound } };
  }

  takePrediction(answer, asked) {
    if (asked.epoch !== this.epoch) return;
    this.prediction = answer;
    this.known = byId(answer?.vehicles ?? []);
    this.good = asked.state;
    this.message = answer ? [...answer.notes, ...overlapping(answer)].join("; ") : "";
    this.stale = this.predicting.next !== null;
    this.changed("prediction");
  }

  takeRanking(answer, asked) {
    if (asked.epoch !== this.epoch) return;
    this.ranking = answer;
    this.changed("ranking");
  }

  // What the core refuses is taken back.
  refused(error, asked) {
    if (asked.epoch !== this.epoch) return;
    this.message = error.message;
    this.stale = false;
    if (this.good && asked.state !== this.good) {
      Object.assign(this, this.good);
      this.comparing.request(this.asked(this.good, { assigned: this.good.assigned }));
    }
    this.changed();
  }

  // Time.

  setClock(steps) {
    const [low, high] = this.predicts ? [this.moment, this.moment + this.horizon] : [0, this.last];
    this.clock = Math.max(low, Math.min(steps, high));
    this.changed("time");
  }

  step(by) {
    this.playing = false;
    const to = Math.round(this.clock + by);
    if (to < this.moment || to > this.moment + this.horizon) {
      if (this.scene && !this.edited) this.moveTo(to);
      else this.setClock(Math.max(this.moment, Math.min(to, this.moment + this.horizon)));
    } else this.setClock(to);
    this.changed();
  }

  play(on = !this.playing) {
    const end = this.predicts ? this.moment + this.horizon : this.last;
    if (on && this.clock >= end) this.clock = this.moment;
    this.playing = on;
    this.changed("controls");
  }

  pass(seconds) {
    const to = this.clock + (seconds * this.pace) / this.opened.step;
    const end = this.predicts ? this.moment + this.horizon : this.last;
    if (to >= end) this.playing = false;
    this.setClock(to);
    if (!this.predicts && this.ahead > this.horizon && this.source.editable) this.moveOn();
    if (!this.playing) this.changed("controls");
  }

  // The recorded traffic plays on beyond the prediction: a new one begins there.
  moveOn() {
    const at = this.clock;
    this.moveTo(Math.floor(at));
    this.clock = at;
  }

  showPrediction(on) {
    this.predicts = on;
    if (on) this.setClock(Math.max(this.moment, Math.min(this.clock, this.moment + this.horizon)));
    this.changed();
  }

  showOrder(row) {
    this.order = row;
    this.predicts = true;
    this.clock = this.moment;
    this.ask({ ranks: false });
    this.play(true);
    this.changed();
  }

  // Changes, all of them at the moment.

  change(how) {
    if (!this.source.editable) return this.say("this page is a copy: nothing can be changed in it");
    if (!this.prediction) return;
    if (this.clock !== this.moment) this.setClock(this.moment);
    this.playing = false;
    this.vehicles = how(structuredClone(this.vehicles ?? this.prediction.vehicles));
    const left = new Set(this.vehicles.map((one) => one.id));
    this.assigned = this.assigned.filter((pair) => pair.every((id) => left.has(id)));
    this.order = null;
    this.predicts = true;
    this.ask();
    this.changed();
  }

  changeVehicle(id, values) {
    this.change((vehicles) => vehicles.map((one) => (one.id === id ? { ...one, ...values } : one)));
  }

  remove(id) {
    this.selected = null;
    this.change((vehicles) => vehicles.filter((one) => one.id !== id));
  }

  add(route, position) {
    this.adds = false;
    this.change((vehicles) => {
      const taken = new Set(vehicles.map((one) => one.id));
      let number = 1;
      while (taken.has(`new ${number}`)) number++;
      const id = `new ${number}`;
      this.selected = id;
      const size = { length: NEW_LENGTH, width: NEW_WIDTH, maxSpeed: null };
      return [...vehicles, { id, label: id, route, position, speed: NEW_SPEED, ...size }];
    });
  }

  // Who of a pair goes first; null leaves it open.
  assign(first, second, wanted) {
    if (!this.source.editable) return this.say("this page is a copy: nothing can be assigned in it");
    const others = this.assigned.filter((pair) => !(pair.includes(first) && pair.includes(second)));
    this.assigned = wanted ? [...others, [first, second]] : others;
    this.order = null;
    this.predicts = true;
    this.setClock(this.moment);
    this.ask();
    this.changed();
  }

  undo() { this.moveTo(this.moment); }

  select(id) {
    this.selected = id;
    this.changed();
  }

  say(message) {
    this.message = message;
    this.changed("message");
  }

  labelOf(id) {
    return this.known.get(id)?.label ?? id;
  }

  armOf(id) {
    const vehicle = this.known.get(id);
    return vehicle ? this.routes[vehicle.route].arm : NO_ARM;
  }
}

const byId = (vehicles) => new Map(vehicles.map((one) => [one.id, one]));

function overlapping(answer) {
  return answer.overlaps.map(([one, other]) => `${one} and ${other} overlap: they do not count in distances`);
}
