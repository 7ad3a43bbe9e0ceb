// Layers of a panel: lines, bands, marks, bars, grids, rules and words.

import { contourLines, paintGrid, plumeShade } from "./grid.js";
import { numberText } from "./scale.js";
import { DASHES, INK, LETTER, MARKS, markStyle, px, tag, widthOf, write } from "./svg.js";

/** Colours that a scale of colours is drawn with: so many that no step is seen, so few that a path holds all points of one. */
const BINS = 32;

const bytes = hex => [1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16));

/** The colour so far along the scale of colours, 0 to 1. */
function colourAt(colours, along) {
  const next = Math.max(1, colours.findIndex(([at]) => at >= along)), [[a, from], [b, to]] = [colours[next - 1], colours[next]];
  const part = (along - a) / (b - a), [f, t] = [bytes(from), bytes(to)];
  return `rgb(${f.map((v, k) => Math.round(v + part * (t[k] - v))).join(",")})`;
}

export const alongOf = (scale, value) => Math.min(1, Math.max(0, (value - scale.low) / (scale.high - scale.low)));

/** A path through points, broken where one is not known. Where many fall on a column of pixels it goes from the lowest
 * to the highest of them. */
function pathThrough(xs, ys, p, step) {
  let path = "", pen = false, column = null, low = 0, high = 0, last = 0;
  // Of very many points, as of a hundred vehicles, wider columns show as much.
  const thins = xs.length > 2 * p.w, grain = xs.length > 40 * p.w ? 3 : 1, columnOf = x => grain * Math.round(x / grain);
  const flush = () => { if (column !== null && low > high) path += `L${column} ${px(low)}L${column} ${px(high)}L${column} ${px(last)}`; };
  for (let i = 0; i < xs.length; i++) {
    if (xs[i] == null || ys[i] == null) { flush(); column = null; pen = false; continue; }
    const [x, y] = [p.x.at(xs[i]), p.y.at(ys[i])];
    if (!Number.isFinite(x) || !Number.isFinite(y)) { flush(); column = null; pen = false; continue; }
    if (thins && pen && columnOf(x) === column) { low = Math.max(low, y); high = Math.min(high, y); last = y; continue; }
    flush();
    if (pen && step) path += `H${px(x)}`;
    path += `${pen ? "L" : "M"}${px(x)} ${px(y)}`;
    pen = true; column = thins ? columnOf(x) : null; low = high = last = y;
  }
  flush();
  return path;
}

export const LAYERS = {
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
      // A bar that is cut off has its value.
      const isCut = end < value.low || end > value.high, words = [layer.texts?.[i], isCut ? numberText(end, 3) : ""].filter(Boolean).join(", ");
      const text = horizontal && words ? barText(words, p, zero, to, (a + b) / 2) : "";
      return tag("rect", { ...box, fill: layer.colours?.[i] ?? layer.colour }) + text;
    });
    return drawn.join("") + (layer.low ? errorBars(layer, p) : "");
  },

  field(layer, p) {
    const { grid, values } = layer, step = grid.step, up = grid.up ?? step, shade = plumeShade(layer.darkest ?? 1);
    const corner = [p.x.at(grid.x - step / 2), p.y.at(grid.y + (grid.rows - 0.5) * up)];
    const far = [p.x.at(grid.x + (grid.columns - 0.5) * step), p.y.at(grid.y - up / 2)];
    const image = layer.darkest == null ? "" : tag("image", { x: px(corner[0]), y: px(corner[1]), width: px(far[0] - corner[0]), height: px(far[1] - corner[1]),
      preserveAspectRatio: "none", href: paintGrid(document.createElement("canvas"), grid, values, shade).toDataURL() });
    const at = ([c, r]) => [p.x.at(grid.x + c * step), p.y.at(grid.y + r * up)];
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
  // Tried at several places of the line; near its ends it may stand at the source.
  const tries = [.5, .25, .75, .9, .1, 0].map(part => longest[Math.floor(part * (longest.length - 1))]);
  p.labels.push({ text, tries, colour, small: true });
}

/** Writes the labels of a panel where they neither leave it nor cover each other; what has no such place is left out. */
export function placeLabels(p) {
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
