// Places on the drawn routes: from arc length to the ground, and back from the pointer.

export function placeOn(road, route, position) {
  const { x, y, heading } = route;
  const last = x.length - 1;
  const at = Math.max(0, Math.min(position / road.spacing, last));
  const i = Math.min(Math.floor(at), last - 1);
  const share = at - i;
  const between = (values) => values[i] + share * (values[i + 1] - values[i]);
  return { x: between(x), y: between(y), heading: between(heading) };
}

// The polyline of a route between two arc lengths.
export function stretch(road, route, from, to) {
  const points = [placeOn(road, route, from)];
  for (let i = Math.ceil(from / road.spacing + 1e-6); i * road.spacing < to; i++) {
    if (i < route.x.length) points.push({ x: route.x[i], y: route.y[i] });
  }
  points.push(placeOn(road, route, to));
  return points;
}

// The place on a route nearest to a point: arc length, and how far away it is.
export function nearestOn(road, route, point, around = null, within = Infinity) {
  let best = { position: 0, distance: Infinity };
  for (let i = 0; i + 1 < route.x.length; i++) {
    if (around !== null && Math.abs(i * road.spacing - around) > within) continue;
    const dx = route.x[i + 1] - route.x[i], dy = route.y[i + 1] - route.y[i];
    const along = ((point.x - route.x[i]) * dx + (point.y - route.y[i]) * dy) / (dx * dx + dy * dy);
    const share = Math.max(0, Math.min(1, along));
    const distance = Math.hypot(point.x - route.x[i] - share * dx, point.y - route.y[i] - share * dy);
    if (distance < best.distance) best = { position: (i + share) * road.spacing, distance };
  }
  return { ...best, position: Math.min(best.position, route.length) };
}

export function nearestRoute(road, point) {
  let best = { route: null, position: 0, distance: Infinity };
  for (const route of road.routes) {
    const found = nearestOn(road, route, point);
    if (found.distance < best.distance - 0.3) best = { route, ...found };
  }
  return best;
}

// Where a body is, how it lies, and its corners' half lengths.
export function bodyOf(road, route, vehicle, position) {
  const place = placeOn(road, route, position);
  return { ...place, half: vehicle.length / 2, aside: vehicle.width / 2 };
}

export function contains(body, point, margin = 0) {
  const dx = point.x - body.x, dy = point.y - body.y;
  const ahead = dx * Math.cos(body.heading) + dy * Math.sin(body.heading);
  const left = -dx * Math.sin(body.heading) + dy * Math.cos(body.heading);
  return Math.abs(ahead) <= body.half + margin && Math.abs(left) <= body.aside + margin;
}
