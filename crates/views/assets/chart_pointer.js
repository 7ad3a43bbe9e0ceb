// What a reader does with a figure: point at a value, magnify a part, hide a series, save it.

import { numberText } from "./scale.js";
import { drawFigure, newState } from "./chart.js";

/** Furthest from the pointer that a value is shown, px. Over a map both ways count alike; over other panels a reader
 * follows the axis across, so that the way up counts little. */
const REACH = 40, UP = 0.35;
/** Shortest way of a pointer that magnifies, px. */
const DRAG = 8;

/** Shows a figure in `host` and lets its reader work with it; the returned function draws it anew, with another
 * description if one is given. `height` asks for the height that it shall fill, if any. */
export function showFigure(host, figure, height = () => undefined) {
  const state = newState(), note = document.createElement("div"), mark = document.createElement("i");
  note.className = "chart-note"; mark.className = "chart-mark";
  let pointer = null, drag = null;
  const draw = (next = figure) => {
    figure = next;
    drawFigure(host, figure, state, height());
    host.append(mark, note);
    point();
  };
  const point = () => {
    const hit = pointer && !drag && nearest(state, ...pointer);
    note.hidden = mark.hidden = !hit;
    if (hit) show(hit, note, mark, host);
  };
  const at = event => { const box = host.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
  host.addEventListener("pointermove", event => { pointer = at(event); if (drag) frame(host, drag, pointer); point(); });
  host.addEventListener("pointerleave", () => { pointer = null; point(); });
  host.addEventListener("pointerdown", event => {
    pointer = at(event);
    const panel = panelAt(state, ...pointer);
    // A finger scrolls the page; a mouse magnifies.
    if (panel && event.pointerType === "mouse" && event.button === 0) { drag = { from: pointer, panel }; host.setPointerCapture(event.pointerId); }
    point();
  });
  host.addEventListener("pointerup", event => {
    const { from, panel } = drag ?? {}, to = at(event);
    host.querySelector(".chart-frame")?.remove();
    drag = null;
    if (panel && magnify(state, panel, from, to)) draw();
  });
  host.addEventListener("dblclick", () => { if (state.zoom.size) { state.zoom.clear(); draw(); } });
  const toggle = event => {
    const name = event.target.closest?.("[data-name]")?.dataset.name;
    if (name == null || (event.key && event.key !== "Enter" && event.key !== " ")) return;
    event.preventDefault();
    if (!state.hidden.delete(name)) state.hidden.add(name);
    draw();
    [...host.querySelectorAll("[data-name]")].find(item => item.dataset.name === name)?.focus();
  };
  host.addEventListener("click", toggle);
  host.addEventListener("keydown", toggle);
  new ResizeObserver(() => { if (host.clientWidth && Math.abs(host.clientWidth - state.width) > 1) draw(); }).observe(host);
  draw();
  return draw;
}

const panelAt = (state, x, y) => state.panels.find(p => x >= p.left && x <= p.left + p.w && y >= p.top && y <= p.top + p.h);

/** The value nearest to the pointer, of all layers of the panel under it. */
function nearest(state, x, y) {
  const p = panelAt(state, x, y);
  if (!p) return null;
  let best = null, least = REACH ** 2;
  for (const layer of p.layers) {
    if (layer.silent || layer.kind === "text" || layer.kind === "field" || layer.kind === "rule" || layer.kind === "band") continue;
    const isBars = layer.kind === "bars", up = p.panel.equal || p.panel.y.names ? 1 : UP;
    const beside = isBars ? (layer.horizontal ? [0, 1] : [1, 0]) : [1, up ** 2];
    for (let i = 0; i < layer.x.length; i++) {
      if (layer.x[i] == null || layer.y[i] == null) continue;
      // Of a bar the distance across it counts alone.
      const px = p.x.at(layer.x[i]), py = p.y.at(layer.y[i]), d = beside[0] * (px - x) ** 2 + beside[1] * (py - y) ** 2;
      if (d < least && px >= p.left - 1 && px <= p.left + p.w + 1) { least = d; best = { p, layer, i, px, py }; }
    }
  }
  return best;
}

/** What is known of a value, line by line: its series, its place on both axes, and what its layer tells besides. */
function wordsOf({ p, layer, i }) {
  const { panel } = p, words = [];
  for (const [key, axis] of [["x", panel.x], ["y", panel.y]]) {
    if (axis.names) { words.push(["", axis.names[Math.round(layer[key][i])]]); continue; }
    if (panel.equal && layer.details) continue;
    words.push([axis.name || panel.title || "", `${numberText(layer[key][i], 5)} ${axis.unit ?? ""}`]);
  }
  if (layer.low?.[i] != null) words.push(["from, to", `${numberText(layer.low[i])}, ${numberText(layer.high[i])}`]);
  for (const { name, unit, values, texts } of layer.details ?? []) words.push([name, texts ? texts[i] : `${numberText(values[i], 5)} ${unit ?? ""}`]);
  if (layer.texts?.[i]) words.push(["", layer.texts[i]]);
  return words;
}

function show(hit, note, mark, host) {
  const head = document.createElement("b");
  head.textContent = hit.layer.name ?? "";
  note.replaceChildren(head, ...wordsOf(hit).map(([name, value]) => {
    const line = document.createElement("div");
    line.textContent = name ? `${name} ${value}` : value;
    return line;
  }));
  Object.assign(mark.style, { left: `${hit.px - 5}px`, top: `${Math.min(Math.max(hit.py, hit.p.top), hit.p.top + hit.p.h) - 5}px` });
  const left = hit.px + 14 + note.offsetWidth < host.clientWidth ? hit.px + 14 : Math.max(0, hit.px - 14 - note.offsetWidth);
  Object.assign(note.style, { left: `${left}px`, top: `${Math.max(0, hit.py - note.offsetHeight - 8)}px` });
}

/** The part that is about to be magnified. */
function frame(host, { from, panel }, to) {
  let box = host.querySelector(".chart-frame");
  if (!box) { box = document.createElement("i"); box.className = "chart-frame"; host.append(box); }
  const [x, y] = partOf(panel, from, to);
  Object.assign(box.style, { left: `${x[0]}px`, width: `${x[1] - x[0]}px`, top: `${y[0]}px`, height: `${y[1] - y[0]}px` });
}

/** Ends across and upwards of the part between two places, px: a way that hardly rises takes the whole height. */
function partOf(p, from, to) {
  const between = (a, b, low, high) => [Math.max(low, Math.min(a, b)), Math.min(high, Math.max(a, b))];
  const whole = [p.top, p.top + p.h], y = between(from[1], to[1], ...whole), isFlat = y[1] - y[0] < 2 * DRAG && !p.panel.equal;
  return [between(from[0], to[0], p.left, p.left + p.w), isFlat || p.panel.y.names ? whole : y];
}

function magnify(state, p, from, to) {
  const [x, y] = partOf(p, from, to);
  if (x[1] - x[0] < DRAG || p.panel.x.names) return false;
  state.zoom.set(p.key, { x: x.map(p.x.back) });
  if (y[1] - y[0] < p.h && y[1] - y[0] >= DRAG) state.zoom.set(`y ${p.k}`, { y: [p.y.back(y[1]), p.y.back(y[0])] });
  return true;
}

/** A link that saves the figure as a file of its own. */
export function saveLink(host, name) {
  const link = document.createElement("a");
  link.textContent = "Save SVG"; link.className = "save"; link.download = `${name}.svg`; link.href = "#";
  link.addEventListener("click", () => {
    const text = new XMLSerializer().serializeToString(host.querySelector("svg"));
    link.href = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}`;
  });
  return link;
}
