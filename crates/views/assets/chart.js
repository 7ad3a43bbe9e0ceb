// Draws a figure as SVG: panels with axes and layers, one legend, one scale of colours. The reports' figures come from
// crates/views/src/figure.rs, where every field is explained; the page describes its own in the same way.

import { logTicks, numberText, scaleOf, ticks } from "./scale.js";
import { contourLines, paintGrid, plumeShade } from "./grid.js";

export const INK = "#16181d";
const TEXT = "#3a3f48", FRAME = "#9aa0ab", GRID = "#eceef1";
const FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif";
/** Size of letters, distance of lines, and the least height of a row that a name stands in, px. */
const LETTER = 12, LINE = 16, ROW = 22;
/** Narrowest panel, and the space between two, px. */
const NARROWEST = 250, GAP = 18;
/** Names that take more than this part of a panel's width stand above their bars instead of beside them. */
const NAMES_PART = 0.38;
/** Colours that a scale of colours is drawn with: so many that no step is seen, so few that a path holds all points of one. */
const BINS = 32;
const DASHES = { solid: "", dotted: "1.5 3", dashed: "6 4", dashdotted: "7 3 1.5 3" };

// ---- text and marks ------------------------------------------------------------------------

const measure = document.createElement("canvas").getContext("2d");

/** Width of a text, px. */
function widthOf(text, bold) {
  measure.font = `${bold ? 600 : 400} ${LETTER}px ${FONT}`;
  return measure.measureText(text).width;
}

const escaped = text => String(text).replace(/[&<>"]/g, c => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);

/** An element as text; attributes that are null are left out. */
function tag(name, attributes, inside = "") {
  const all = Object.entries(attributes).filter(([, v]) => v != null && v !== "");
  return `<${name}${all.map(([k, v]) => ` ${k}="${escaped(v)}"`).join("")}>${inside}</${name}>`;
}

const write = (text, x, y, more = {}) => tag("text", { x: px(x), y: px(y), fill: TEXT, ...more }, escaped(text));
const px = v => Number(v.toFixed(1));
const group = (attributes, parts) => tag("g", attributes, parts.join(""));

/** Text in lines no wider than `width`, px; a word that is wider stands alone. */
function wrapped(text, width, bold) {
  const lines = [];
  for (const word of text.split(" ")) {
    const longer = lines.length ? `${lines[lines.length - 1]} ${word}` : word;
    if (lines.length && widthOf(longer, bold) <= width) lines[lines.length - 1] = longer; else lines.push(word);
  }
  return lines;
}

/** A mark about the origin of a path, `size` wide. */
const MARKS = {
  dot: (x, y, s) => `M${px(x)} ${px(y)}h0`,
  diamond: (x, y, s) => `M${px(x)} ${px(y - 0.75 * s)}l${px(.75 * s)} ${px(.75 * s)} ${px(-.75 * s)} ${px(.75 * s)} ${px(-.75 * s)} ${px(-.75 * s)}z`,
  square: (x, y, s) => `M${px(x - s / 2)} ${px(y - s / 2)}h${px(s)}v${px(s)}h${px(-s)}z`,
  ring: (x, y, s) => `M${px(x - s / 2)} ${px(y)}a${px(s / 2)} ${px(s / 2)} 0 1 0 ${px(s)} 0a${px(s / 2)} ${px(s / 2)} 0 1 0 ${px(-s)} 0z`,
  cross: (x, y, s) => `M${px(x - s / 2)} ${px(y)}h${px(s)}M${px(x)} ${px(y - s / 2)}v${px(s)}`,
  bar: (x, y, s) => `M${px(x)} ${px(y - s / 2)}v${px(s)}`,
};

/** Attributes of the path of marks: dots are the round ends of strokes without length, so that thousands are one path. */
function markStyle(symbol, size, colour) {
  if (symbol === "dot") return { stroke: colour, "stroke-width": px(size), "stroke-linecap": "round", fill: "none" };
  if (symbol === "ring" || symbol === "cross" || symbol === "bar") return { stroke: colour, "stroke-width": 2.2, fill: "none" };
  return { fill: colour };
}

// ---- colours by value ----------------------------------------------------------------------

const bytes = hex => [1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16));

/** The colour so far along the scale of colours, 0 to 1. */
function colourAt(colours, along) {
  const next = Math.max(1, colours.findIndex(([at]) => at >= along)), [[a, from], [b, to]] = [colours[next - 1], colours[next]];
  const part = (along - a) / (b - a), [f, t] = [bytes(from), bytes(to)];
  return `rgb(${f.map((v, k) => Math.round(v + part * (t[k] - v))).join(",")})`;
}

const alongOf = (scale, value) => Math.min(1, Math.max(0, (value - scale.low) / (scale.high - scale.low)));

// ---- ranges and ticks of axes --------------------------------------------------------------

const isHorizontal = layer => layer.kind === "bars" && layer.horizontal;

/** All values of a layer along an axis, "x" or "y". */
function* valuesAlong(layer, key) {
  if (layer.kind === "field") {
    const { grid } = layer, [from, n] = key === "x" ? [grid.x, grid.columns] : [grid.y, grid.rows];
    yield* [from, from + (n - 1) * grid.step];
    return;
  }
  if (layer.kind === "rule") { if (layer[key] != null) yield layer[key]; return; }
  if (layer.kind === "bars" && isHorizontal(layer) === (key === "x")) yield 0;
  if (layer.kind === "bars" && layer.widths && !isHorizontal(layer) && key === "x") {
    for (let i = 0; i < layer.x.length; i++) { yield layer.x[i] - layer.widths[i] / 2; yield layer.x[i] + layer.widths[i] / 2; }
  }
  yield* layer[key] ?? [];
  if ((layer.along ?? "y") === key) { yield* layer.low ?? []; yield* layer.high ?? []; }
}

/** Lowest and highest value of an axis, with some space beside them. */
function rangeOf(axis, key, layers) {
  if (axis.names) return key === "y" ? [axis.names.length - 0.5, -0.5] : [-0.5, axis.names.length - 0.5];
  if (axis.range) return axis.range;
  let low = Infinity, high = -Infinity;
  const include = v => { if (Number.isFinite(v) && (!axis.log || v > 0)) { low = Math.min(low, v); high = Math.max(high, v); } };
  for (const layer of layers) for (const v of valuesAlong(layer, key)) if (v != null) include(v);
  for (const v of axis.include ?? []) include(v);
  if (low > high) return axis.log ? [1, 10] : [0, 1];
  if (axis.limits) [low, high] = [Math.max(low, axis.limits[0]), Math.min(high, axis.limits[1])];
  if (axis.log) { const by = Math.max(1.05, (high / low) ** 0.04); return [low / by, high * by]; }
  const hasMarks = layers.some(l => l.kind !== "line" && l.kind !== "band" && l.kind !== "field" && l.kind !== "rule");
  const part = key === "y" ? 0.06 : hasMarks ? 0.03 : 0, by = low === high ? Math.max(Math.abs(low) * 0.05, 0.5) : part * (high - low);
  const floor = axis.floor ?? (low >= 0 && layers.some(l => l.kind === "bars" && isHorizontal(l) === (key === "x")) ? 0 : -Infinity);
  return [Math.max(low - by, floor), high + by];
}

function ticksOf(axis, [low, high] = [], most = 0) {
  if (axis.names) return axis.names.map((name, i) => [i, name]);
  return axis.log ? logTicks(low, high, most) : ticks(low, high, most, axis.unit);
}

/** As many ticks as have room for their texts beside each other. */
function ticksAcross(axis, range, width) {
  for (let most = Math.max(2, Math.floor(width / 46)); ; most--) {
    const all = ticksOf(axis, range, most), widest = Math.max(0, ...all.map(([, text]) => widthOf(text)));
    if (most <= 1 || axis.names || (widest + 14) * (all.length - 1) <= width) return all;
  }
}

export const titleOf = axis => [axis.name, axis.unit].filter(Boolean).join(", ");

// ---- layers --------------------------------------------------------------------------------

/** A path through points, broken where one is not known. Where many fall on a column of pixels it goes from the lowest
 * to the highest of them. */
function pathThrough(xs, ys, p, step) {
  let path = "", pen = false, column = null, low = 0, high = 0, last = 0;
  const thins = xs.length > 2 * p.w;
  const flush = () => { if (column !== null && low > high) path += `L${column} ${px(low)}L${column} ${px(high)}L${column} ${px(last)}`; };
  for (let i = 0; i < xs.length; i++) {
    if (xs[i] == null || ys[i] == null) { flush(); column = null; pen = false; continue; }
    const [x, y] = [p.x.at(xs[i]), p.y.at(ys[i])];
    if (!Number.isFinite(x) || !Number.isFinite(y)) { flush(); column = null; pen = false; continue; }
    if (thins && pen && Math.round(x) === column) { low = Math.max(low, y); high = Math.min(high, y); last = y; continue; }
    flush();
    if (pen && step) path += `H${px(x)}`;
    path += `${pen ? "L" : "M"}${px(x)} ${px(y)}`;
    pen = true; column = thins ? Math.round(x) : null; low = high = last = y;
  }
  flush();
  return path;
}

const LAYERS = {
  line(layer, p) {
    const path = tag("path", { d: pathThrough(layer.x, layer.y, p, layer.step), fill: "none", stroke: layer.colour, "stroke-width": layer.width ?? 1.5,
      "stroke-dasharray": DASHES[layer.dash ?? "solid"], "stroke-linejoin": "round", "stroke-opacity": layer.opacity });
    return path + (layer.arrow ? arrowAtEnd(layer, p) : "");
  },

  band(layer, p) {
    const there = layer.x.map((_, i) => i).filter(i => layer.x[i] != null && layer.low[i] != null && layer.high[i] != null);
    const corner = (i, of) => `${px(p.x.at(layer.x[i]))} ${px(clamp(p.y.at(of[i]), p))}`;
    const around = [...there.map(i => corner(i, layer.low)), ...there.reverse().map(i => corner(i, layer.high))];
    return around.length ? tag("path", { d: `M${around.join("L")}z`, fill: layer.colour, "fill-opacity": layer.opacity ?? 0.18 }) : "";
  },

  points(layer, p) {
    // On a small map many marks need less room each.
    const small = p.panel.equal && layer.values ? Math.min(1, Math.max(.6, p.w / 600)) : 1;
    const symbol = layer.symbol ?? "dot", size = small * (layer.size ?? 5), grow = small * (layer.grow ?? 0), bins = new Map();
    for (let i = 0; i < layer.x.length; i++) {
      if (layer.x[i] == null || layer.y[i] == null) continue;
      const along = layer.values ? alongOf(p.scale, layer.values[i] ?? p.scale.low) : 0, bin = Math.round(along * (BINS - 1));
      if (!bins.has(bin)) bins.set(bin, []);
      bins.get(bin).push(MARKS[symbol](p.x.at(layer.x[i]), p.y.at(layer.y[i]), size + grow * bin / (BINS - 1)));
    }
    // The highest come last, so that nothing hides them; of a scale with two ends, those at either.
    const weight = bin => p.scale?.both ? Math.abs(bin - (BINS - 1) / 2) : bin;
    const drawn = [...bins].sort(([a], [b]) => weight(a) - weight(b)).map(([bin, marks]) => {
      const along = bin / (BINS - 1), colour = layer.values ? colourAt(p.scale.colours, along) : layer.colour;
      return tag("path", { d: marks.join(""), opacity: layer.opacity, ...markStyle(symbol, size + grow * along, colour) });
    });
    return (layer.low ? errorBars(layer, p) : "") + drawn.join("");
  },

  bars(layer, p) {
    const { horizontal } = layer, [across, value] = horizontal ? [p.y, p.x] : [p.x, p.y], zero = value.at(value.low > 0 ? value.low : 0);
    const [ends, places] = horizontal ? [layer.x, layer.y] : [layer.y, layer.x], [of, n] = layer.slot ?? [0, 1];
    const drawn = ends.map((end, i) => {
      if (end == null) return "";
      const wide = layer.widths?.[i] ?? p.barWidth ?? 0.76, from = places[i] + wide * (of / n - 0.5);
      const [a, b] = [across.at(from), across.at(from + wide / n)].sort((a, b) => a - b);
      const to = Math.min(Math.max(value.at(end), horizontal ? p.left : p.top), horizontal ? p.left + p.w : p.top + p.h);
      const [low, length, thick] = [px(Math.min(zero, to)), px(Math.abs(to - zero)), px(Math.max(1, b - a))];
      const box = horizontal ? { x: low, width: length, y: px(a), height: thick } : { x: px(a), width: thick, y: low, height: length };
      const text = horizontal && layer.texts?.[i] ? barText(layer.texts[i], p, zero, to, (a + b) / 2) : "";
      return tag("rect", { ...box, fill: layer.colours?.[i] ?? layer.colour }) + text;
    });
    return drawn.join("") + (layer.low ? errorBars(layer, p) : "");
  },

  field(layer, p) {
    const { grid, values } = layer, step = grid.step, shade = plumeShade(layer.darkest ?? 1);
    const corner = [p.x.at(grid.x - step / 2), p.y.at(grid.y + (grid.rows - 0.5) * step)];
    const far = [p.x.at(grid.x + (grid.columns - 0.5) * step), p.y.at(grid.y - step / 2)];
    const image = layer.darkest == null ? "" : tag("image", { x: px(corner[0]), y: px(corner[1]), width: px(far[0] - corner[0]), height: px(far[1] - corner[1]),
      preserveAspectRatio: "none", href: paintGrid(document.createElement("canvas"), grid, values, shade).toDataURL() });
    const at = ([c, r]) => [p.x.at(grid.x + c * step), p.y.at(grid.y + r * step)];
    return image + (layer.levels ?? []).map(([level, text]) => {
      const lines = contourLines(grid, values, level).map(line => line.map(at));
      labelContour(lines, text, layer.colour, p);
      return tag("path", { d: lines.map(line => `M${line.map(([x, y]) => `${px(x)} ${px(y)}`).join("L")}`).join(""), fill: "none",
        stroke: layer.colour, "stroke-width": 1.1, "stroke-dasharray": DASHES[layer.dash ?? "solid"] });
    }).join("");
  },

  rule(layer, p) {
    const at = layer.y != null ? p.y.at(layer.y) : p.x.at(layer.x);
    const d = layer.y != null ? `M${p.left} ${px(at)}h${p.w}` : `M${px(at)} ${p.top}v${p.h}`;
    return tag("path", { d, stroke: layer.colour ?? INK, "stroke-width": 1, "stroke-dasharray": DASHES.dashed, fill: "none" });
  },

  text(layer, p) {
    layer.x.forEach((x, i) => p.labels.push({ text: layer.texts[i], x: p.x.at(x), y: p.y.at(layer.y[i]), colour: layer.colour ?? INK }));
    return "";
  },
};

const clamp = (y, p) => Math.min(p.top + p.h + 2, Math.max(p.top - 2, y));

function errorBars(layer, p) {
  const isAlongX = layer.along === "x", cap = 3;
  const d = layer.x.map((x, i) => {
    if (layer.low[i] == null || layer.high[i] == null || x == null || layer.y[i] == null) return "";
    if (isAlongX) {
      const [a, b, y] = [p.x.at(layer.low[i]), p.x.at(layer.high[i]), p.y.at(layer.y[i])];
      return `M${px(a)} ${px(y - cap)}v${2 * cap}m0 ${-cap}H${px(b)}m0 ${-cap}v${2 * cap}`;
    }
    const [a, b, at] = [p.y.at(layer.low[i]), p.y.at(layer.high[i]), p.x.at(x)];
    return `M${px(at - cap)} ${px(a)}h${2 * cap}m${-cap} 0V${px(b)}m${-cap} 0h${2 * cap}`;
  });
  return tag("path", { d: d.join(""), stroke: layer.colour ?? INK, "stroke-width": 1.3, fill: "none" });
}

/** The text of a bar: within it where it has room, else beyond its end, else on its other side. */
function barText(text, p, zero, to, middle) {
  const wide = widthOf(text), y = middle + 4, rightwards = to >= zero, length = Math.abs(to - zero);
  if (length > wide + 12) return write(text, rightwards ? to - 6 : to + 6, y, { fill: "#fff", "text-anchor": rightwards ? "end" : "start" });
  const fits = rightwards ? to + wide + 6 < p.left + p.w : to - wide - 6 > p.left;
  const [x, anchor] = rightwards === fits ? [Math.max(to, zero) + 5, "start"] : [Math.min(to, zero) - 5, "end"];
  return write(text, x, y, { "text-anchor": anchor });
}

function arrowAtEnd(layer, p) {
  const n = layer.x.length, [x, y] = [p.x.at(layer.x[n - 1]), p.y.at(layer.y[n - 1])], [x0, y0] = [p.x.at(layer.x[n - 2]), p.y.at(layer.y[n - 2])];
  const turn = Math.atan2(y - y0, x - x0) * 180 / Math.PI;
  return tag("path", { d: "M0 0l-10 -4.5v9z", fill: layer.colour, transform: `translate(${px(x)} ${px(y)}) rotate(${px(turn)})` });
}

/** The value of a contour line where it is furthest along its longest piece from the panel's edges. */
function labelContour(lines, text, colour, p) {
  if (!text) return;
  const inside = ([x, y]) => x > p.left + 16 && x < p.left + p.w - 16 && y > p.top + 10 && y < p.top + p.h - 10;
  const longest = lines.map(line => line.filter(inside)).sort((a, b) => b.length - a.length)[0];
  if (!longest?.length) return;
  // Tried at several places of the line, that furthest to the side first.
  const tries = [0, .5, .25, .75, .9, .1].map(part => longest[Math.floor(part * (longest.length - 1))]);
  p.labels.push({ text, tries, colour, small: true });
}

// ---- labels that avoid each other ----------------------------------------------------------

/** Writes the labels of a panel where they neither leave it nor cover each other; what has no such place is left out. */
function placeLabels(p) {
  // The wind has its own corner.
  const taken = p.panel.wind ? [[p.left + p.w - widthOf(p.panel.wind.text) - 14, p.top, p.left + p.w, p.top + 72]] : [], size = l => l.small ? LETTER - 1.5 : LETTER + 0.5;
  const fits = b => b[0] >= p.left + 1 && b[2] <= p.left + p.w - 1 && b[1] >= p.top + 1 && b[3] <= p.top + p.h - 1
    && !taken.some(t => b[0] < t[2] && b[2] > t[0] && b[1] < t[3] && b[3] > t[1]);
  return p.labels.map(l => {
    const w = widthOf(l.text, !l.small) * size(l) / LETTER, h = size(l);
    const around = ([x, y]) => [[x + 6, y - 5], [x - w - 6, y - 5], [x + 6, y + h + 3], [x - w - 6, y + h + 3], [x - w / 2, y - 9], [x - w / 2, y + h + 8]];
    const places = l.tries ? l.tries.map(([x, y]) => [x - w / 2, y + h * .36]) : around([l.x, l.y]);
    for (const [x, y] of places) {
      const box = [x - 2, y - h, x + w + 2, y + 3];
      if (!fits(box)) continue;
      taken.push(box);
      return write(l.text, x, y, { fill: l.colour, "font-size": size(l), "font-weight": l.small ? null : 600, stroke: "#fff", "stroke-width": 3,
        "stroke-linejoin": "round", "paint-order": "stroke", "stroke-opacity": .85 });
    }
    return "";
  }).join("");
}

// ---- panels --------------------------------------------------------------------------------

/** The panels of a figure on a page of this width: where they are, their scales, ranges and ticks. */
function layOut(figure, width, state, top, height) {
  const columns = Math.max(1, Math.min(figure.columns ?? 1, Math.floor((width + GAP) / (NARROWEST + GAP))));
  const panels = figure.panels.map((panel, k) => {
    const layers = panel.layers.filter(l => !l.name || !state.hidden.has(l.name)), zoom = state.zoom.get(panel.linked ?? `own ${k}`) ?? {};
    const p = { panel, layers, k, key: panel.linked ?? `own ${k}`, column: k % columns, row: Math.floor(k / columns), scale: figure.scale, labels: [] };
    p.xRange = zoom.x ?? sharedRange(figure, panel, layers, state);
    p.yRange = state.zoom.get(`y ${k}`)?.y ?? rangeOf(panel.y, "y", layers);
    return p;
  });
  const each = (width - GAP * (columns - 1)) / columns;
  for (const p of panels) sizePanel(p, each, height);
  // Axes of one column stand above each other.
  for (const p of panels) p.margin = Math.max(...panels.filter(q => q.column === p.column).map(q => q.ownMargin));
  let y = top;
  for (let row = 0; row <= Math.max(...panels.map(p => p.row)); row++) {
    const ofRow = panels.filter(p => p.row === row);
    for (const p of ofRow) finishPanel(p, each, columns === 1);
    const head = Math.max(...ofRow.map(p => p.heading.length * LINE + 10));
    for (const p of ofRow) { p.top = y + head; placePanel(p); }
    y = Math.max(...ofRow.map(p => p.top + p.h + p.foot));
  }
  return { panels, height: y };
}

/** Panels that are linked have one range across. */
function sharedRange(figure, panel, layers, state) {
  if (!panel.linked) return rangeOf(panel.x, "x", layers);
  const linked = figure.panels.filter(other => other.linked === panel.linked);
  return rangeOf(panel.x, "x", linked.flatMap(other => other.layers.filter(l => !l.name || !state.hidden.has(l.name))));
}

/** Height of a panel and the width of the texts left of it. */
function sizePanel(p, each, height) {
  const { panel } = p, names = panel.y.names;
  p.h = height ?? panel.height ?? 240;
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
  p.yTicks = ticksOf(panel.y, p.yRange, Math.max(2, Math.floor(p.h / 28)));
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
    p.yTicks = ticksOf(panel.y, p.yRange, Math.max(2, Math.floor(p.h / 28)));
  }
  p.left = p.column * (each + GAP) + p.margin;
  p.xTicks = ticksAcross(panel.x, p.xRange, p.w);
  const title = [panel.title, titleOf(panel.y)].filter(Boolean).join(", ");
  p.heading = title ? wrapped(title, each - 4, true) : [];
  p.foot = panel.x.hidden ? 12 : 20 + (titleOf(panel.x) ? LINE : 0) + 8;
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
    panel.x.hidden ? "" : xs.map(([x, text]) => write(text, x, bottom + 17, { "text-anchor": "middle" })).join(""),
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
    const out = p.layers.flatMap(l => Array.isArray(l[key]) ? l[key] : []).filter(v => v != null && (v < scale.low || v > scale.high));
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
  const first = layOut(figure, width, state, top, height && Math.max(40, height - top - 62));
  const drawn = first.panels.map(p => drawPanel(p, state.id)).join("");
  const size = { width, height: Math.ceil(first.height) };
  host.innerHTML = tag("svg", { xmlns: "http://www.w3.org/2000/svg", viewBox: `0 0 ${size.width} ${size.height}`, ...size, "font-family": FONT, "font-size": LETTER,
    role: "img", "aria-label": host.dataset.words }, tag("rect", { ...size, fill: "#fff" }) + names.markup + bar.markup + drawn);
  Object.assign(state, { figure, panels: first.panels, width });
  return host.firstElementChild;
}
