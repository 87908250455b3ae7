// Position over time: where each front bumper is, before and past its first conflict, from the moment on.

import { armName, colourOf } from "./words.js";

const LOW = -60, HIGH = 25; // [m] past the first conflict that are shown
const LEFT = 64, RIGHT = 22, TOP = 8, BOTTOM = 24; // [pixel] around
const ROW = 13; // [pixel] between labels

export class Diagram {
  constructor(canvas, viewer) {
    Object.assign(this, { canvas, viewer, still: document.createElement("canvas"), fresh: false });
  }

  renew() { this.fresh = false; }

  resize() {
    Object.assign(this, { width: this.canvas.clientWidth, height: this.canvas.clientHeight });
    this.renew();
  }

  get scales() {
    const { width, height } = this;
    const x = (step) => LEFT + (step / this.viewer.horizon) * (width - LEFT - RIGHT);
    const y = (past) => TOP + ((HIGH - past) / (HIGH - LOW)) * (height - TOP - BOTTOM);
    return { x, y };
  }

  stepAt(px) {
    return ((px - LEFT) / (this.width - LEFT - RIGHT)) * this.viewer.horizon;
  }

  draw() {
    const ratio = window.devicePixelRatio || 1;
    const size = { width: Math.round(this.width * ratio), height: Math.round(this.height * ratio) };
    if (this.canvas.width !== size.width || this.canvas.height !== size.height) Object.assign(this.canvas, size);
    if (!this.fresh) {
      this.fresh = true;
      Object.assign(this.still, size);
      const still = this.still.getContext("2d");
      still.setTransform(ratio, 0, 0, ratio, 0, 0);
      this.drawStill(still);
    }
    const context = this.canvas.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, size.width, size.height);
    context.drawImage(this.still, 0, 0);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.drawCursor(context);
  }

  drawStill(context) {
    this.drawAxes(context);
    const { viewer } = this, { x, y } = this.scales;
    if (!viewer.prediction) return;
    context.save();
    context.beginPath();
    context.rect(LEFT, TOP, this.width - LEFT - RIGHT, this.height - TOP - BOTTOM);
    context.clip();
    const lines = viewer.prediction.vehicles.map((vehicle, index) => this.line(vehicle, index)).sort((a, b) => a.weight - b.weight);
    for (const one of lines) if (one.fan && viewer.fans) this.drawFan(context, one, x, y);
    for (const one of lines) if (one.recorded) this.drawRecorded(context, one, x, y);
    for (const one of lines) this.drawLine(context, one, x, y);
    context.restore();
    this.drawLabels(context, lines, y);
  }

  // What is drawn of a vehicle: numbers of the answer, from its front bumper to its first conflict.
  line(vehicle, index) {
    const { viewer } = this, { pairs, position, steps, fans } = viewer.prediction;
    const route = viewer.routes[vehicle.route];
    const past = (value) => value + vehicle.length / 2 - route.line;
    const meets = pairs.some((pair) => pair.yielder === index || pair.prioritized === index);
    const chosen = viewer.selected === vehicle.id;
    const track = viewer.edited ? null : viewer.scene?.tracks.find((one) => one.id === vehicle.id);
    return {
      vehicle, meets, chosen,
      weight: chosen ? 2 : meets ? 1 : 0,
      colour: colourOf(meets || chosen ? armName(route.arm) : "kerb"),
      alpha: viewer.selected && !chosen ? 0.45 : 1,
      values: position[index].slice(0, steps[index]).map(past),
      fan: fans && (meets || chosen) ? { low: fans.low[index].map(past), high: fans.high[index].map(past) } : null,
      recorded: track && meets ? track.position.slice(viewer.moment - track.start).slice(0, viewer.horizon + 1).map(past) : null,
    };
  }

  drawAxes(context) {
    const { x, y } = this.scales, seconds = this.viewer.seconds(this.viewer.horizon);
    context.font = "11.5px system-ui, 'DejaVu Sans', sans-serif";
    context.fillStyle = colourOf("dim");
    context.strokeStyle = colourOf("line");
    context.lineWidth = 1;
    context.textBaseline = "middle";
    context.textAlign = "right";
    for (let past = LOW; past <= HIGH; past += 20) {
      context.strokeStyle = colourOf(past === 0 ? "dim" : "line");
      context.beginPath();
      context.moveTo(LEFT, y(past));
      context.lineTo(this.width - RIGHT, y(past));
      context.stroke();
      context.fillText(`${past === 0 ? "conflict" : `${past > 0 ? "+" : "−"}${Math.abs(past)} m`}`, 48, y(past));
    }
    context.textAlign = "center";
    context.textBaseline = "alphabetic";
    for (let second = 0; second <= seconds; second += 2) {
      context.fillText(second ? `+${second} s` : "moment", x(second / this.viewer.opened.step), this.height - 8);
    }
  }

  drawFan(context, { fan, colour, alpha }, x, y) {
    context.beginPath();
    fan.high.forEach((past, step) => context.lineTo(x(step), y(past)));
    [...fan.low.entries()].reverse().forEach(([step, past]) => context.lineTo(x(step), y(past)));
    context.closePath();
    context.globalAlpha = 0.16 * alpha;
    context.fillStyle = colour;
    context.fill();
    context.globalAlpha = 1;
  }

  drawLine(context, { values, colour, alpha, weight }, x, y) {
    context.globalAlpha = alpha;
    context.strokeStyle = colour;
    context.lineWidth = [1, 1.8, 3][weight];
    context.beginPath();
    values.forEach((past, step) => context.lineTo(x(step), y(past)));
    context.stroke();
    context.globalAlpha = 1;
  }

  drawRecorded(context, { recorded, colour, alpha }, x, y) {
    context.setLineDash([5, 4]);
    this.drawLine(context, { values: recorded, colour, alpha: 0.8 * alpha, weight: 0 }, x, y);
    context.setLineDash([]);
  }

  // At the left, where lines begin, apart from each other.
  drawLabels(context, lines, y) {
    const shown = lines.filter((one) => one.weight && one.values[0] >= LOW && one.values[0] <= HIGH);
    shown.sort((a, b) => b.values[0] - a.values[0]);
    let free = TOP + 5;
    context.textAlign = "left";
    context.textBaseline = "middle";
    for (const { values, colour, vehicle, chosen } of shown) {
      const at = Math.max(y(values[0]), free);
      if (at > this.height - BOTTOM) break;
      free = at + ROW;
      context.font = `${chosen ? 700 : 600} 11.5px system-ui, 'DejaVu Sans', sans-serif`;
      const width = context.measureText(vehicle.label).width;
      context.globalAlpha = 0.8;
      context.fillStyle = colourOf("surface");
      context.fillRect(LEFT + 3, at - 6, width + 4, 12);
      context.globalAlpha = 1;
      context.fillStyle = colour;
      context.fillText(vehicle.label, LEFT + 5, at);
    }
  }

  drawCursor(context) {
    const { viewer } = this;
    if (viewer.ahead < 0 || viewer.ahead > viewer.horizon) return;
    const at = this.scales.x(viewer.ahead);
    context.strokeStyle = colourOf("ink");
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(at, TOP);
    context.lineTo(at, this.height - BOTTOM + 4);
    context.stroke();
  }
}
