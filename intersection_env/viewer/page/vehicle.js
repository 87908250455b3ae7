// The selected vehicle: its route, place and speed, and whom it meets.

import { armName, make, percent } from "./words.js";

const TOP_SPEED = 20; // [m/s], of the slider
const BACK = 120; // [m] before the stop line, of the slider

export class VehiclePanel {
  constructor(viewer) {
    this.viewer = viewer;
    this.section = document.getElementById("vehicle");
  }

  render() {
    const { viewer, section } = this;
    const answer = viewer.prediction;
    const index = answer?.vehicles.findIndex((one) => one.id === viewer.selected) ?? -1;
    if (section.contains(document.activeElement) && document.activeElement.matches("input")) return this.renew(index);
    if (!answer || index < 0) return section.replaceChildren(this.hint());
    const vehicle = viewer.vehicles?.find((one) => one.id === viewer.selected) ?? answer.vehicles[index];
    const pairs = answer.pairs.filter((pair) => pair.yielder === index || pair.prioritized === index);
    section.replaceChildren(
      this.heading(vehicle, answer.vehicles[index].label, answer.timeLoss[index]),
      ...this.sliders(vehicle),
      pairs.length ? make("div", {}, ...pairs.map((pair) => this.pair(pair, index))) : make("p", { class: "hint" }, "It has no open conflict."),
    );
  }

  // While a number is being changed, only what it leads to is written anew.
  renew(index) {
    const loss = this.section.querySelector(".loss");
    if (loss && index >= 0) loss.textContent = lossWords(this.viewer.prediction.timeLoss[index]);
  }

  hint() {
    const how = this.viewer.source.editable
      ? "Click a vehicle to see whom it meets; drag it along its route; change its speed, its route, or who goes first."
      : "Click a vehicle to see whom it meets. This page is a copy: nothing can be changed in it.";
    return make("p", { class: "hint" }, how);
  }

  heading(vehicle, label, loss) {
    const { viewer } = this, route = viewer.routes[vehicle.route];
    const routes = viewer.road.routes.map((one) => make("option", { selected: one.id === vehicle.route }, one.id));
    const select = make("select", { "aria-label": "route", disabled: !viewer.source.editable, onchange: () => this.reroute(vehicle, select.value) }, ...routes);
    return make("div", { class: "row" },
      make("span", { class: `chip ${armName(route.arm)}` }, label), "route", select,
      make("span", { class: "hint loss grow" }, lossWords(loss)),
      make("button", { onclick: () => viewer.remove(vehicle.id), disabled: !viewer.source.editable, title: "(Delete)" }, "Remove"));
  }

  // To another route, as far before its line.
  reroute(vehicle, id) {
    const { viewer } = this, before = viewer.routes[vehicle.route], behind = viewer.routes[id];
    const position = behind.stopLine - (before.stopLine - vehicle.position);
    viewer.changeVehicle(vehicle.id, { route: id, position: Math.max(0, Math.min(position, behind.length)) });
  }

  sliders(vehicle) {
    const { viewer } = this, route = viewer.routes[vehicle.route];
    const toLine = route.stopLine - vehicle.position - vehicle.length / 2;
    return [
      this.slider("speed", "m/s", vehicle.speed, 0, TOP_SPEED, (speed) => ({ speed })),
      this.slider("to its line", "m", toLine, -(route.length - route.stopLine - vehicle.length / 2), Math.min(BACK, route.stopLine - vehicle.length / 2),
        (distance) => ({ position: Math.max(0, Math.min(route.stopLine - distance - vehicle.length / 2, route.length)) })),
    ];
  }

  slider(name, unit, value, low, high, values) {
    const { viewer } = this, id = viewer.selected, disabled = !viewer.source.editable;
    const number = make("input", { type: "number", step: 0.1, value: value.toFixed(1), "aria-label": name, disabled });
    const range = make("input", { type: "range", class: "grow", min: low.toFixed(1), max: high.toFixed(1), step: 0.1, "aria-label": name, disabled });
    range.value = value;
    const change = (from, to) => {
      if (!Number.isFinite(from.valueAsNumber)) return;
      to.value = from.value;
      viewer.changeVehicle(id, values(from.valueAsNumber));
    };
    range.addEventListener("input", () => change(range, number));
    number.addEventListener("change", () => change(number, range));
    return make("label", { class: "row" }, make("span", { class: "name" }, name), range, number, make("span", { class: "hint" }, unit));
  }

  // Who of the two goes first: as shown, and by whom it is decided.
  pair(pair, index) {
    const { viewer } = this, { vehicles } = viewer.prediction;
    const other = vehicles[pair.yielder === index ? pair.prioritized : pair.yielder];
    const [yielder, prioritized] = [vehicles[pair.yielder], vehicles[pair.prioritized]];
    const own = viewer.assigned.find((one) => one.includes(yielder.id) && one.includes(prioritized.id));
    const button = (text, isOn, act, title) => make("button", { "aria-pressed": String(isOn), onclick: act, title, disabled: !viewer.source.editable }, text);
    const first = (one, two) => button(`${one.label} first`, own?.[0] === one.id, () => viewer.assign(one.id, two.id, true), `assign: ${one.label} goes before ${two.label}`);
    const shown = pair.first > 0 ? yielder : prioritized;
    const words = pair.first ? `${shown.label} goes first here` : "neither within 10 s";
    const share = pair.yielderFirst === null || viewer.order ? "" : `; ${percent(pair.first > 0 ? pair.yielderFirst : 1 - pair.yielderFirst)}`;
    return make("div", { class: "pair" },
      make("span", {}, make("span", { class: `chip ${armName(viewer.armOf(other.id))}` }, other.label), ` ${yielder.label} yields by rule; `,
        make("b", {}, words), pair.first ? share : ""),
      make("span", { class: "segments" }, first(yielder, prioritized), button("open", !own, () => viewer.assign(yielder.id, prioritized.id, false), "leave it to the drivers"), first(prioritized, yielder)));
  }
}

const lossWords = (seconds) => `loses ${seconds.toFixed(1)} s in 10 s`;
