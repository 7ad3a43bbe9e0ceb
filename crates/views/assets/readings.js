// Readings over time: real vehicles and the selected one stand out, the others are the grey behind them.

import { $, known, CHOSEN, REAL, formula } from "./shown.js";
import { showFigure } from "./chart_pointer.js";

const STYLES = [["#aab2be", 1], [REAL, 1.6], [CHOSEN, 2]];
let draw = null;

/** The readings of some vehicles as one line with a gap after each vehicle. */
function readingsOf(vehicles) {
  const x = [], y = [];
  for (const { id } of vehicles) {
    const flat = known.live.tracks.get(id) ?? [];
    for (let i = 0; i < flat.length; i += 5) if (flat[i + 4] !== null) { x.push(flat[i] / 60); y.push(flat[i + 4]); }
    x.push(null); y.push(null);
  }
  return { x, y };
}

function figure() {
  const { live, site, selected } = known, ranks = [[], [], []];
  for (const v of live.vehicles) ranks[v.id === selected ? 2 : v.real ? 1 : 0].push(v);
  const real = ranks[1].length > 4 ? ranks[1].length : ranks[1].map(v => v.id).join(", ");
  const names = ["simulated", `real (${real})`, ranks[2][0]?.id];
  const layers = ranks.map((vehicles, rank) => ({ kind: "line", name: names[rank], colour: STYLES[rank][0], width: STYLES[rank][1],
    ...readingsOf(vehicles) })).filter(layer => layer.x.length);
  return { columns: 1, panels: [{ layers, x: { name: "mission time", unit: "min", untitled: true, range: [0, Math.max(1, live.time_s / 60)] },
    y: { name: formula(site.gas), unit: "ppm", untitled: true, include: [site.grey_ppm, site.red_ppm] } }] };
}

export function drawReadings() {
  const host = $("readings");
  if (!known.live || !known.site || host.clientWidth < 120) return;
  $("readings-title").textContent = `Readings, ppm ${formula(known.site.gas)}, by minutes of mission time`;
  if (draw) draw(figure()); else draw = showFigure(host, figure(), () => host.clientHeight);
}
