// Who is where at the clock: vehicles with the place, speed and label to draw, and who waits for whom.

// Bodies and outlines; at a moment as it was recorded, the prediction knows who is held.
export function bodiesAndOutlines(viewer) {
  const predicted = predictedNow(viewer), recorded = recordedNow(viewer);
  if (viewer.predicts || !viewer.scene) return [predicted, recorded];
  const atMoment = viewer.clock === viewer.moment;
  const held = new Set(atMoment ? predicted.filter((one) => one.held).map((one) => one.id) : []);
  return [recorded.map((one) => ({ ...one, held: held.has(one.id) })), predicted];
}

export function recordedNow(viewer) {
  if (!viewer.scene) return [];
  return viewer.scene.tracks.flatMap((track) => {
    const at = viewer.clock - track.start;
    if (at < 0 || at > track.position.length - 1) return [];
    const route = viewer.road.routes[track.route];
    return [{ ...track, route, at: between(track.position, at), speed: between(track.speed, at) }];
  });
}

function predictedNow(viewer) {
  if (!isPredicted(viewer)) return [];
  const { ahead } = viewer, { vehicles, position, speed, steps, held } = viewer.prediction;
  const changed = viewer.clock === viewer.moment ? viewer.vehicles : null;
  return vehicles.flatMap((vehicle, index) => {
    if (ahead > steps[index] - 1) return [];
    const own = changed ? changed.find((one) => one.id === vehicle.id) : vehicle; // shown before its answer is there
    if (!own) return [];
    const at = changed ? own.position : between(position[index], ahead);
    const isHeld = held[index].includes(Math.floor(ahead));
    const route = viewer.routes[own.route];
    return [{ ...own, label: vehicle.label, index, route, at, speed: between(speed[index], ahead), held: isHeld }];
  });
}

// Pairs of a prediction's vehicles by their numbers: who waits, and for whom.
export function waitsNow(viewer) {
  const isKnown = viewer.predicts || !viewer.scene || viewer.clock === viewer.moment;
  return isKnown && isPredicted(viewer) ? viewer.prediction.waits[Math.floor(viewer.ahead)] : [];
}

function isPredicted({ prediction, ahead, horizon }) {
  return Boolean(prediction) && ahead >= 0 && ahead <= horizon;
}

// A value between two steps.
function between(values, at) {
  const i = Math.min(Math.floor(at), values.length - 2);
  return i < 0 ? values[0] : values[i] + (at - i) * (values[i + 1] - values[i]);
}
