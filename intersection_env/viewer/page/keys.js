// The keyboard.

import { make } from "./words.js";

const WORDS = [
  ["Space", "play, pause"],
  ["← →", "0.2 s back, on; with Shift 1 s"],
  ["Home", "back to where the prediction begins"],
  ["M", "begin a prediction at this time"],
  ["R", "recorded or predicted vehicles"],
  ["↑ ↓", "show the crossing order above, below"],
  ["Tab, Enter", "go through the orders, show one"],
  ["[ ]", "slower, faster"],
  [", .", "the selected vehicle 1 m back, on"],
  ["− +", "the selected vehicle 0.5 m/s slower, faster"],
  ["N", "select the next vehicle"],
  ["A, Delete", "add a vehicle, remove the selected one"],
  ["U", "undo all changes at this moment"],
  ["F, 0", "fans on or off; show the junction"],
  ["Esc", "no order, nothing selected"],
];

export function listenToKeys(viewer, { orders, fit }) {
  const help = document.getElementById("help");
  const rows = WORDS.flatMap(([key, words]) => [make("dt", {}, make("kbd", {}, key)), make("dd", {}, words)]);
  help.replaceChildren(make("h2", {}, "Keys"), make("dl", {}, ...rows), make("button", { onclick: () => help.close() }, "Close"));
  const acts = actions(viewer, orders, fit, help);
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || help.open) return;
    const inField = event.target.closest("input, select");
    const isButton = event.target.closest("button, tr") && [" ", "Enter"].includes(event.key);
    if (inField || (isButton && event.target.tagName !== "TR") || (isButton && event.key === "Enter")) return;
    const act = acts[event.key] ?? acts[event.key.toLowerCase()];
    if (!act) return;
    event.preventDefault();
    act(event);
  });
}

function actions(viewer, orders, fit, help) {
  return {
    " ": () => viewer.play(),
    ArrowLeft: (event) => viewer.step(event.shiftKey ? -5 : -1),
    ArrowRight: (event) => viewer.step(event.shiftKey ? 5 : 1),
    ArrowUp: () => orders.choose(-1),
    ArrowDown: () => orders.choose(1),
    Home: () => { viewer.playing = false; viewer.setClock(viewer.moment); viewer.changed(); },
    m: () => viewer.scene && viewer.moveTo(viewer.clock),
    r: () => viewer.scene && viewer.showPrediction(!viewer.predicts),
    "[": () => pace(-1),
    "]": () => pace(1),
    ",": () => nudge(viewer, { position: -1 }),
    ".": () => nudge(viewer, { position: 1 }),
    "-": () => nudge(viewer, { speed: -0.5 }),
    "+": () => nudge(viewer, { speed: 0.5 }),
    "=": () => nudge(viewer, { speed: 0.5 }),
    n: () => next(viewer),
    a: () => { viewer.adds = viewer.source.editable && !viewer.adds; viewer.changed(); },
    Delete: () => viewer.selected && viewer.remove(viewer.selected),
    u: () => viewer.undo(),
    f: () => document.getElementById("fans").click(),
    0: fit,
    "?": () => help.showModal(),
    Escape: () => escape(viewer),
  };
}

function pace(by) {
  const select = document.getElementById("pace");
  select.selectedIndex = Math.max(0, Math.min(select.selectedIndex + by, select.options.length - 1));
  select.dispatchEvent(new Event("change"));
}

function nudge(viewer, by) {
  const one = (viewer.vehicles ?? viewer.prediction?.vehicles)?.find((vehicle) => vehicle.id === viewer.selected);
  if (!one) return viewer.say("select a vehicle first");
  const [[name, step]] = Object.entries(by);
  const most = name === "position" ? viewer.routes[one.route].length : Infinity;
  viewer.changeVehicle(one.id, { [name]: Math.max(0, Math.min(one[name] + step, most)) });
}

function next(viewer) {
  const ids = viewer.prediction?.vehicles.map((one) => one.id) ?? [];
  if (ids.length) viewer.select(ids[(ids.indexOf(viewer.selected) + 1) % ids.length]);
}

function escape(viewer) {
  viewer.adds = false;
  if (viewer.order) {
    viewer.order = null;
    viewer.ask({ ranks: false });
  } else viewer.selected = null;
  viewer.changed();
}
