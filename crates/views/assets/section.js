// The height view: plume, ground, height band and vehicles in the upright plane along the plume's axis.

import { $, known, SOFT, AXIS, CHOSEN, asker, colourOfKind, cross, distance, fitCanvas, label } from "./shown.js";
import { plumeShade } from "./grid.js";
import { shadeGrid, drawContours } from "./plume.js";
import { niceStep, ticks } from "./scale.js";

const MARGIN = { left: 46, right: 10, top: 8, bottom: 24 };
// A vehicle that far beside the plane is drawn pale, m.
const BESIDE_M = 300;
let data = null;
const ask = asker(1000, answer => { data = answer; });

/** How far downwind the plane goes and between which altitudes: what the site's map and the height band hold. */
function extent() {
  const { site, live } = known, [low, high] = site.band_amsl_m;
  const axis = (live?.model ? live.model.axis_deg[0] : 0) * Math.PI / 180, [w, s, e, n] = site.area;
  const stack = site.stacks[0] || { e: 0, n: 0 };
  const corners = [[w, s], [w, n], [e, s], [e, n], ...(live?.vehicles || []).map(v => [v.e, v.n])];
  const along = corners.map(([x, y]) => (x - stack.e) * Math.sin(axis) + (y - stack.n) * Math.cos(axis));
  const step = niceStep(Math.max(500, Math.max(...along)) / 4), to = step * Math.ceil(Math.max(500, Math.max(...along)) / step);
  const bottom = Math.min(site.ground_amsl_m, low) - 60;
  return { from: -to / 8, to, low: bottom, high: Math.max(high, bottom + 200) + 60 };
}

export function drawSection() {
  const { site, live } = known;
  const { ctx, width, height } = fitCanvas($("section"));
  ctx.clearRect(0, 0, width, height);
  if (!site || !live || width < 120) return;
  const x = extent(), inner = { w: width - MARGIN.left - MARGIN.right, h: height - MARGIN.top - MARGIN.bottom };
  const columns = Math.min(160, Math.max(40, Math.round(inner.w / 5)));
  ask(`section.json?from=${x.from}&to=${x.to}&low=${x.low}&high=${x.high}&columns=${columns}&model=${live.models}`);
  const place = (m, alt) => [MARGIN.left + (m - x.from) / (x.to - x.from) * inner.w,
    MARGIN.top + (x.high - alt) / (x.high - x.low) * inner.h];
  ctx.save();
  ctx.beginPath(); ctx.rect(MARGIN.left, MARGIN.top, inner.w, inner.h); ctx.clip();
  ctx.fillStyle = "#f8f8f5"; ctx.fillRect(MARGIN.left, MARGIN.top, inner.w, inner.h);
  if (data) drawAir(ctx, place);
  drawBand(ctx, place, x);
  if (data) drawVehicles(ctx, place);
  ctx.restore();
  drawAxes(ctx, place, x, inner);
}

function drawAir(ctx, place) {
  const { site } = known, grid = data, at = (c, r) => place(data.from + c * data.across, data.low + r * data.up);
  if (data.values) {
    shadeGrid(ctx, grid, data.values, at(0, 0), at(grid.columns - 1, grid.rows - 1), plumeShade(site.darkest_ppm));
    drawContours(ctx, grid, data.values, at, site.levels_ppm, { line: "rgba(36,88,130,.55)" });
  }
  // In stretches over which the ground is known.
  const isKnown = c => data.ground[c] != null;
  ctx.beginPath();
  data.ground.forEach((alt, c) => {
    if (!isKnown(c)) return;
    if (!isKnown(c - 1)) ctx.moveTo(...at(c, -1e4 / data.up));
    ctx.lineTo(...place(data.from + c * data.across, alt));
    if (!isKnown(c + 1)) { ctx.lineTo(...at(c, -1e4 / data.up)); ctx.closePath(); }
  });
  ctx.fillStyle = "#d8d5cb"; ctx.fill(); ctx.strokeStyle = "#8f8a78"; ctx.lineWidth = 1; ctx.stroke();
  const stack = site.stacks[0];
  if (stack) {
    const foot = data.ground[Math.round(-data.from / data.across)] ?? site.ground_amsl_m;
    ctx.strokeStyle = "#16181d"; ctx.lineWidth = 3;
    ctx.beginPath(); ctx.moveTo(...place(0, foot)); ctx.lineTo(...place(0, site.ground_amsl_m + stack.height_m)); ctx.stroke();
  }
}

function drawBand(ctx, place, x) {
  ctx.setLineDash([8, 5]); ctx.strokeStyle = "#8c94a1"; ctx.lineWidth = 1.2;
  for (const alt of known.site.band_amsl_m) {
    ctx.beginPath(); ctx.moveTo(...place(x.from, alt)); ctx.lineTo(...place(x.to, alt)); ctx.stroke();
  }
  ctx.setLineDash([]);
}

/** Downwind and beside the plane, m. */
function inPlane(e, n) {
  const axis = data.axis_deg * Math.PI / 180, [x, y] = [e - data.e, n - data.n];
  return [x * Math.sin(axis) + y * Math.cos(axis), x * Math.cos(axis) - y * Math.sin(axis)];
}

function drawVehicles(ctx, place) {
  const { live, selected } = known;
  for (const v of live.vehicles) {
    const [along, beside] = inPlane(v.e, v.n), [px, py] = place(along, v.alt);
    ctx.globalAlpha = Math.abs(beside) < BESIDE_M ? 1 : .4;
    ctx.beginPath(); ctx.arc(px, py, v.id === selected ? 6 : 4, 0, 7);
    ctx.fillStyle = v.id === selected ? CHOSEN : colourOfKind(v); ctx.fill();
    ctx.strokeStyle = "#fff"; ctx.lineWidth = 1.2; ctx.stroke();
    if (live.vehicles.length <= 20 || v.id === selected) {
      ctx.font = "600 11px system-ui, sans-serif"; ctx.textAlign = "left";
      label(ctx, v.id, px + 7, py - 5, ctx.fillStyle);
    }
  }
  ctx.globalAlpha = 1;
  if (live.peak) cross(ctx, ...place(inPlane(live.peak.e, live.peak.n)[0], live.peak.alt));
}

function drawAxes(ctx, place, x, inner) {
  ctx.strokeStyle = "#c9cdd4"; ctx.lineWidth = 1; ctx.strokeRect(MARGIN.left, MARGIN.top, inner.w, inner.h);
  ctx.fillStyle = SOFT; ctx.font = "11px system-ui, sans-serif";
  ctx.textAlign = "right";
  for (const [alt, text] of ticks(x.low, x.high, Math.max(2, inner.h / 34))) ctx.fillText(text, MARGIN.left - 5, place(0, alt)[1] + 4);
  ctx.textAlign = "center";
  for (const [m] of ticks(0, x.to, Math.max(2, inner.w / 80))) {
    const at = Math.min(place(m, x.low)[0], MARGIN.left + inner.w - 14);
    ctx.fillText(m === 0 ? "source" : distance(Math.abs(m)), at, MARGIN.top + inner.h + 15);
  }
  ctx.textAlign = "left"; ctx.fillStyle = AXIS;
  if (known.live.model) ctx.fillText(`towards ${known.live.model.axis_deg[0].toFixed(0)}°`, MARGIN.left + 8, MARGIN.top + 14);
}
