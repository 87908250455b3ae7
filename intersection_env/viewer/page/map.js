// The intersection from above: the road, which stands still, and what drives on it.

import { bodyOf, placeOn, stretch } from "./geometry.js";
import { bodiesAndOutlines, waitsNow } from "./shown.js";
import { armName, colourOf } from "./words.js";

const LABEL_FROM = 3.2; // [pixel a metre], from where on labels can be read
const FAN_WIDTH = 2.4; // [m]
const WINDSCREEN = [0.2, 0.36]; // of a body's half length, behind its front
const ARROW_HEAD = 8; // [pixel]

export class MapView {
  constructor(canvas, viewer, camera) {
    Object.assign(this, { canvas, viewer, camera, still: document.createElement("canvas"), drawn: "" });
  }

  draw() {
    const ratio = window.devicePixelRatio || 1;
    const { canvas, camera, viewer } = this;
    const width = Math.round(camera.width * ratio), height = Math.round(camera.height * ratio);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    this.drawStill(ratio, width, height);
    const context = canvas.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.drawImage(this.still, 0, 0);
    camera.apply(context, ratio);
    const [bodies, outlines] = bodiesAndOutlines(viewer);
    if (viewer.fans) this.drawFans(context);
    this.drawPath(context, bodies);
    if (viewer.outlines) for (const one of outlines) this.drawOutline(context, one);
    this.drawWaits(context, bodies);
    for (const one of bodies) this.drawBody(context, one);
    this.drawLabels(context, ratio, bodies);
  }

  drawStill(ratio, width, height) {
    const { viewer, camera } = this;
    const key = [viewer.road.name, camera.moved, width, height, colourOf("asphalt")].join();
    if (key === this.drawn) return;
    this.drawn = key;
    Object.assign(this.still, { width, height });
    const context = this.still.getContext("2d");
    context.fillStyle = colourOf("ground");
    context.fillRect(0, 0, width, height);
    camera.apply(context, ratio);
    const pixel = 1 / camera.scale;
    const paved = new Path2D();
    for (const ring of viewer.road.paved.flat()) trace(paved, ring, true);
    context.fillStyle = colourOf("asphalt");
    context.fill(paved, "evenodd");
    context.fillStyle = colourOf("conflict");
    for (const area of viewer.road.conflicts) {
      const path = new Path2D();
      trace(path, area, true);
      context.fill(path);
    }
    stroke(context, viewer.road.borders, colourOf("marking"), Math.max(0.12, pixel));
    context.strokeStyle = colourOf("kerb");
    context.lineWidth = 1.2 * pixel;
    context.stroke(paved);
    const lines = (mustYield) => viewer.road.stopLines.filter((one) => one.mustYield === mustYield).map((one) => one.ends);
    stroke(context, lines(false), colourOf("marking"), 0.35);
    stroke(context, lines(true), colourOf("stop"), 0.5);
  }

  // Where each may be by now, along its route.
  drawFans(context) {
    const { viewer } = this;
    const fans = viewer.prediction?.fans;
    if (!fans || viewer.ahead <= 0 || viewer.ahead > viewer.horizon) return;
    const at = Math.round(viewer.ahead);
    viewer.prediction.vehicles.forEach((vehicle, index) => {
      const route = viewer.routes[vehicle.route];
      const low = Math.max(0, fans.low[index][at]), high = Math.min(route.length, fans.high[index][at]);
      if (high - low < 0.2) return;
      context.globalAlpha = viewer.selected && viewer.selected !== vehicle.id ? 0.1 : 0.28;
      const points = stretch(viewer.road, route, low, high).map(({ x, y }) => [x, y]);
      stroke(context, [points], colourOf(armName(route.arm)), FAN_WIDTH, "round");
    });
    context.globalAlpha = 1;
  }

  // The way of the selected vehicle within the prediction.
  drawPath(context, bodies) {
    const { viewer, camera } = this;
    const one = bodies.find((body) => body.id === viewer.selected);
    if (!one) return;
    const points = stretch(viewer.road, one.route, one.at, one.route.length).map(({ x, y }) => [x, y]);
    stroke(context, [points], colourOf(armName(one.route.arm)), Math.max(0.3, 2 / camera.scale));
  }

  drawOutline(context, one) {
    const body = bodyOf(this.viewer.road, one.route, one, one.at);
    const pixel = 1 / this.camera.scale;
    context.save();
    context.translate(body.x, body.y);
    context.rotate(body.heading);
    context.setLineDash([4 * pixel, 3 * pixel]);
    context.lineWidth = 1.5 * pixel;
    context.strokeStyle = colourOf("ghost");
    context.beginPath();
    context.roundRect(-body.half, -body.aside, 2 * body.half, 2 * body.aside, 0.4);
    context.stroke();
    context.restore();
  }

  drawBody(context, one) {
    const { viewer, camera } = this;
    const body = bodyOf(viewer.road, one.route, one, one.at);
    const { half, aside } = body, pixel = 1 / camera.scale;
    context.save();
    context.translate(body.x, body.y);
    context.rotate(body.heading);
    if (one.id === viewer.selected) {
      context.lineWidth = Math.max(0.35, 2.5 * pixel);
      context.strokeStyle = colourOf("ink");
      context.beginPath();
      context.roundRect(-half - 0.6, -aside - 0.6, 2 * half + 1.2, 2 * aside + 1.2, 0.8);
      context.stroke();
    }
    context.fillStyle = colourOf(armName(one.route.arm));
    context.strokeStyle = colourOf("surface");
    context.lineWidth = Math.min(0.25, 1.2 * pixel);
    context.beginPath();
    context.roundRect(-half, -aside, 2 * half, 2 * aside, [0.3, 0.7, 0.7, 0.3]);
    context.fill();
    context.stroke();
    context.fillStyle = "rgb(255 255 255 / 55%)";
    const [near, far] = WINDSCREEN.map((share) => half - share * 2 * half);
    context.fillRect(far, -0.78 * aside, near - far, 1.56 * aside);
    if (one.held) {
      const deep = Math.max(0.45, 2.5 * pixel);
      context.fillStyle = colourOf("wait");
      context.fillRect(half + 0.35, -aside - 0.2, deep, 2 * aside + 0.4);
    }
    context.restore();
  }

  // Who waits for whom: of the selected vehicle all, of the others to the nearest one alone, which is enough to see.
  drawWaits(context, bodies) {
    const { viewer, camera } = this;
    const by = new Map(bodies.map((one) => [one.id, bodyOf(viewer.road, one.route, one, one.at)]));
    const ids = viewer.prediction?.vehicles.map((one) => one.id);
    const nearest = new Map();
    const arrows = [];
    for (const [waiting, awaited] of waitsNow(viewer)) {
      const from = by.get(ids[waiting]), to = by.get(ids[awaited]);
      if (!from || !to) continue;
      const arrow = { from, to, way: Math.hypot(to.x - from.x, to.y - from.y) };
      if ([ids[waiting], ids[awaited]].includes(viewer.selected)) arrows.push(arrow);
      else if (!viewer.selected && !(nearest.get(waiting)?.way < arrow.way)) nearest.set(waiting, arrow);
    }
    context.fillStyle = context.strokeStyle = colourOf("wait");
    context.lineWidth = 1.6 / camera.scale;
    for (const { from, to } of [...arrows, ...nearest.values()]) this.drawArrow(context, from, to);
  }

  // From the front of a body to the border of another.
  drawArrow(context, from, to) {
    const head = ARROW_HEAD / this.camera.scale;
    const x = from.x + (from.half + 0.8) * Math.cos(from.heading), y = from.y + (from.half + 0.8) * Math.sin(from.heading);
    const way = Math.hypot(to.x - x, to.y - y);
    const until = way - to.aside - 0.4;
    if (until < head) return;
    const dx = (to.x - x) / way, dy = (to.y - y) / way;
    const tip = { x: x + until * dx, y: y + until * dy };
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(tip.x - head * dx, tip.y - head * dy);
    context.stroke();
    context.beginPath();
    context.moveTo(tip.x, tip.y);
    context.lineTo(tip.x - head * dx - 0.45 * head * dy, tip.y - head * dy + 0.45 * head * dx);
    context.lineTo(tip.x - head * dx + 0.45 * head * dy, tip.y - head * dy - 0.45 * head * dx);
    context.fill();
  }

  drawLabels(context, ratio, bodies) {
    const { viewer, camera } = this;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.drawScale(context);
    if (camera.scale < LABEL_FROM) return;
    context.font = "600 12px system-ui, 'DejaVu Sans', sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.lineWidth = 3;
    context.lineJoin = "round";
    context.strokeStyle = colourOf("surface");
    context.fillStyle = colourOf("ink");
    for (const one of bodies) {
      const place = placeOn(viewer.road, one.route, one.at);
      const off = one.width / 2 + 10 / camera.scale;
      const at = camera.toPixel({ x: place.x + off * Math.sin(place.heading), y: place.y - off * Math.cos(place.heading) });
      context.strokeText(one.label, at.x, at.y);
      context.fillText(one.label, at.x, at.y);
    }
  }

  drawScale(context) {
    const length = [5, 10, 20, 50, 100].find((one) => one * this.camera.scale > 60) ?? 200;
    const right = this.camera.width - 14, low = this.camera.height - 48, width = length * this.camera.scale;
    context.strokeStyle = context.fillStyle = colourOf("dim");
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(right - width, low - 4);
    context.lineTo(right - width, low);
    context.lineTo(right, low);
    context.lineTo(right, low - 4);
    context.stroke();
    context.font = "12px system-ui, 'DejaVu Sans', sans-serif";
    context.textAlign = "center";
    context.textBaseline = "alphabetic";
    context.fillText(`${length} m`, right - width / 2, low - 6);
  }
}

function trace(path, points, closed = false) {
  points.forEach(([x, y], index) => (index ? path.lineTo(x, y) : path.moveTo(x, y)));
  if (closed) path.closePath();
}

function stroke(context, lines, colour, width, cap = "butt") {
  const path = new Path2D();
  for (const line of lines) trace(path, line);
  Object.assign(context, { strokeStyle: colour, lineWidth: width, lineCap: cap, lineJoin: "round" });
  context.stroke(path);
  context.lineCap = "butt";
}
