// Draws a figure as SVG: panels with axes and layers, one legend, one scale of colours. The reports' figures come from
// crates/views/src/figure.rs, where every field is explained; the page describes its own in the same way.

import { numberText, scaleOf } from "./scale.js";
import { rangeOf, ticksAcross, ticksOf, titleOf } from "./chart_axes.js";
import { LAYERS, alongOf, placeLabels } from "./chart_layers.js";
import { DASHES, FONT, FRAME, GRID, INK, LETTER, LINE, MARKS, TEXT, escaped, group, markStyle, px, tag, widthOf, wrapped, write } from "./svg.js";

/** Least height of a row that a name stands in, px. */
const ROW = 22;
/** Narrowest panel, and the space between two, px. */
const NARROWEST = 250, GAP = 18;
/** Names that take more than this part of a panel's width stand above their bars instead of beside them. */
const NAMES_PART = 0.38;
/** Least space between two ticks of the upward axis, px. */
const BETWEEN_TICKS = 28;

// ---- panels --------------------------------------------------------------------------------

/** The panels of a figure on a page of this width: where they are, their scales, ranges and ticks. */
function layOut(figure, width, state, top, height) {
  const columns = Math.max(1, Math.min(figure.columns ?? 1, Math.floor((width + GAP) / (NARROWEST + GAP))));
  const panels = figure.panels.map((panel, k) => {
    const layers = panel.layers.filter(l => !l.name || !state.hidden.has(l.name)), zoom = state.zoom.get(panel.linked ?? `own ${k}`) ?? {};
    const p = { panel, layers, k, key: panel.linked ?? `own ${k}`, column: k % columns, row: Math.floor(k / columns), scale: figure.scale, labels: [] };
    p.xRange = zoom.x ?? sharedRange(figure, panel, "x", layers, state);
    p.yRange = state.zoom.get(`y ${k}`)?.y ?? sharedRange(figure, panel, "y", layers, state);
    return p;
  });
  const each = (width - GAP * (columns - 1)) / columns;
  for (const p of panels) { surround(p, each); sizePanel(p, each, height); }
  // Axes of one column stand above each other.
  for (const p of panels) p.margin = Math.max(...panels.filter(q => q.column === p.column).map(q => q.ownMargin));
  let y = top;
  for (let row = 0; row <= Math.max(...panels.map(p => p.row)); row++) {
    const ofRow = panels.filter(p => p.row === row);
    for (const p of ofRow) finishPanel(p, each);
    const head = Math.max(...ofRow.map(p => p.head));
    for (const p of ofRow) { p.top = y + head; placePanel(p); }
    y = Math.max(...ofRow.map(p => p.top + p.h + p.foot));
  }
  return { panels, height: y };
}

/** Panels that are linked have one range across; linked maps, and panels of an upward axis that is shared, one upwards too. */
function sharedRange(figure, panel, key, layers, state) {
  const shares = key === "x" ? panel.linked : panel.y.shared ?? (panel.equal ? panel.linked : null);
  if (!shares) return rangeOf(panel[key], key, layers);
  const linked = figure.panels.filter(other => (key === "x" || !other.y.shared ? other.linked : other.y.shared) === shares);
  return rangeOf(panel[key], key, linked.flatMap(other => other.layers.filter(l => !l.name || !state.hidden.has(l.name))));
}

/** What stands above and below a panel, and its height. */
function surround(p, each) {
  const { panel } = p, title = [panel.title, titleOf(panel.y)].filter(Boolean).join(", ");
  p.heading = title ? wrapped(title, each - 4, true) : [];
  p.head = p.heading.length * LINE + 10;
  p.foot = panel.x.hidden ? 12 : 28 + (titleOf(panel.x) ? LINE : 0);
}

/** Height of a panel and the width of the texts left of it. */
function sizePanel(p, each, height) {
  const { panel } = p, names = panel.y.names;
  p.h = height ? Math.max(40, height - p.head - p.foot) : panel.height ?? 240;
  if (names) {
    const widest = Math.max(...names.map(name => widthOf(name))), isAbove = widest > NAMES_PART * each;
    p.names = names.map(name => isAbove ? wrapped(name, each - 24) : [name]);
    // The upper part of a row is for its name, the lower for its bars, about whose middle the axis has its value.
    const above = isAbove ? Math.max(...p.names.map(lines => lines.length)) * LINE : 0, row = above + (isAbove ? ROW - 4 : ROW);
    p.namesAbove = above;
    p.barWidth = (row - above - 4) / row;
    p.yRange = p.yRange.map(v => v - above / 2 / row);
    p.h = names.length * row + 8;
    p.ownMargin = isAbove ? 6 : widest + 10;
    p.yTicks = ticksOf(panel.y);
    return;
  }
  p.yTicks = ticksOf(panel.y, p.yRange, Math.max(3, Math.floor(p.h / BETWEEN_TICKS)));
  p.ownMargin = Math.max(...p.yTicks.map(([, text]) => widthOf(text)), 8) + 10;
}

/** Width of a panel; a map is as high as its width asks for. */
function finishPanel(p, each) {
  const { panel } = p;
  p.w = each - p.margin - 12;
  if (panel.equal) {
    const [dx, dy] = [p.xRange[1] - p.xRange[0], p.yRange[1] - p.yRange[0]], highest = panel.height ?? 560;
    p.h = Math.min(highest, p.w * dy / dx);
    p.w = Math.min(p.w, p.h * dx / dy);
    p.yTicks = ticksOf(panel.y, p.yRange, Math.max(3, Math.floor(p.h / BETWEEN_TICKS)));
  }
  p.left = p.column * (each + GAP) + p.margin;
  p.xTicks = ticksAcross(panel.x, p.xRange, p.w);
}

function placePanel(p) {
  const { panel } = p;
  [p.left, p.top, p.w, p.h] = [p.left, p.top, p.w, p.h].map(Math.round);
  p.x = scaleOf(p.xRange, p.left, p.left + p.w, panel.x.log);
  p.y = scaleOf(p.yRange, p.top + p.h, p.top, panel.y.log);
}

function drawPanel(p, id) {
  const { panel } = p, clip = `${id}-${p.k}`, bottom = p.top + p.h;
  const inX = ([v]) => panel.x.names || (v >= p.x.low - 1e-9 * Math.abs(p.x.low) && v <= p.x.high * (1 + 1e-9));
  const xs = p.xTicks.filter(inX).map(([v, text]) => [px(p.x.at(v)), text]), ys = p.yTicks.map(([v, text]) => [px(p.y.at(v)), text]);
  const lines = (panel.x.names ? [] : xs.map(([x]) => `M${x} ${p.top}v${p.h}`)).concat(panel.y.names ? [] : ys.map(([y]) => `M${p.left} ${y}h${p.w}`));
  const layers = p.layers.map(layer => LAYERS[layer.kind](layer, p)).join("");
  const marks = xs.map(([x]) => `M${x} ${bottom}v4`).concat(panel.y.names ? [] : ys.map(([y]) => `M${p.left} ${y}h-4`));
  return group({}, [
    tag("clipPath", { id: clip }, tag("rect", { x: p.left, y: p.top, width: p.w, height: p.h })),
    tag("path", { d: lines.join(""), stroke: GRID, fill: "none" }),
    tag("g", { "clip-path": `url(#${clip})` }, layers),
    tag("path", { d: `M${p.left} ${p.top}V${bottom}H${p.left + p.w}${marks.join("")}`, stroke: FRAME, fill: "none" }),
    // The last number stays on the figure.
    panel.x.hidden ? "" : xs.map(([x, text]) => write(text, Math.min(x, p.left + p.w + 12 - widthOf(text) / 2), bottom + 17, { "text-anchor": "middle" })).join(""),
    panel.x.hidden ? "" : write(titleOf(panel.x), p.left + p.w / 2, bottom + 17 + LINE, { "text-anchor": "middle" }),
    ys.map(([y, text], k) => p.namesAbove ? namesAbove(p, y, p.names[k]) : write(text, p.left - 8, y + 4, { "text-anchor": "end" })).join(""),
    heading(p), placeLabels(p), panel.wind ? wind(p) : "", beyond(p),
  ]);
}

/** The lines of a name, above the bars at `y`. */
function namesAbove(p, y, lines) {
  return lines.map((line, i) => write(line, p.left + 4, y - (ROW - 4) / 2 - 2 - (lines.length - 1 - i) * LINE)).join("");
}

/** Title in bold, then what is upwards. */
function heading(p) {
  const { panel } = p, first = p.top - 10 - (p.heading.length - 1) * LINE;
  return p.heading.map((line, i) => {
    const bold = i === 0 && panel.title ? Math.min(panel.title.length, line.length) : 0, x = p.left - p.margin + 1;
    const parts = (bold ? tag("tspan", { "font-weight": 600, fill: INK }, escaped(line.slice(0, bold))) : "") + escaped(line.slice(bold));
    return tag("text", { x: px(x), y: px(first + i * LINE), fill: TEXT }, parts);
  }).join("");
}

/** The wind in words, and an arrow that goes with it, in the upper right of a map. */
function wind(p) {
  const { text, towards_deg } = p.panel.wind, wide = widthOf(text), right = p.left + p.w - 8, middle = right - wide / 2;
  return group({}, [
    tag("rect", { x: px(right - wide - 6), y: p.top + 6, width: px(wide + 12), height: 66, fill: "#fff", "fill-opacity": .8, rx: 4 }),
    write(text, right, p.top + 20, { "text-anchor": "end", fill: "#2f6f9f" }),
    tag("path", { d: "M0 20V-8M-6 -7L0 -20L6 -7z", stroke: "#2f6f9f", "stroke-width": 2.5, fill: "#2f6f9f", transform: `translate(${px(middle)} ${p.top + 48}) rotate(${px(towards_deg)})` }),
  ]);
}

/** Says what lies beyond an axis that has limits: nothing is left out in silence. */
function beyond(p) {
  const said = [];
  for (const [key, scale] of [["x", p.x], ["y", p.y]]) {
    if (!p.panel[key].limits) continue;
    // A bar that is cut off has its value.
    const out = p.layers.filter(l => l.kind !== "bars").flatMap(l => Array.isArray(l[key]) ? l[key] : []).filter(v => v != null && (v < scale.low || v > scale.high));
    if (out.length) said.push(`${out.length} beyond, to ${numberText(out.reduce((a, b) => Math.abs(b) > Math.abs(a) ? b : a), 3)}`);
  }
  return said.length ? write(said.join("; "), p.left + p.w - 6, p.top + 14, { "text-anchor": "end", "font-size": LETTER - 1, stroke: "#fff", "stroke-width": 3, "paint-order": "stroke" }) : "";
}

// ---- legend and scale of colours -----------------------------------------------------------

/** One entry a name, in rows; none where there is one name alone. */
function legend(figure, width, state) {
  const first = new Map();
  for (const { layers } of figure.panels) for (const layer of layers) if (layer.name && !first.has(layer.name)) first.set(layer.name, layer);
  if (first.size < 2) return { markup: "", height: 0 };
  let x = 0, y = 0;
  const items = [...first].map(([name, layer]) => {
    const wide = 30 + widthOf(name) + 16;
    if (x > 0 && x + wide - 16 > width) { x = 0; y += ROW; }
    const off = state.hidden.has(name), at = `translate(${px(x)} ${y})`;
    x += wide;
    return tag("g", { transform: at, "data-name": name, role: "button", tabindex: 0, "aria-pressed": off ? "false" : "true", opacity: off ? .4 : null, cursor: "pointer" },
      tag("rect", { width: px(wide - 8), height: ROW - 2, fill: "#fff", "fill-opacity": 0 }) + symbolOf(layer) + write(name, 30, 14, { "text-decoration": off ? "line-through" : null }));
  });
  return { markup: items.join(""), height: y + ROW + 4 };
}

function symbolOf(layer) {
  if (layer.kind === "bars") return tag("rect", { x: 6, y: 4, width: 14, height: 11, fill: layer.colour });
  if (layer.kind === "band") return tag("rect", { x: 3, y: 4, width: 20, height: 11, fill: layer.colour, "fill-opacity": .25 });
  if (layer.kind === "points") {
    const size = Math.min(10, Math.max(6, layer.size ?? 5)), symbol = layer.symbol ?? "dot";
    return tag("path", { d: MARKS[symbol](13, 10, size), ...markStyle(symbol, size, layer.colour ?? "#7a828e") });
  }
  return tag("path", { d: "M2 10H24", stroke: layer.colour, "stroke-width": Math.min(2.2, layer.width ?? 1.5), "stroke-dasharray": DASHES[layer.dash ?? "solid"], fill: "none" });
}

/** The bar of colours with its title and ticks. */
function colourBar(scale, id, top, width) {
  if (!scale) return { markup: "", height: 0 };
  const title = widthOf(scale.title), long = Math.min(260, width - title - 60), left = title + 30;
  const stops = scale.colours.map(([at, colour]) => tag("stop", { offset: at, "stop-color": colour })).join("");
  const tickTexts = scale.ticks.map(([value, text]) => {
    const x = left + alongOf(scale, value) * long;
    return tag("path", { d: `M${px(x)} ${top + 11}v4`, stroke: FRAME }) + write(text, x, top + 27, { "text-anchor": "middle" });
  });
  const bar = tag("rect", { x: left, y: top, width: long, height: 11, fill: `url(#${id}-scale)`, rx: 1.5 });
  return { markup: tag("defs", {}, tag("linearGradient", { id: `${id}-scale` }, stops)) + write(scale.title, 2, top + 10) + bar + tickTexts.join(""), height: 38 };
}

// ---- the whole -----------------------------------------------------------------------------

let figures = 0;

/** A figure on a page: what its reader has hidden and magnified, and where it was drawn last. */
export function newState() {
  return { id: `figure-${++figures}`, hidden: new Set(), zoom: new Map(), panels: [], width: 0 };
}

/** Draws a figure into `host`, as wide as that is; with `height` its panels fill that. */
export function drawFigure(host, figure, state, height) {
  const width = Math.max(240, Math.floor(host.clientWidth));
  const names = legend(figure, width, state), bar = colourBar(figure.scale, state.id, names.height, width), top = names.height + bar.height;
  const first = layOut(figure, width, state, top, height && height - top);
  const drawn = first.panels.map(p => drawPanel(p, state.id)).join("");
  const size = { width, height: Math.ceil(first.height) };
  host.innerHTML = tag("svg", { xmlns: "http://www.w3.org/2000/svg", viewBox: `0 0 ${size.width} ${size.height}`, ...size, "font-family": FONT, "font-size": LETTER,
    role: "group", "aria-label": host.dataset.words }, tag("rect", { ...size, fill: "#fff" }) + names.markup + bar.markup + drawn);
  Object.assign(state, { figure, panels: first.panels, width });
  return host.firstElementChild;
}
