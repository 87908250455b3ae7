// The page: its parts, and when each is drawn anew.

import { Camera } from "./camera.js";
import { Controls } from "./controls.js";
import { Diagram } from "./diagram.js";
import { placeOn } from "./geometry.js";
import { listenToKeys } from "./keys.js";
import { MapView } from "./map.js";
import { Orders } from "./orders.js";
import { listenOnDiagram, listenToPointer } from "./pointer.js";
import { recordedNow } from "./shown.js";
import { openSource } from "./source.js";
import { VehiclePanel } from "./vehicle.js";
import { Viewer } from "./viewer.js";

const LONGEST = 0.1; // [s] between pictures that is played; a page in the background does not jump

const viewer = new Viewer(openSource());
const camera = new Camera();
const canvas = document.getElementById("map");
const map = new MapView(canvas, viewer, camera);
const diagram = new Diagram(document.getElementById("diagram"), viewer);
const orders = new Orders(viewer);
const panel = new VehiclePanel(viewer);
const fit = () => { camera.fit(viewer.road.extent); draw(); };
const controls = new Controls(viewer, { fit });
let due = false, before = null, panels = new Set();

// With the next picture; nothing runs while nothing changes.
function draw() {
  if (!due) requestAnimationFrame(picture);
  due = true;
}

viewer.listen((what) => {
  draw();
  if (what !== "time") panels.add(what);
  if (what === "place") fit();
});

function picture(now) {
  if (viewer.playing && before !== null) viewer.pass(Math.min((now - before) / 1000, LONGEST));
  before = viewer.playing ? now : null;
  due = false;
  if (viewer.playing) draw();
  if (!viewer.road) return;
  if (panels.size) renderPanels();
  else controls.renderTime();
  if (hasSize(camera)) map.draw();
  if (hasSize(diagram)) diagram.draw();
  viewer.frames++;
}

function renderPanels() {
  const what = panels;
  panels = new Set();
  if (what.has("place") || what.has("scene")) controls.renderPlaces();
  controls.render();
  document.getElementById("orders").classList.toggle("stale", viewer.stale);
  if (what.size === 1 && (what.has("message") || what.has("controls"))) return;
  diagram.renew();
  orders.render();
  panel.render();
}

function resize() {
  const wasHidden = !hasSize(camera);
  camera.resize(canvas.clientWidth, canvas.clientHeight);
  diagram.resize();
  if (wasHidden && viewer.road) fit();
  draw();
}

function hasSize({ width, height }) { // not so in a frame that is not displayed
  return width > 0 && height > 0;
}

new ResizeObserver(resize).observe(document.querySelector("main"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => viewer.changed());
listenToPointer(canvas, viewer, camera);
listenOnDiagram(diagram.canvas, viewer, diagram);
listenToKeys(viewer, { orders, fit });
resize();
viewer.open().catch((error) => viewer.say(error.message));
window.viewer = Object.assign(viewer, { parts: { camera, map, diagram, placeOn, recordedNow } }); // for the browser's console, and for tests
