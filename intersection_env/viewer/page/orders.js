// The crossing orders: which is best and by how many seconds, and which is how probable.

import { armName, make, percent, signed } from "./words.js";

const SWAPS = 3; // pairs that are named; the others are counted

export class Orders {
  constructor(viewer) {
    this.viewer = viewer;
    const at = (id) => document.getElementById(id);
    Object.assign(this, { says: at("orders-say"), headline: at("headline"), rows: at("order-rows"), section: at("orders") });
    for (const by of ["gain", "probability"]) {
      at(`by-${by}`).addEventListener("click", () => {
        viewer.sortedBy = by;
        this.render();
      });
    }
  }

  render() {
    const { viewer } = this, { ranking } = viewer;
    for (const by of ["gain", "probability"]) {
      const button = document.getElementById(`by-${by}`);
      button.setAttribute("aria-pressed", viewer.sortedBy === by);
      button.disabled = by === "probability" && !viewer.opened.forecasts;
    }
    if (this.isDrawn()) return;
    this.headline.className = "";
    if (!ranking) return this.renderNothing();
    const left = ranking.leftOut ? `, ${ranking.leftOut >= 20000 ? "20,000 or more" : ranking.leftOut} further` : "";
    const kept = viewer.assigned.length ? " that keep what is assigned" : "";
    this.says.textContent = `${ranking.orders} compared${kept}${left}`;
    this.renderHeadline(ranking);
    this.rows.replaceChildren(this.table(ranking));
  }

  // Whether the table shows what there is: it takes the browser longer than all else together, and most changes are not to it.
  isDrawn() {
    const { ranking, order, sortedBy, predicts, assigned, moment, place, known } = this.viewer;
    const vehicles = [...known.values()].map((one) => `${one.label} ${one.route}`).join();
    const shown = [ranking, order, sortedBy, predicts, assigned.join(), moment, place, vehicles];
    if (this.drawn?.every((one, index) => one === shown[index])) return true;
    this.drawn = shown;
    return false;
  }

  renderNothing() {
    const { viewer } = this;
    this.says.textContent = "";
    this.headline.textContent = viewer.source.editable ? "…" : "This file holds predictions at";
    const jump = (step) =>
      make("button", { onclick: () => viewer.moveTo(step) }, `${viewer.seconds(step).toFixed(1)} s`);
    this.rows.replaceChildren(...(viewer.source.moments ?? []).map(jump));
  }

  renderHeadline(ranking) {
    const { viewer } = this, best = ranking.rows.find((row) => row.rank === Math.min(...ranking.rows.map((one) => one.rank)));
    const likely = ranking.rows.filter((row) => row.probability !== null).sort((a, b) => b.probability - a.probability)[0];
    const parts = [];
    if (!best) parts.push(viewer.prediction?.pairs.length ? "No order keeps to what is assigned." : "Nobody meets anybody here: nothing can be ordered.");
    else if (!best.safe) parts.push("No order is safe to impose.");
    else if (best.worthExecuting) parts.push(`Best: ${this.swaps(best)}, saves `, make("b", {}, `${best.gain.toFixed(1)} s`), chance(best, ranking.worthwhileGain), ".");
    else parts.push(`No order is worth an intervention: the best saves ${Math.max(best.gain, 0).toFixed(1)} s.`);
    if (likely) parts.push(make("br"), make("span", { class: "hint" }, `Most probable without (${percent(likely.probability)}): ${this.words(likely.order)}`));
    this.headline.className = best?.worthExecuting ? "good" : best && !best.safe ? "bad" : "";
    this.headline.replaceChildren(...parts);
  }

  words(order) {
    const named = order.map((id) => this.viewer.labelOf(id));
    return named.length > 9 ? `${named.slice(0, 9).join(", ")}, …` : named.join(", ");
  }

  // In which pairs an order is another than what would happen.
  swaps(row) {
    if (!row.differs.length) return "as it would happen, but sure";
    const named = row.differs.map((pair) => pair.map((id) => this.viewer.labelOf(id)).join(" before "));
    const more = named.length - SWAPS;
    return named.slice(0, SWAPS).join(", ") + (more > 0 ? ` and ${more} more` : "");
  }

  listed() {
    const { ranking, sortedBy } = this.viewer;
    if (!ranking) return [];
    const key = { gain: (row) => row.rank, probability: (row) => -(row.probability ?? 0) + (row.atMost ? 1 : 0) }[sortedBy];
    return [...ranking.rows].sort((a, b) => key(a) - key(b) || a.rank - b.rank);
  }

  table(ranking) {
    const most = Math.max(...ranking.rows.map((row) => Math.abs(row.gain)), ranking.worthwhileGain);
    const besides = this.viewer.assigned.length ? "but as assigned" : "";
    const heads = [
      ["", "rank", ""],
      ["order", "", ""],
      ["gain", "number", `expected time saved by all together, against ${besides ? "what is assigned alone" : "no intervention"}`],
      ["probability", "number", `if nobody intervenes ${besides}`],
      ["safe", "safe", ""],
    ];
    const head = heads.map(([text, kind, title]) => make("th", { scope: "col", title, class: kind }, text));
    const none = this.noneRow(ranking);
    const rows = this.listed().map((row) => this.row(row, most));
    return make("table", {}, make("thead", {}, make("tr", {}, ...head)), make("tbody", {}, none, ...rows));
  }

  // Without any order but what is assigned, against which gains are.
  noneRow({ none }) {
    const bound = this.viewer.assigned.length > 0;
    const words = bound ? "nothing but what is assigned" : "no intervention";
    return this.line(null, [
      make("td", {}, "–"),
      make("td", {}, words, make("div", { class: "swaps" }, `${none.loss.toFixed(1)} s lost by all together`)),
      make("td", { class: "number" }, "0.0 s"),
      make("td"),
      make("td"),
    ]);
  }

  row(row, most) {
    const { viewer } = this;
    const chips = row.order.map((id) => make("span", { class: `chip ${armName(viewer.armOf(id))}` }, viewer.labelOf(id)));
    const danger = row.unsafe === null ? "" : `${percent(row.unsafe)} unsafe`;
    const safe = row.safe ? ["good-text", "✓ safe"] : ["bad-text", row.followed ? "✗ too near" : "✗ not followed"];
    return this.line(row, [
      make("td", {}, String(row.rank)),
      make("td", {}, make("div", { class: "chips" }, ...chips), make("div", { class: "swaps" }, this.swaps(row))),
      make("td", { class: "number" }, make("b", {}, signed(row.gain)), meter(Math.abs(row.gain) / most, row.gain < 0)),
      make("td", { class: "number" }, percent(row.probability, row.atMost), meter(row.atMost ? 0 : (row.probability ?? 0))),
      make("td", { title: danger, class: "safe" }, make("span", { class: safe[0] }, safe[1])),
    ]);
  }

  line(row, cells) {
    const { viewer } = this;
    const isShown = viewer.predicts && (viewer.order?.rank ?? null) === (row?.rank ?? null);
    const show = () => viewer.showOrder(row);
    const onkeydown = (event) => event.key === "Enter" && show();
    const unsafe = row && !row.safe ? "unsafe" : "";
    return make("tr", { tabindex: "0", "aria-selected": String(isShown), class: unsafe, onclick: show, onkeydown }, ...cells);
  }

  // The order above or below the one that is shown.
  choose(by) {
    const rows = [null, ...this.listed()];
    const at = rows.findIndex((row) => (row?.rank ?? null) === (this.viewer.order?.rank ?? null));
    const to = Math.max(0, Math.min(at + by, rows.length - 1));
    this.viewer.showOrder(rows[to]);
    this.rows.querySelector('[aria-selected="true"]')?.scrollIntoView({ block: "nearest" });
  }
}

function chance({ worthwhile }, seconds) {
  return worthwhile === null ? "" : ` (${percent(worthwhile)} sure to save more than ${seconds} s)`;
}

function meter(share, isLoss = false) {
  const fill = make("i");
  fill.style.width = `${Math.round(100 * Math.min(share, 1))}%`;
  return make("span", { class: isLoss ? "meter loss" : "meter" }, fill);
}
