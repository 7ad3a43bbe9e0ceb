// Axes of a figure: their ranges, ticks and titles.

import { logTicks, ticks } from "./scale.js";
import { widthOf } from "./svg.js";

export const isHorizontal = layer => layer.kind === "bars" && layer.horizontal;

/** All values of a layer along an axis, "x" or "y". */
function* valuesAlong(layer, key) {
  if (layer.kind === "field") {
    const { grid } = layer, [from, n, step] = key === "x" ? [grid.x, grid.columns, grid.step] : [grid.y, grid.rows, grid.up ?? grid.step];
    yield* [from, from + (n - 1) * step];
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
export function rangeOf(axis, key, layers) {
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

export function ticksOf(axis, [low, high] = [], most = 0) {
  if (axis.names) return axis.names.map((name, i) => [i, name]);
  return axis.log ? logTicks(low, high, most) : ticks(low, high, most, axis.unit);
}

/** As many ticks as have room for their texts beside each other. */
export function ticksAcross(axis, range, width) {
  for (let most = Math.max(2, Math.floor(width / 46)); ; most--) {
    const all = ticksOf(axis, range, most), widest = Math.max(0, ...all.map(([, text]) => widthOf(text)));
    if (most <= 1 || axis.names || (widest + 14) * (all.length - 1) <= width) return all;
  }
}

/** The name of an axis with its unit; none where its place on the page says both. */
export const titleOf = axis => axis.untitled ? "" : [axis.name, axis.unit].filter(Boolean).join(", ");
