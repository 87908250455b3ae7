// The pointer on the map: vehicles are selected and dragged along their routes, the ground is moved, the wheel zooms.

import { bodyOf, contains, nearestOn, nearestRoute } from "./geometry.js";
import { bodiesAndOutlines } from "./shown.js";

const NEAR = 6; // [pixel] beside a body that still mean it
const JUMP = 40; // [m] along its route that a vehicle may be dragged at once, as routes pass near themselves
const LANE = 4; // [m] beside a route that still mean it

export function listenToPointer(canvas, viewer, camera) {
  let dragged = null, last = null;
  const at = (event) => ({ px: event.offsetX, py: event.offsetY, ...camera.toMap(event.offsetX, event.offsetY) });

  canvas.addEventListener("pointerdown", (event) => {
    const point = (last = at(event));
    canvas.setPointerCapture(event.pointerId);
    if (viewer.adds) return addAt(viewer, point);
    const found = vehicleAt(viewer, camera, point);
    viewer.select(found?.id ?? null);
    dragged = found ? { id: found.id, along: grip(viewer, found, point), moved: false } : null;
  });
  canvas.addEventListener("pointermove", (event) => {
    const point = at(event);
    if (!event.buttons) {
      canvas.style.cursor = viewer.adds ? "copy" : vehicleAt(viewer, camera, point) ? "grab" : "default";
      return;
    }
    if (dragged) drag(viewer, dragged, point, last, camera);
    else if (last) {
      camera.pan(point.px - last.px, point.py - last.py);
      last = point;
      viewer.changed("time");
    }
  });
  canvas.addEventListener("pointerup", () => { dragged = last = null; });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    camera.zoom(Math.exp(-event.deltaY * 0.0015), event.offsetX, event.offsetY);
    viewer.changed("time");
  }, { passive: false });
}

// On the diagram the pointer drags the time within the prediction.
export function listenOnDiagram(canvas, viewer, diagram) {
  const to = (event) => {
    viewer.playing = false;
    viewer.setClock(viewer.moment + Math.max(0, Math.min(Math.round(diagram.stepAt(event.offsetX)), viewer.horizon)));
    viewer.changed("controls");
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    to(event);
  });
  canvas.addEventListener("pointermove", (event) => event.buttons && to(event));
}

function vehicleAt(viewer, camera, point) {
  const [bodies] = bodiesAndOutlines(viewer);
  const margin = NEAR / camera.scale;
  return bodies.find((one) => contains(bodyOf(viewer.road, one.route, one, one.at), point, margin)) ?? null;
}

// How far from its middle a vehicle is held.
function grip(viewer, one, point) {
  return one.at - nearestOn(viewer.road, one.route, point, one.at, JUMP).position;
}

function drag(viewer, dragged, point, from, camera) {
  if (!dragged.moved && Math.hypot(point.px - from.px, point.py - from.py) < 3) return;
  if (!dragged.moved && !viewer.canEdit) {
    if (viewer.source.editable) viewer.say("vehicles are moved where a prediction begins: press Home, or M to begin one here");
    else viewer.say("this page is a copy: nothing can be changed in it");
    return;
  }
  dragged.moved = true;
  const now = viewer.vehicles?.find((one) => one.id === dragged.id) ?? viewer.prediction.vehicles.find((one) => one.id === dragged.id);
  const route = viewer.routes[now.route];
  const { position } = nearestOn(viewer.road, route, point, now.position, JUMP);
  const to = Math.max(0, Math.min(position + dragged.along, route.length));
  if (Math.abs(to - now.position) > 0.01) viewer.changeVehicle(dragged.id, { position: Number(to.toFixed(2)) });
}

function addAt(viewer, point) {
  const { route, position, distance } = nearestRoute(viewer.road, point);
  if (distance > LANE) return viewer.say("no lane is there");
  viewer.add(route.id, Number(position.toFixed(2)));
}
