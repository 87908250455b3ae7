// The header, the time line and the buttons.

import { make, timeOf } from "./words.js";

const THUMB = 16; // [pixel], by which the handle of the time line is narrower than its way

export class Controls {
  constructor(viewer, { fit }) {
    this.viewer = viewer;
    this.at = (id) => document.getElementById(id);
    const on = (id, act, kind = "click") => this.at(id).addEventListener(kind, act);
    on("place", () => viewer.openPlace(this.at("place").value), "change");
    on("scene", () => viewer.openScene(this.at("scene").value), "change");
    on("show-recorded", () => viewer.showPrediction(false));
    on("show-predicted", () => viewer.showPrediction(true));
    for (const name of ["outlines", "fans"]) {
      on(name, () => { viewer[name] = this.at(name).checked; viewer.changed(); }, "change");
    }
    on("add", () => { viewer.adds = !viewer.adds; viewer.changed(); });
    on("reset", () => viewer.undo());
    on("fit", fit);
    on("play", () => viewer.play());
    on("back", () => viewer.step(-1));
    on("forward", () => viewer.step(1));
    on("pace", () => { viewer.pace = Number(this.at("pace").value); }, "change");
    on("to-moment", () => { viewer.playing = false; viewer.setClock(viewer.moment); viewer.changed(); });
    on("predict-here", () => viewer.moveTo(viewer.clock));
    on("time", () => this.goTo(Number(this.at("time").value)), "input");
    on("help-button", () => this.at("help").showModal());
    // The space bar is for playing, not for the button that was clicked last.
    document.addEventListener("click", (event) => event.detail && event.target.closest("button")?.blur());
  }

  // In a scene another moment; without one there is only the prediction to move in.
  goTo(step) {
    this.viewer.playing = false;
    if (this.viewer.scene) this.viewer.moveTo(step);
    else this.viewer.setClock(step);
    this.viewer.changed("controls");
  }

  renderPlaces() {
    const { viewer, at } = this, { places, policy } = viewer.opened;
    at("place").replaceChildren(...places.map((one) => make("option", { selected: one === viewer.place }, one.name)));
    const words = (one) => `${one.id}: ${one.duration.toFixed(0)} s, ${one.vehicles} vehicles`;
    const option = (one) => make("option", { value: one.id, selected: one.id === viewer.scene?.id }, words(one));
    at("scene").replaceChildren(...viewer.place.scenes.map(option));
    at("scene-label").hidden = !viewer.scene;
    at("policy").textContent = policy;
    at("time").max = viewer.last;
    document.title = `${viewer.place.name}${viewer.scene ? ` ${viewer.scene.id}` : ""}: intersection_env`;
  }

  render() {
    const { viewer, at } = this, isScene = viewer.scene !== null;
    const press = (id, isOn) => at(id).setAttribute("aria-pressed", isOn);
    press("show-recorded", !viewer.predicts && isScene);
    press("show-predicted", viewer.predicts || !isScene);
    at("show-recorded").disabled = !isScene;
    press("add", viewer.adds);
    at("add").disabled = !viewer.source.editable;
    at("reset").disabled = !viewer.edited && !viewer.assigned.length;
    at("play").textContent = viewer.playing ? "Pause" : "Play";
    at("predict-here").disabled = !isScene || viewer.clock === viewer.moment;
    at("outline-is").parentElement.hidden = !isScene;
    at("outline-is").textContent = viewer.predicts ? "recorded" : "predicted";
    this.renderMessage();
    this.renderTime();
  }

  renderMessage() {
    const { viewer, at } = this;
    at("message").textContent = viewer.message;
    at("message").title = viewer.message;
  }

  // What changes with each picture.
  renderTime() {
    const { viewer, at } = this, seconds = (steps) => viewer.seconds(steps);
    if (document.activeElement !== at("time") || viewer.playing) at("time").value = Math.round(viewer.clock);
    const share = (steps) => `(100% - ${THUMB}px) * ${steps / Math.max(viewer.last, 1)}`;
    at("window").style.left = `calc(${THUMB / 2}px + ${share(viewer.moment)})`;
    at("window").style.width = `calc(${share(Math.min(viewer.horizon, viewer.last - viewer.moment))})`;
    const ahead = viewer.ahead >= 0 && viewer.ahead <= viewer.horizon ? ` (+${seconds(viewer.ahead).toFixed(1)} s)` : "";
    at("clock").textContent = `${timeOf(seconds(viewer.clock))}${ahead}`;
    at("caption").textContent = this.caption();
  }

  caption() {
    const { viewer } = this;
    if (viewer.adds) return "Click a lane to put a vehicle there.";
    if (!viewer.predicts && viewer.scene) return "recorded traffic";
    const of = viewer.edited ? "changed traffic" : viewer.scene ? "recorded moment" : "traffic";
    if (viewer.order) return `order ${viewer.order.rank} imposed on this ${of}`;
    const assigned = viewer.assigned.length ? `, ${viewer.assigned.length} assigned` : "";
    return `most probable order of this ${of}${assigned}`;
  }
}
