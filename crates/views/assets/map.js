// The map: three canvases over each other. The lowest has what seldom changes (ground, tiles, plume, fence), the next
// the tracks, to which pieces are added, the highest what moves.

import { $, known, BINS, AXIS, CHOSEN, INK, asker, binOf, colourAt, colourOfKind, cross, degrees, distance, eastNorth,
  fitCanvas, label, latLon } from "./shown.js";
import { plumeShade } from "./grid.js";
import { drawContours, shadeGrid } from "./plume.js";
import { niceStep } from "./scale.js";

const view = { e: 0, n: 0, scale: 0.1, held: false };
const box = { width: 0, height: 0 };
// The plume is narrower near its source than a cell of the whole map's grid: there one so many times finer is drawn over it.
const FINER = 6, MOST_SOURCES = 3;
const grids = { plume: null, near: [], ground: null };
let picked = () => {}, gone = () => {}, armed = false, basePending = false, trackPending = false, redrawn = "";

const place = (e, n) => [box.width / 2 + (e - view.e) * view.scale, box.height / 2 - (n - view.n) * view.scale];
const there = (x, y) => [view.e + (x - box.width / 2) / view.scale, view.n - (y - box.height / 2) / view.scale];

// ---- what part of the world is seen --------------------------------------------------------

/** All of the site's flights, the map's own area while nobody has flown. */
export function fit() {
  let [w, s, e, n] = known.site.area;
  for (const flat of known.live?.tracks.values() || []) for (let i = 0; i < flat.length; i += 5) {
    w = Math.min(w, flat[i + 1]); e = Math.max(e, flat[i + 1]); s = Math.min(s, flat[i + 2]); n = Math.max(n, flat[i + 2]);
  }
  view.e = (w + e) / 2; view.n = (s + n) / 2;
  view.scale = 0.86 * Math.min(box.width / Math.max(100, e - w), box.height / Math.max(100, n - s));
  view.held = false;
}

export function zoom(by, x = box.width / 2, y = box.height / 2) {
  const scale = Math.min(50, Math.max(.0005, view.scale * by)), real = scale / view.scale;
  const dx = (x - box.width / 2) / view.scale, dy = (y - box.height / 2) / view.scale;
  view.e += dx * (1 - 1 / real); view.n -= dy * (1 - 1 / real);
  view.scale = scale; view.held = true;
  moved();
}

function pan(dx, dy) {
  view.e -= dx / view.scale; view.n += dy / view.scale; view.held = true; known.follow = false;
  moved();
}

function moved() { basePending = trackPending = true; requestAnimationFrame(drawMap); }

export function showAll() { known.follow = false; fit(); moved(); }

// ---- what is asked of the server -----------------------------------------------------------

const askPlume = asker(900, answer => { grids.plume = answer; basePending = true; });
const askNear = Array.from({ length: MOST_SOURCES }, (_, k) => asker(900, answer => { grids.near[k] = answer; basePending = true; }));
const askGround = asker(300, answer => { grids.ground = answer; basePending = true; moved(); });

function ask() {
  const { site, live } = known, w = box.width / view.scale / 2 * 1.15, h = box.height / view.scale / 2 * 1.15;
  const round = m => Number(m.toPrecision(8));
  const of = (e, n, w, h, columns) => `west=${round(e - w)}&east=${round(e + w)}&south=${round(n - h)}&north=${round(n + h)}&columns=${columns}`;
  const columns = Math.min(150, Math.max(50, Math.round(box.width / 7)));
  if (live.model) {
    askPlume(`plume.json?${of(view.e, view.n, w, h, columns)}&model=${live.models}`);
    site.stacks.slice(0, MOST_SOURCES).forEach((stack, k) => {
      const seen = Math.abs(stack.e - view.e) < w && Math.abs(stack.n - view.n) < h;
      if (seen) askNear[k](`plume.json?${of(stack.e, stack.n, w / FINER, w / FINER, 60)}&model=${live.models}`);
    });
  }
  if (site.has_terrain) askGround(`ground.json?${of(view.e, view.n, w, h, Math.min(200, Math.round(box.width / 4)))}`);
}

// ---- ground, tiles, plume ------------------------------------------------------------------

const tiles = new Map();
/** Most tiles drawn at once: of a file that has none coarse enough for what the screen shows nothing is drawn. */
const MOST_TILES = 400;

function drawTiles(ctx) {
  const mid = latLon(view.e, view.n), cos = Math.cos(mid[0] * Math.PI / 180);
  // As many pixels of a tile as of the screen: 256 of them make 40075017 m · cos / 2^z.
  const [coarsest, finest] = known.site.tile_zooms;
  const z = Math.max(coarsest, Math.min(finest, Math.round(Math.log2(40075017 * cos * view.scale / 256))));
  const n = 2 ** z, toX = lon => (lon + 180) / 360 * n;
  const toY = lat => (1 - Math.asinh(Math.tan(lat * Math.PI / 180)) / Math.PI) / 2 * n;
  const toLat = y => Math.atan(Math.sinh(Math.PI * (1 - 2 * y / n))) * 180 / Math.PI;
  const [north, west] = latLon(...there(0, 0)), [south, east] = latLon(...there(box.width, box.height));
  if ((toX(east) - toX(west)) * (toY(south) - toY(north)) > MOST_TILES) return;
  for (let x = Math.floor(toX(west)); x <= toX(east); x++) for (let y = Math.floor(toY(north)); y <= toY(south); y++) {
    const picture = tile(z, ((x % n) + n) % n, y);
    if (!picture.complete || !picture.naturalWidth) continue;
    const [x0, y0] = place(...eastNorth(toLat(y), x / n * 360 - 180)), [x1, y1] = place(...eastNorth(toLat(y + 1), (x + 1) / n * 360 - 180));
    ctx.drawImage(picture, x0, y0, x1 - x0 + .5, y1 - y0 + .5);
  }
}

function tile(z, x, y) {
  const url = known.site.tiles.replace("{z}", z).replace("{x}", x).replace("{y}", y);
  if (!tiles.has(url)) {
    // The oldest go: a map of a long mission must not fill the memory.
    if (tiles.size > 2 * MOST_TILES) tiles.delete(tiles.keys().next().value);
    const picture = new Image();
    picture.onload = () => { basePending = true; requestAnimationFrame(drawMap); };
    picture.src = url;
    tiles.set(url, picture);
  }
  return tiles.get(url);
}

/** Light from the north-west, 45° high, as on paper maps; nothing where the ground is not known. */
function hillShade(values, r, c, grid) {
  const own = values[r * grid.columns + c];
  if (own == null) return [0, 0, 0, 0];
  const at = (c, r) => values[Math.min(grid.rows - 1, Math.max(0, r)) * grid.columns + Math.min(grid.columns - 1, Math.max(0, c))] ?? own;
  const dx = (at(c + 1, r) - at(c - 1, r)) / (2 * grid.step), dy = (at(c, r + 1) - at(c, r - 1)) / (2 * grid.step);
  const light = (.5 * dx - .5 * dy + .7071) / Math.sqrt(1 + dx * dx + dy * dy) / .7071;
  const tone = Math.max(0, Math.min(255, 120 + 118 * light));
  return [tone, tone, Math.max(0, tone - 8), known.site.tiles ? 90 : 255];
}

const onMap = grid => (c, r) => place(grid.e + c * grid.step, grid.n + r * grid.step);

function drawTerrain(ctx) {
  const { grid, values } = grids.ground, at = onMap(grid);
  shadeGrid(ctx, grid, values, at(0, 0), at(grid.columns - 1, grid.rows - 1), (_, r, c) => hillShade(values, r, c, grid));
  let [low, high] = [Infinity, -Infinity];
  for (const m of values) if (m != null) { low = Math.min(low, m); high = Math.max(high, m); }
  const step = niceStep(Math.max(10, (high - low) / 12)), levels = [];
  for (let m = Math.ceil(low / step) * step; m < high; m += step) levels.push(m);
  drawContours(ctx, grid, values, at, levels, {
    line: "rgba(120,105,70,.35)", source: [-1e6, 0], inside: isInside, word: m => `${m}`, text: "#7d6f4b",
  });
}

const isInside = ([x, y]) => x > 24 && y > 14 && x < box.width - 24 && y < box.height - 14;

function drawPlume(ctx) {
  const finer = grids.near.filter(near => near && near.values);
  ctx.save();
  // Where a finer grid lies the coarse one is not drawn.
  ctx.beginPath(); ctx.rect(0, 0, box.width, box.height);
  for (const near of finer) windowOf(ctx, near.grid);
  ctx.clip("evenodd");
  plumeGrid(ctx, grids.plume, true);
  ctx.restore();
  for (const near of finer) {
    ctx.save(); ctx.beginPath(); windowOf(ctx, near.grid); ctx.clip();
    plumeGrid(ctx, near, false);
    ctx.restore();
  }
}

function windowOf(ctx, grid) {
  const [x0, y0] = place(grid.e, grid.n), [x1, y1] = onMap(grid)(grid.columns - 1, grid.rows - 1);
  ctx.rect(x0, y1, x1 - x0, y0 - y1);
}

function plumeGrid(ctx, { grid, values }, words) {
  const { site } = known, at = onMap(grid), shade = plumeShade(site.darkest_ppm);
  shadeGrid(ctx, grid, values, at(0, 0), at(grid.columns - 1, grid.rows - 1), shade);
  const stack = site.stacks[0] || { e: 0, n: 0 };
  drawContours(ctx, grid, values, at, site.levels_ppm, {
    line: "rgba(36,88,130,.6)", source: place(stack.e, stack.n), inside: isInside, text: AXIS,
    word: words && (level => "+" + Number(level.toPrecision(2))),
  });
}

function drawGrid(ctx) {
  const step = niceStep(70 / view.scale), [west, north] = there(0, 0), [east, south] = there(box.width, box.height);
  ctx.lineWidth = 1; ctx.strokeStyle = known.site.tiles || grids.ground ? "rgba(90,90,80,.14)" : "#e8e8e3";
  ctx.beginPath();
  for (let e = Math.ceil(west / step) * step; e < east; e += step) { const x = Math.round(place(e, 0)[0]) + .5; ctx.moveTo(x, 0); ctx.lineTo(x, box.height); }
  for (let n = Math.ceil(south / step) * step; n < north; n += step) { const y = Math.round(place(0, n)[1]) + .5; ctx.moveTo(0, y); ctx.lineTo(box.width, y); }
  ctx.stroke();
  $("ruler").style.width = `${step * view.scale}px`;
  $("ruler").textContent = distance(step);
}

function drawFence(ctx) {
  const { site } = known;
  if (site.fence.length > 2) {
    ctx.beginPath();
    site.fence.forEach(([e, n], i) => ctx[i ? "lineTo" : "moveTo"](...place(e, n)));
    ctx.closePath();
    ctx.setLineDash([8, 5]); ctx.lineWidth = 1.5; ctx.strokeStyle = "#7b8390"; ctx.stroke();
  }
  for (const stack of site.stacks) {
    const [x, y] = place(stack.e, stack.n);
    ctx.beginPath(); ctx.arc(x, y, site.keep_out_radius_m * view.scale, 0, 7);
    ctx.fillStyle = "rgba(93,100,112,.07)"; ctx.fill();
    ctx.setLineDash([3, 4]); ctx.lineWidth = 1.2; ctx.strokeStyle = "#7b8390"; ctx.stroke();
    ctx.setLineDash([]);
    ctx.fillStyle = INK; ctx.fillRect(x - 4, y - 4, 8, 8);
    ctx.font = "600 12px system-ui, sans-serif"; ctx.textAlign = "left";
    if (site.stacks.length <= 20) label(ctx, stack.name, x + 9, y + 4, INK);
  }
  ctx.setLineDash([]);
}

function drawBase(ctx) {
  ctx.clearRect(0, 0, box.width, box.height);
  if (known.site.tiles) drawTiles(ctx);
  if (grids.ground?.values) drawTerrain(ctx);
  drawGrid(ctx);
  if (grids.plume?.values && known.live.model) drawPlume(ctx);
  drawFence(ctx);
}

// ---- tracks --------------------------------------------------------------------------------

/** Draws the pieces of tracks that begin at the given points, those of one colour as one path. */
function drawPieces(ctx, pieces) {
  const paths = [new Map(), new Map()];
  for (const [flat, first, real] of pieces) for (let i = Math.max(5, first); i < flat.length; i += 5) {
    const bin = binOf(flat[i + 4]), of = paths[real ? 1 : 0];
    if (!of.has(bin)) of.set(bin, new Path2D());
    of.get(bin).moveTo(...place(flat[i - 4], flat[i - 3]));
    of.get(bin).lineTo(...place(flat[i + 1], flat[i + 2]));
  }
  const many = known.live.vehicles.length > 30;
  ctx.lineCap = "round";
  paths.forEach((of, real) => {
    ctx.lineWidth = real ? 3.6 : many ? 1.4 : 2.2;
    for (const bin of [...of.keys()].sort((a, b) => a - b)) { ctx.strokeStyle = colourAt(bin / (BINS - 1)); ctx.stroke(of.get(bin)); }
  });
}

const isReal = id => known.live.vehicles.find(v => v.id === id)?.real;

/** New pieces of tracks: id and index of the first new number. */
export function addPieces(pieces) {
  if (trackPending || !box.width) return;
  drawPieces(fitCanvas($("map-tracks")).ctx, pieces.map(([id, first]) => [known.live.tracks.get(id), first, isReal(id)]));
}

export function redrawTracks() { trackPending = true; }

// ---- what moves ----------------------------------------------------------------------------

function drawStars(ctx) {
  for (const [e, n] of known.live.stars) {
    const [x, y] = place(e, n);
    ctx.beginPath();
    for (let i = 0; i < 10; i++) { const a = Math.PI * i / 5, r = i % 2 ? 2.6 : 6.2; ctx.lineTo(x + r * Math.sin(a), y - r * Math.cos(a)); }
    ctx.closePath();
    ctx.fillStyle = "#f5c400"; ctx.fill(); ctx.lineWidth = .8; ctx.strokeStyle = "#a37c00"; ctx.stroke();
  }
}

function drawArrow(ctx, v, size) {
  const [x, y] = place(v.e, v.n), chosen = v.id === known.selected;
  ctx.save();
  ctx.translate(x, y);
  if (chosen) { ctx.beginPath(); ctx.arc(0, 0, 17, 0, 7); ctx.strokeStyle = CHOSEN; ctx.lineWidth = 2.5; ctx.stroke(); }
  ctx.rotate(v.heading * Math.PI / 180); ctx.scale(size, size);
  ctx.beginPath(); ctx.moveTo(0, -12); ctx.lineTo(8, 10); ctx.lineTo(0, 5); ctx.lineTo(-8, 10); ctx.closePath();
  ctx.lineJoin = "round"; ctx.lineWidth = 3; ctx.strokeStyle = "#fff"; ctx.stroke();
  ctx.fillStyle = colourOfKind(v); ctx.fill();
  ctx.restore();
}

function drawMarks(ctx) {
  const { live, selected } = known, many = live.vehicles.length > 30;
  ctx.clearRect(0, 0, box.width, box.height);
  drawStars(ctx);
  if (live.peak) cross(ctx, ...place(live.peak.e, live.peak.n));
  // Real ones and the selected one above the others.
  const above = v => (v.id === selected ? 2 : v.real ? 1 : 0);
  const order = [...live.vehicles].sort((a, b) => above(a) - above(b));
  for (const v of order) drawArrow(ctx, v, many && !above(v) ? .6 : 1);
  ctx.font = "600 12px system-ui, sans-serif"; ctx.textAlign = "left";
  for (const v of order) if (!many || above(v)) {
    const [x, y] = place(v.e, v.n);
    label(ctx, v.id, x + 12, y - 8, v.id === selected ? CHOSEN : colourOfKind(v));
  }
}

export function drawMap() {
  const { site, live } = known;
  if (!site) return;
  const base = fitCanvas($("map-ground")), tracks = fitCanvas($("map-tracks")), marks = fitCanvas($("map"));
  box.width = base.width; box.height = base.height;
  if (!live || !box.width) return;
  const followed = known.follow && live.vehicles.find(v => v.id === known.selected);
  if (followed) { view.e = followed.e; view.n = followed.n; } else if (!view.held) fit();
  const now = [view.e, view.n, view.scale].join();
  if (now !== redrawn || base.changed || tracks.changed) { basePending = trackPending = true; redrawn = now; }
  ask();
  if (basePending) { basePending = false; drawBase(base.ctx); }
  if (trackPending) {
    trackPending = false;
    tracks.ctx.clearRect(0, 0, box.width, box.height);
    drawPieces(tracks.ctx, live.vehicles.filter(v => live.tracks.has(v.id)).map(v => [live.tracks.get(v.id), 5, v.real]));
  }
  drawMarks(marks.ctx);
}

// ---- hands ---------------------------------------------------------------------------------

/** A click goes to the next vehicle, or, once armed, says where the selected one shall go. */
export function arm(on) { armed = on; $("map").classList.toggle("armed", on); }

function click(x, y) {
  if (armed) { gone(...there(x, y), [x, y]); return; }
  const near = known.live.vehicles.map(v => [Math.hypot(place(v.e, v.n)[0] - x, place(v.e, v.n)[1] - y), v.id]).sort((a, b) => a[0] - b[0])[0];
  if (near && near[0] < 26) picked(near[1]);
}

function tell(x, y) {
  const [e, n] = there(x, y), stack = known.site.stacks[0];
  const from = stack ? ` · ${distance(Math.hypot(e - stack.e, n - stack.n))} from ${stack.name}` : "";
  $("pointer").textContent = degrees(latLon(e, n)) + from;
}

export function listenMap(onPick, onGo) {
  picked = onPick; gone = onGo;
  const canvas = $("map"), fingers = new Map();
  let travelled = 0;
  const at = event => { const b = canvas.getBoundingClientRect(); return [event.clientX - b.left, event.clientY - b.top]; };
  canvas.addEventListener("wheel", event => { event.preventDefault(); zoom(Math.exp(-event.deltaY * .0015), ...at(event)); }, { passive: false });
  canvas.addEventListener("pointerdown", event => {
    canvas.setPointerCapture(event.pointerId); fingers.set(event.pointerId, at(event)); travelled = 0;
  });
  canvas.addEventListener("pointermove", event => {
    const to = at(event), from = fingers.get(event.pointerId);
    tell(...to);
    if (!from) return;
    travelled += Math.hypot(to[0] - from[0], to[1] - from[1]);
    fingers.set(event.pointerId, to);
    if (fingers.size === 1) { if (travelled > 5) pan(to[0] - from[0], to[1] - from[1]); return; }
    const other = [...fingers].find(([id]) => id !== event.pointerId)[1], apart = p => Math.hypot(p[0] - other[0], p[1] - other[1]);
    if (apart(from) > 1) zoom(apart(to) / apart(from), (to[0] + other[0]) / 2, (to[1] + other[1]) / 2);
  });
  const up = event => {
    if (fingers.delete(event.pointerId) && event.type === "pointerup" && travelled <= 5 && !fingers.size) click(...at(event));
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("keydown", event => {
    const step = 60, moves = { ArrowLeft: [step, 0], ArrowRight: [-step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
    if (moves[event.key]) pan(...moves[event.key]);
    else if (event.key === "+" || event.key === "=") zoom(1.3);
    else if (event.key === "-") zoom(1 / 1.3);
    else if (event.key === "f") showAll();
    else return;
    event.preventDefault();
  });
}
