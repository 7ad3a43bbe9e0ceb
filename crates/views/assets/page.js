"use strict";
// The page of a running mission: draws what the server sends and sends back what is clicked.

const $ = id => document.getElementById(id);
const PHASES = [["take-off", "Take-off"], ["preliminary", "Preliminary"], ["search", "Search"],
  ["characterise", "Characterise"], ["flux", "Flux"], ["home", "Home"]];
const NUMBERS = [["axis_deg", "axis, towards °", 1], ["effective_height_agl_m", "height H, m AGL", 0],
  ["c_max_ppm", "c_MAX, ppm", 0], ["sigma_y_scale", "σy scale", 2], ["sigma_z_scale", "σz scale", 2],
  ["background_ppm", "background, ppm", 1]];
// Digits that a mole fraction of the mission's gas needs beside those of CO2.
const more = key => key.endsWith("_ppm") ? site.digits : 0;
// What counts as much as a ppm of CO2, as far as colours and shades go.
const unit = () => (site.red_ppm - site.grey_ppm) / 390;
const LEVELS = { automatic: "automatic", pilot: "PILOT", guardian: "Guardian" };

let site = null, live = null, socket = null, drawn = null;
const view = { e: 0, n: 0, scale: 0.1, held: false };

// ---- colours -------------------------------------------------------------------------------

function rgb(hex) { return [1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16)); }

function colourOf(ppm) {
  const stops = site.colours;
  let at = (ppm - site.grey_ppm) / (site.red_ppm - site.grey_ppm);
  at = Number.isFinite(at) ? Math.min(1, Math.max(0, at)) : 0;
  let i = 1;
  while (i < stops.length - 1 && at > stops[i][0]) i++;
  const [a, from] = stops[i - 1], [b, to] = stops[i];
  const part = (at - a) / (b - a), f = rgb(from), t = rgb(to);
  return "rgb(" + f.map((v, k) => Math.round(v + part * (t[k] - v))).join(",") + ")";
}

// ---- map -----------------------------------------------------------------------------------

const canvas = $("map"), ctx = canvas.getContext("2d");

function size() {
  const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
  canvas.width = Math.round(box.width * ratio);
  canvas.height = Math.round(box.height * ratio);
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  return box;
}

function fit() {
  const box = canvas.getBoundingClientRect();
  if (!live) return;
  const [w, s, e, n] = live.area;
  view.e = (w + e) / 2;
  view.n = (s + n) / 2;
  view.scale = 0.86 * Math.min(box.width / (e - w), box.height / (n - s));
  view.held = false;
}

const place = (box, e, n) =>
  [box.width / 2 + (e - view.e) * view.scale, box.height / 2 - (n - view.n) * view.scale];

function niceStep(atLeast) {
  const ten = 10 ** Math.floor(Math.log10(atLeast));
  return [1, 2, 5, 10].map(k => k * ten).find(s => s >= atLeast);
}

function drawGround(box) {
  ctx.clearRect(0, 0, box.width, box.height);
  const step = niceStep(70 / view.scale);
  const west = view.e - box.width / 2 / view.scale, south = view.n - box.height / 2 / view.scale;
  ctx.lineWidth = 1;
  ctx.strokeStyle = "#e8e8e3";
  ctx.beginPath();
  for (let e = Math.ceil(west / step) * step; e < west + box.width / view.scale; e += step) {
    const x = Math.round(place(box, e, 0)[0]) + .5;
    ctx.moveTo(x, 0); ctx.lineTo(x, box.height);
  }
  for (let n = Math.ceil(south / step) * step; n < south + box.height / view.scale; n += step) {
    const y = Math.round(place(box, 0, n)[1]) + .5;
    ctx.moveTo(0, y); ctx.lineTo(box.width, y);
  }
  ctx.stroke();
  const px = step * view.scale, x = box.width - 70 - px, y = box.height - 22;
  ctx.strokeStyle = "#5d6470"; ctx.fillStyle = "#5d6470"; ctx.lineWidth = 1.5;
  ctx.beginPath(); ctx.moveTo(x, y - 4); ctx.lineTo(x, y); ctx.lineTo(x + px, y); ctx.lineTo(x + px, y - 4);
  ctx.stroke();
  ctx.font = "12px system-ui, sans-serif"; ctx.textAlign = "center";
  ctx.fillText(step >= 1000 ? step / 1000 + " km" : step + " m", x + px / 2, y - 6);
}

function drawFence(box) {
  if (site.fence.length > 2) {
    ctx.beginPath();
    site.fence.forEach(([e, n], i) => ctx[i ? "lineTo" : "moveTo"](...place(box, e, n)));
    ctx.closePath();
    ctx.setLineDash([8, 5]); ctx.lineWidth = 1.5; ctx.strokeStyle = "#8c94a1"; ctx.stroke();
    ctx.setLineDash([]);
  }
  for (const stack of site.stacks) {
    const [x, y] = place(box, stack.e, stack.n), r = site.keep_out_radius_m * view.scale;
    ctx.beginPath(); ctx.arc(x, y, r, 0, 7);
    ctx.fillStyle = "rgba(93,100,112,.07)"; ctx.fill();
    ctx.setLineDash([3, 4]); ctx.lineWidth = 1.2; ctx.strokeStyle = "#8c94a1"; ctx.stroke();
    ctx.setLineDash([]);
    ctx.fillStyle = "#16181d"; ctx.fillRect(x - 4, y - 4, 8, 8);
    ctx.font = "600 12px system-ui, sans-serif"; ctx.textAlign = "left";
    label(stack.name, x + 9, y + 4, "#16181d");
  }
}

function label(text, x, y, colour) {
  ctx.lineWidth = 3.5; ctx.lineJoin = "round"; ctx.strokeStyle = "rgba(255,255,255,.85)";
  ctx.strokeText(text, x, y);
  ctx.fillStyle = colour; ctx.fillText(text, x, y);
}

const patch = document.createElement("canvas");

function drawPlume(box) {
  const p = live.plume, back = live.model.background_ppm[0];
  if (!p || !p.step) return;
  patch.width = p.columns; patch.height = p.rows;
  const paint = patch.getContext("2d"), image = paint.createImageData(p.columns, p.rows);
  for (let r = 0; r < p.rows; r++) for (let c = 0; c < p.columns; c++) {
    const excess = Math.max(0, p.ppm[r * p.columns + c] - back);
    const at = 4 * ((p.rows - 1 - r) * p.columns + c);
    image.data[at] = 47; image.data[at + 1] = 111; image.data[at + 2] = 159;
    image.data[at + 3] = 165 * (1 - Math.exp(-excess / (160 * unit())));
  }
  paint.putImageData(image, 0, 0);
  const half = p.step / 2;
  const [x, y] = place(box, p.e - half, p.n + (p.rows - 1) * p.step + half);
  ctx.imageSmoothingEnabled = true; ctx.imageSmoothingQuality = "high";
  ctx.drawImage(patch, x, y, p.columns * p.step * view.scale, p.rows * p.step * view.scale);
  for (const level of site.levels_ppm) contour(box, p, back + level, level);
}

// Marching squares: each cell gives at most two pieces of the line.
function contour(box, p, value, level) {
  const at = (c, r) => p.ppm[r * p.columns + c] - value;
  const cut = (a, b) => a / (a - b);
  let furthest = null;
  ctx.beginPath();
  for (let r = 0; r + 1 < p.rows; r++) for (let c = 0; c + 1 < p.columns; c++) {
    const sw = at(c, r), se = at(c + 1, r), ne = at(c + 1, r + 1), nw = at(c, r + 1), ends = [];
    if (sw < 0 !== se < 0) ends.push([c + cut(sw, se), r]);
    if (se < 0 !== ne < 0) ends.push([c + 1, r + cut(se, ne)]);
    if (nw < 0 !== ne < 0) ends.push([c + cut(nw, ne), r + 1]);
    if (sw < 0 !== nw < 0) ends.push([c, r + cut(sw, nw)]);
    for (let i = 0; i + 1 < ends.length; i += 2) {
      const [a, b] = [ends[i], ends[i + 1]].map(([x, y]) => place(box, p.e + x * p.step, p.n + y * p.step));
      ctx.moveTo(...a); ctx.lineTo(...b);
      const e = p.e + c * p.step, n = p.n + r * p.step, d = Math.hypot(e - site.stacks[0]?.e || 0, n - site.stacks[0]?.n || 0);
      if (!furthest || d > furthest[0]) furthest = [d, a];
    }
  }
  ctx.lineWidth = 1; ctx.strokeStyle = "rgba(36,88,130,.55)"; ctx.stroke();
  if (furthest) {
    ctx.font = "10.5px system-ui, sans-serif"; ctx.textAlign = "center";
    label("+" + Number(level.toPrecision(2)), furthest[1][0], furthest[1][1] + 3, "#245882");
  }
}

function drawTracks(box) {
  ctx.lineCap = "round";
  for (const v of live.vehicles) {
    const flat = live.tracks[v.id] || [];
    ctx.lineWidth = v.real ? 3.6 : 2.2;
    for (let i = 4; i < flat.length; i += 4) {
      ctx.strokeStyle = colourOf(flat[i + 3]);
      ctx.beginPath();
      ctx.moveTo(...place(box, flat[i - 3], flat[i - 2]));
      ctx.lineTo(...place(box, flat[i + 1], flat[i + 2]));
      ctx.stroke();
    }
  }
}

function drawStars(box) {
  for (const [e, n, ppm] of live.stars) {
    const [x, y] = place(box, e, n);
    ctx.beginPath();
    for (let i = 0; i < 10; i++) {
      const a = Math.PI * i / 5, r = i % 2 ? 2.6 : 6.2;
      ctx.lineTo(x + r * Math.sin(a), y - r * Math.cos(a));
    }
    ctx.closePath();
    ctx.fillStyle = "#f5c400"; ctx.fill();
    ctx.lineWidth = .8; ctx.strokeStyle = "#a37c00"; ctx.stroke();
  }
}

function drawPeak(box) {
  if (!live.peak) return;
  const [x, y] = place(box, live.peak.e, live.peak.n);
  ctx.strokeStyle = "#fff"; ctx.lineWidth = 4; cross(x, y);
  ctx.strokeStyle = "#d3131f"; ctx.lineWidth = 2; cross(x, y);
}

function cross(x, y) {
  ctx.beginPath(); ctx.arc(x, y, 10, 0, 7);
  ctx.moveTo(x - 15, y); ctx.lineTo(x + 15, y); ctx.moveTo(x, y - 15); ctx.lineTo(x, y + 15);
  ctx.stroke();
}

function drawArrows(box) {
  for (const v of live.vehicles) {
    const [x, y] = place(box, v.e, v.n), colour = v.real ? "#d3131f" : "#16181d";
    ctx.save();
    ctx.translate(x, y); ctx.rotate(v.heading * Math.PI / 180);
    ctx.beginPath();
    ctx.moveTo(0, -12); ctx.lineTo(8, 10); ctx.lineTo(0, 5); ctx.lineTo(-8, 10); ctx.closePath();
    ctx.lineJoin = "round"; ctx.lineWidth = 3; ctx.strokeStyle = "#fff"; ctx.stroke();
    ctx.fillStyle = colour; ctx.fill();
    ctx.restore();
    ctx.font = "600 12px system-ui, sans-serif"; ctx.textAlign = "left";
    label(v.id, x + 12, y - 8, colour);
  }
}

function drawMap() {
  const box = size();
  if (!site || !live) return;
  if (!view.held) fit();
  drawGround(box);
  if (live.model) drawPlume(box);
  drawFence(box);
  drawTracks(box); drawStars(box); drawPeak(box); drawArrows(box);
}

// ---- wind ----------------------------------------------------------------------------------

function drawWind() {
  const w = $("wind"), c = w.getContext("2d"), r = 66;
  c.clearRect(0, 0, 180, 180);
  c.save(); c.translate(90, 90);
  c.strokeStyle = "#c9cdd4"; c.lineWidth = 2; c.beginPath(); c.arc(0, 0, r, 0, 7); c.stroke();
  c.fillStyle = "#5d6470"; c.font = "600 20px system-ui, sans-serif"; c.textAlign = "center"; c.textBaseline = "middle";
  [["N", 0, -r - 13], ["E", r + 14, 0], ["S", 0, r + 14], ["W", -r - 14, 0]].forEach(([t, x, y]) => c.fillText(t, x, y));
  if (live && live.model) {
    c.rotate(live.model.axis_deg[0] * Math.PI / 180);
    c.fillStyle = "#2f6f9f"; c.beginPath();
    c.moveTo(0, -56); c.lineTo(18, -20); c.lineTo(6, -24); c.lineTo(6, 54); c.lineTo(-6, 54); c.lineTo(-6, -24); c.lineTo(-18, -20);
    c.closePath(); c.fill();
    const from = (live.model.axis_deg[0] + 180) % 360;
    $("wind-label").textContent = `${live.model.wind_speed_m_s.toFixed(1)} m/s from ${from.toFixed(0)}°`;
  }
  c.restore();
}

// ---- lists ---------------------------------------------------------------------------------

const clock = s => `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, "0")}`;
const number = (v, digits) => Number.isFinite(v) ? v.toFixed(digits) : "–";

function cell(row, text, title) {
  const td = row.insertCell();
  td.textContent = text;
  if (title) td.title = title;
  return td;
}

// Rows are kept, so that a click on a button is not lost to the next picture.
function teamRow(body, v) {
  const row = body.insertRow(), chip = document.createElement("i"), button = document.createElement("button");
  row.dataset.id = v.id;
  for (let k = 0; k < 6; k++) row.insertCell();
  chip.className = "chip"; chip.style.background = v.real ? "#d3131f" : "#16181d";
  row.cells[0].append(chip, v.id);
  row.cells[0].title = v.real ? "real" : "simulated";
  row.cells[4].style.fontWeight = 600;
  button.type = "button";
  button.addEventListener("click", () => send({ command: button.dataset.wish, vehicle: v.id }));
  row.cells[5].append(button);
}

function fillTeam() {
  const body = $("team").tBodies[0], ids = live.vehicles.map(v => v.id).join();
  if ([...body.rows].map(r => r.dataset.id).join() !== ids) {
    body.replaceChildren();
    for (const v of live.vehicles) teamRow(body, v);
  }
  live.vehicles.forEach((v, k) => {
    const row = body.rows[k], automatic = v.level === "automatic", button = row.cells[5].firstChild;
    row.className = (v.real ? "real " : "") + (automatic ? "" : "pilot");
    const doing = automatic ? v.purpose || "automatic" : LEVELS[v.level];
    row.cells[1].textContent = v.airborne || !automatic ? doing : "on the ground";
    row.cells[1].title = v.reason || "";
    row.cells[2].textContent = number(v.agl, 0);
    row.cells[3].textContent = number(v.airspeed, 1);
    row.cells[4].textContent = number(v.ppm, site.digits);
    button.dataset.wish = automatic ? "take-over" : "hand-back";
    button.textContent = automatic ? "take over" : "hand back";
    button.title = automatic ? "hold it level until it is handed back" : v.reason || "";
    // A real vehicle's pilot takes over by a remote control of his own.
    button.hidden = live.ended || (automatic && (v.real || !v.airborne));
  });
}

function fillModel() {
  const body = $("model").tBodies[0];
  body.replaceChildren();
  if (!live.model) return;
  for (const [key, name, digits] of NUMBERS) {
    const row = body.insertRow();
    cell(row, name);
    const shown = digits + more(key);
    cell(row, number(live.before[key][0], shown));
    cell(row, number(live.model[key][0], shown));
    cell(row, number(live.model[key][1], shown + 1));
  }
  $("taken").textContent = `${live.model.observations} real readings taken in`;
  $("mechanisms").textContent = live.model.mechanisms.length ? "Extended by " + live.model.mechanisms.join(", ") : "";
}

function fillPeak() {
  const p = live.peak, box = $("peak");
  if (!p) return;
  const big = document.createElement("b"), rest = document.createElement("span");
  big.textContent = `${p.ppm.toFixed(site.digits)} ± ${p.sd.toFixed(site.digits)} ppm`;
  const from = site.stacks[0];
  const d = from ? Math.hypot(p.e - from.e, p.n - from.n) : NaN;
  const agl = p.alt - site.ground_amsl_m;
  rest.textContent = `${p.status}; ${number(d, 0)} m from the stack, ${agl.toFixed(0)} m AGL`;
  box.replaceChildren(big, rest);
}

function fillGap() {
  const x = live.extension;
  if (!x) return;
  const names = x.mechanisms.map(m => m.id).join(", ");
  $("gap").textContent = x.verdict + (names ? ": " + names : "") + (x.adopt ? " (adopted)" : "");
}

function fillEvents() {
  const list = $("events");
  list.replaceChildren(...live.events.slice().reverse().map(([t, who, severity, text]) => {
    const item = document.createElement("li"), time = document.createElement("time"), words = document.createElement("span");
    time.textContent = clock(t); words.textContent = `${who}: ${text}`; words.className = severity;
    item.append(time, words);
    return item;
  }));
}

function fillHeader() {
  const now = PHASES.findIndex(([id]) => id === live.phase);
  $("phases").replaceChildren(...PHASES.map(([, name], i) => {
    const item = document.createElement("li");
    item.textContent = name;
    item.className = i < now ? "past" : i === now ? "now" : "";
    return item;
  }));
  $("time").textContent = `${clock(live.time_s)} / ${clock(site.duration_s)}`;
  $("pace").textContent = live.paused ? "paused" : live.factor ? `× ${live.factor < 10 ? live.factor.toFixed(1) : live.factor.toFixed(0)}` : "";
  $("progress").firstElementChild.style.width = Math.min(100, 100 * live.time_s / site.duration_s) + "%";
  $("pause").textContent = live.paused ? "Resume" : "Pause";
  $("pause").setAttribute("aria-pressed", live.paused);
  $("home").onclick = () => send({ command: "home" });
  for (const b of document.querySelectorAll("[data-factor]")) {
    const factor = b.dataset.factor ? Number(b.dataset.factor) : null;
    b.setAttribute("aria-pressed", factor === live.speed);
  }
  if (live.plume) $("plume-label").textContent = `model's plume, ${live.plume.agl.toFixed(0)} m AGL, +ppm`;
  if (live.ended) say("The mission is over: see report.html in its output folder.");
}

function say(text) { $("notice").textContent = text; $("notice").hidden = !text; }

// ---- chart ---------------------------------------------------------------------------------

const SHADES = ["#8a95a5", "#a7b0bd", "#6f7b8c", "#b9c0ca", "#98a2b0"];

function drawChart() {
  let shade = 0;
  const traces = live.vehicles.map(v => {
    const flat = live.tracks[v.id] || [], t = [], y = [];
    for (let i = 0; i < flat.length; i += 4) { t.push(flat[i] / 60); y.push(flat[i + 3]); }
    return {
      x: t, y, name: v.id + (v.real ? " real" : ""), mode: "lines", hovertemplate: `%{y:.${site.digits}f} ppm`,
      line: { color: v.real ? "#d3131f" : SHADES[shade++ % SHADES.length], width: v.real ? 1.8 : 1 },
    };
  }).sort((a, b) => a.line.width - b.line.width);
  const layout = {
    margin: { l: 40, r: 8, t: 4, b: 30 }, showlegend: true, hovermode: "x unified", uirevision: 1,
    paper_bgcolor: "#fff", plot_bgcolor: "#fff", font: { family: "system-ui, sans-serif", size: 11, color: "#5d6470" },
    legend: { orientation: "v", x: 1.01, font: { size: 11 } },
    xaxis: { title: { text: "min", standoff: 2 }, gridcolor: "#eef0f2", zeroline: false, range: [0, Math.max(1, live.time_s / 60)] },
    yaxis: { gridcolor: "#eef0f2", zeroline: false },
  };
  Plotly.react("chart", traces, layout, { displayModeBar: false, responsive: true });
}

// ---- talk ----------------------------------------------------------------------------------

let chartAt = 0;

function show() {
  if (!live || live === drawn) return;
  drawn = live;
  fillHeader(); fillTeam(); fillModel(); fillPeak(); fillGap(); fillEvents();
  drawMap(); drawWind();
  if (performance.now() > chartAt) { drawChart(); chartAt = performance.now() + 900; }
}

function send(command) {
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(command));
}

function connect() {
  socket = new WebSocket(`ws://${location.host}/live`);
  socket.onopen = () => say("");
  socket.onmessage = message => { live = JSON.parse(message.data); requestAnimationFrame(show); };
  socket.onclose = () => {
    if (!(live && live.ended)) say("No connection to the mission; trying again …");
    setTimeout(connect, 1500);
  };
}

function listen() {
  $("pause").onclick = () => send({ command: live && live.paused ? "resume" : "pause" });
  for (const b of document.querySelectorAll("[data-factor]")) {
    b.onclick = () => send({ command: "speed", factor: b.dataset.factor ? Number(b.dataset.factor) : null });
  }
  $("fit").onclick = () => { fit(); drawMap(); };
  window.addEventListener("resize", drawMap);
  canvas.addEventListener("wheel", event => {
    event.preventDefault();
    const box = canvas.getBoundingClientRect(), by = Math.exp(-event.deltaY * .0015);
    const dx = event.clientX - box.left - box.width / 2, dy = event.clientY - box.top - box.height / 2;
    view.e += dx / view.scale * (1 - 1 / by); view.n -= dy / view.scale * (1 - 1 / by);
    view.scale *= by; view.held = true;
    drawMap();
  }, { passive: false });
  canvas.addEventListener("pointerdown", event => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", event => {
    if (!event.buttons) return;
    view.e -= event.movementX / view.scale; view.n += event.movementY / view.scale; view.held = true;
    drawMap();
  });
}

async function start() {
  site = await (await fetch("site.json")).json();
  document.title = "Plumage: " + site.mission;
  $("mission").textContent = site.mission;
  $("scale-ppm-low").textContent = "≤ " + number(site.grey_ppm, site.digits);
  $("scale-ppm-high").textContent = "≥ " + number(site.red_ppm, site.digits);
  // CO₂ for CO2.
  const formula = site.gas.replace(/\d/g, d => String.fromCharCode(0x2080 + Number(d)));
  $("scale-gas").textContent = `ppm ${formula} as read`;
  $("chart-gas").textContent = `${formula} as read, ppm`;
  $("scale-bar").style.background = `linear-gradient(90deg, ${site.colours.map(([at, c]) => `${c} ${100 * at}%`).join(",")})`;
  listen(); drawMap(); drawWind(); connect();
}

start();
