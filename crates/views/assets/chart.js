// Readings over time: real vehicles and the selected one stand out, the others are the grey behind them.

import { $, known, CHOSEN, REAL, SOFT, fitCanvas, formula, label, niceStep } from "./shown.js";

const MARGIN = { left: 46, right: 10, top: 8, bottom: 24 };

function extent() {
  const { live, site } = known;
  let low = site.grey_ppm, high = site.red_ppm;
  for (const flat of live.tracks.values()) for (let i = 4; i < flat.length; i += 5) {
    const ppm = flat[i];
    if (ppm !== null && ppm < low) low = ppm;
    if (ppm !== null && ppm > high) high = ppm;
  }
  return { low, high: high + .05 * (high - low), to: Math.max(60, live.time_s) };
}

/** One vehicle's readings; where many fall on a pixel, from the lowest to the highest of them. */
function trace(ctx, flat, place) {
  let column = null, low = 0, high = 0;
  ctx.beginPath();
  for (let i = 0; i < flat.length; i += 5) {
    if (flat[i + 4] === null) continue;
    const [x, y] = place(flat[i], flat[i + 4]), at = Math.round(x);
    if (at === column) { low = Math.max(low, y); high = Math.min(high, y); continue; }
    if (column !== null && low > high) { ctx.lineTo(column, low); ctx.lineTo(column, high); }
    ctx.lineTo(x, y);
    column = at; low = high = y;
  }
  ctx.stroke();
}

export function drawChart() {
  const { live, site, selected } = known;
  const { ctx, width, height } = fitCanvas($("chart"));
  ctx.clearRect(0, 0, width, height);
  if (!live || !site || width < 120) return;
  const x = extent(), inner = { w: width - MARGIN.left - MARGIN.right, h: height - MARGIN.top - MARGIN.bottom };
  const place = (s, ppm) => [MARGIN.left + s / x.to * inner.w, MARGIN.top + (x.high - ppm) / (x.high - x.low) * inner.h];
  axes(ctx, place, x, inner);
  const rank = v => v.id === selected ? 2 : v.real ? 1 : 0;
  for (const v of [...live.vehicles].sort((a, b) => rank(a) - rank(b))) {
    const flat = live.tracks.get(v.id);
    if (!flat) continue;
    ctx.strokeStyle = ["#aab2be", REAL, CHOSEN][rank(v)]; ctx.lineWidth = [1, 1.6, 2][rank(v)];
    trace(ctx, flat, place);
  }
  legend(ctx, live, selected);
}

function legend(ctx, live, selected) {
  const real = live.vehicles.filter(v => v.real).map(v => v.id), chosen = live.vehicles.find(v => v.id === selected);
  const words = [["simulated", "#6f7b8c"]];
  if (real.length) words.push([`real (${real.length > 4 ? real.length : real.join(", ")})`, REAL]);
  if (chosen) words.push([chosen.id, CHOSEN]);
  ctx.font = "600 11px system-ui, sans-serif"; ctx.textAlign = "left";
  let at = MARGIN.left + 8;
  for (const [word, colour] of words) { label(ctx, word, at, MARGIN.top + 12, colour); at += ctx.measureText(word).width + 14; }
}

function axes(ctx, place, x, inner) {
  ctx.font = "11px system-ui, sans-serif"; ctx.fillStyle = SOFT; ctx.strokeStyle = "#eef0f2"; ctx.lineWidth = 1;
  ctx.textAlign = "right";
  const up = niceStep((x.high - x.low) / Math.max(2, inner.h / 34));
  for (let ppm = Math.ceil(x.low / up) * up; ppm <= x.high; ppm += up) {
    const y = Math.round(place(0, ppm)[1]) + .5;
    ctx.beginPath(); ctx.moveTo(MARGIN.left, y); ctx.lineTo(MARGIN.left + inner.w, y); ctx.stroke();
    ctx.fillText(Number(ppm.toPrecision(6)), MARGIN.left - 5, y + 4);
  }
  ctx.textAlign = "center";
  const across = niceStep(x.to / 60 / Math.max(2, inner.w / 70));
  for (let min = 0; min * 60 <= x.to; min += across) {
    ctx.fillText(`${Number(min.toPrecision(6))} min`, Math.min(place(min * 60, x.low)[0], MARGIN.left + inner.w - 16), MARGIN.top + inner.h + 15);
  }
}

export function nameChart() {
  $("chart-gas").textContent = `${formula(known.site.gas)} as read, ppm, over mission time`;
}
