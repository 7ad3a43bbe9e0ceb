// How values are shown: colours, digits, words.

export const $ = id => document.getElementById(id);

/** What the page knows: the site once, the picture as it comes, the view of who looks. */
export const known = { site: null, live: null, selected: null, follow: false, top: null };

export const INK = "#16181d", SOFT = "#5d6470", REAL = "#c0101b", AXIS = "#245882", CHOSEN = "#0a62c9";
export const colourOfKind = v => v.real ? REAL : INK;
/** Colours of the scale between its ends: so many that no step is seen, so few that lines of one colour are one path. */
export const BINS = 32;

const rgb = hex => [1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16));

/** The colour so far along the scale, 0 to 1. */
export function colourAt(along) {
  const stops = known.site.colours;
  let i = 1;
  while (i < stops.length - 1 && along > stops[i][0]) i++;
  const [a, from] = stops[i - 1], [b, to] = stops[i];
  const part = (along - a) / (b - a), f = rgb(from), t = rgb(to);
  return "rgb(" + f.map((v, k) => Math.round(v + part * (t[k] - v))).join(",") + ")";
}

/** The reading at the red end of the scale. */
export const topPpm = () => known.top ?? known.site.red_ppm;

/** Which of the BINS colours a reading has; what is no number has the first. */
export function binOf(ppm) {
  const { grey_ppm } = known.site, along = (ppm - grey_ppm) / (topPpm() - grey_ppm);
  return Number.isFinite(along) ? Math.round(Math.min(1, Math.max(0, along)) * (BINS - 1)) : 0;
}

export const clock = s => `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, "0")}`;
export const number = (v, digits) => Number.isFinite(v) ? v.toFixed(digits) : "–";
export const distance = m => m >= 10000 ? `${(m / 1000).toFixed(0)} km` : m >= 1000 ? `${(m / 1000).toFixed(1)} km` : `${m.toFixed(0)} m`;
/** CO₂ for CO2. */
export const formula = gas => gas.replace(/\d/g, d => String.fromCharCode(0x2080 + Number(d)));

const M_PER_DEG_LAT = 111132.95, RADIUS_M = 6378137;

/** Latitude and longitude of a place of the map: to some metres within 10 km, enough for a pointer. */
export function latLon(e, n) {
  const lat = known.site.lat + n / M_PER_DEG_LAT;
  return [lat, known.site.lon + e / (RADIUS_M * Math.cos(lat * Math.PI / 180)) * 180 / Math.PI];
}

/** The inverse. */
export function eastNorth(lat, lon) {
  const e = (lon - known.site.lon) * Math.PI / 180 * RADIUS_M * Math.cos(lat * Math.PI / 180);
  return [e, (lat - known.site.lat) * M_PER_DEG_LAT];
}

export function degrees([lat, lon], digits = 5) {
  const wrapped = ((lon + 540) % 360) - 180;
  return `${Math.abs(lat).toFixed(digits)}° ${lat < 0 ? "S" : "N"}, ${Math.abs(wrapped).toFixed(digits)}° ${wrapped < 0 ? "W" : "E"}`;
}

/** A canvas as large as it is shown, sharp on every screen; tells whether it had to be made anew. */
export function fitCanvas(canvas) {
  const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
  const width = Math.round(box.width * ratio), height = Math.round(box.height * ratio);
  const changed = canvas.width !== width || canvas.height !== height;
  if (changed) { canvas.width = width; canvas.height = height; }
  const ctx = canvas.getContext("2d");
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { ctx, width: box.width, height: box.height, changed };
}

export function label(ctx, text, x, y, colour) {
  ctx.lineWidth = 3.5; ctx.lineJoin = "round"; ctx.strokeStyle = "rgba(255,255,255,.85)";
  ctx.strokeText(text, x, y);
  ctx.fillStyle = colour; ctx.fillText(text, x, y);
}

export function cross(ctx, x, y) {
  for (const [colour, width] of [["#fff", 4], [REAL, 2]]) {
    ctx.strokeStyle = colour; ctx.lineWidth = width;
    ctx.beginPath(); ctx.arc(x, y, 10, 0, 7);
    ctx.moveTo(x - 15, y); ctx.lineTo(x + 15, y); ctx.moveTo(x, y - 15); ctx.lineTo(x, y + 15);
    ctx.stroke();
  }
}

/** The newest answer to a question that is asked again and again: one at a time, no more often than `everyMs`. */
export function asker(everyMs, take) {
  let busy = false, next = null, asked = null;
  async function ask(url) {
    busy = true; asked = url;
    try {
      const answer = await fetch(url);
      take(answer.ok ? await answer.json() : null);
    } catch { take(null); }
    setTimeout(() => { busy = false; if (next) { const url = next; next = null; ask(url); } }, everyMs);
  }
  return url => {
    if (url === asked) return;
    if (busy) next = url; else ask(url);
  };
}
