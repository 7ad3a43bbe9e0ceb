// The page of a mission: takes what the server sends, shows it and sends back what is clicked.

import { $, known, clock, colourAt, degrees, distance, formula, number, topPpm } from "./shown.js";
import { addPieces, arm, drawMap, listenMap, redrawTracks, showAll, zoom } from "./map.js";
import { drawSection } from "./section.js";
import { drawReadings } from "./readings.js";
import { plusMinus, upTo, valueAndSd } from "./scale.js";
import { fillTeam, goTo, listenTeam, select, sure } from "./team.js";

const PHASES = [["take-off", "Take-off"], ["preliminary", "Preliminary"], ["search", "Search"],
  ["characterise", "Characterise"], ["flux", "Flux"], ["home", "Home"]];
const NUMBERS = [["axis_deg", "axis, towards °", 1], ["effective_height_agl_m", "height H, m AGL", 0],
  ["c_max_ppm", "c_MAX, ppm", 0], ["sigma_y_scale", "σy scale", 2], ["sigma_z_scale", "σz scale", 2],
  ["background_ppm", "background, ppm", 1]];
const EVENTS = 200;
// Digits that a mole fraction of the mission's gas needs beside those of CO2.
const more = key => key.endsWith("_ppm") ? known.site.digits : 0;

let socket = null, highest = -Infinity, newEvents = false;

// ---- what comes ----------------------------------------------------------------------------

/** Takes a message: a picture, with all there is or what is new, or pieces of tracks alone. */
function take(message) {
  const before = known.live;
  if (message.whole) {
    known.live = { ...message, tracks: new Map(), events: [] };
    newEvents = hurry = true;
    highest = -Infinity;
    known.top = null;
    redrawTracks();
  } else if (before) {
    known.live = "time_s" in message ? { ...message, tracks: before.tracks, events: before.events, health: { ...before.health, ...message.health } } : before;
  } else return;
  const live = known.live, grown = [];
  for (const { id, halvings, points } of message.tracks) {
    let flat = live.tracks.get(id) || [];
    if (halvings) redrawTracks();
    for (let k = 0; k < halvings; k++) flat = flat.filter((_, i) => Math.floor(i / 5) % 2 === 0);
    grown.push([id, flat.length]);
    for (const value of points) flat.push(value);
    for (let i = 4; i < points.length; i += 5) if (points[i] > highest) highest = points[i];
    live.tracks.set(id, flat);
  }
  if (highest > topPpm()) {
    // The colours follow the readings, in few steps.
    const { grey_ppm } = known.site;
    known.top = grey_ppm + upTo(highest - grey_ppm);
    redrawTracks();
  }
  addPieces(grown);
  if (message.events?.length) { live.events = live.events.concat(message.events).slice(-EVENTS); newEvents = true; }
}

// ---- the answer ----------------------------------------------------------------------------

function fillPeak() {
  const { live, site } = known, p = live.peak, big = $("peak-number"), rest = $("peak-rest");
  $("conclusion").textContent = live.conclusion || "";
  if (!p) { big.textContent = live.ended ? "no peak to report" : "no peak found yet"; rest.textContent = ""; return; }
  big.textContent = `${plusMinus(p.ppm, p.sd)} ppm, ${live.ended ? "" : "preliminary, "}${p.status}`;
  const from = site.stacks[0];
  const away = from ? `${distance(Math.hypot(p.e - from.e, p.n - from.n))} from ${from.name}, ` : "";
  rest.textContent = `${away}${(p.alt - site.ground_amsl_m).toFixed(0)} m AGL; ${degrees([p.lat, p.lon])}`;
}

function fillModel() {
  const { live } = known, body = $("model").tBodies[0];
  if (!live.model) { body.replaceChildren(); return; }
  body.replaceChildren(...NUMBERS.map(([key, name, digits]) => {
    const row = document.createElement("tr"), shown = digits + more(key);
    const [before, now] = [live.before[key], live.model[key]];
    for (const text of [name, number(before[0], shown), ...valueAndSd(...now)]) row.insertCell().textContent = text;
    return row;
  }));
  $("taken").textContent = `${live.model.observations} real readings used`;
  $("mechanisms").textContent = live.model.mechanisms.join(" ");
  $("flux").textContent = live.model.flux.map(([source, method, rate]) =>
    `${source}: ${rate} by ${method}`).join("; ") || "not measured yet";
}

function fillGap() {
  const x = known.live.extension;
  if (!x) { $("gap").textContent = "no verdict yet"; return; }
  const causes = x.causes.map(c => `${c.mechanisms.join(" or ")} (${Math.round(100 * c.probability)} %)`).join(", ");
  const names = x.mechanisms.map(m => m.id).join(", ") || causes;
  $("gap").textContent = x.verdict + (names ? ": " + names : "") + (x.adopt ? " (adopted)" : "");
}

// ---- header, events ------------------------------------------------------------------------

function fillEvents() {
  const { live } = known;
  if (!newEvents) return;
  newEvents = false;
  $("events").replaceChildren(...live.events.slice().reverse().map(([t, who, severity, text]) => {
    const item = document.createElement("li"), time = document.createElement("time"), words = document.createElement("span");
    time.textContent = clock(t); words.textContent = `${who}: ${text}`; words.className = severity;
    item.append(time, words);
    return item;
  }));
}

function fillHeader() {
  const { live, site } = known, now = PHASES.findIndex(([id]) => id === live.phase);
  [...$("phases").children].forEach((item, i) => {
    item.className = i < now ? "past" : i === now ? "now" : "";
    if (i === now) item.setAttribute("aria-current", "step"); else item.removeAttribute("aria-current");
  });
  $("time").textContent = `${clock(live.time_s)} / ${clock(site.duration_s)}`;
  $("pace").textContent = live.ended ? "ended" : live.paused ? "paused" : live.factor ? `× ${live.factor < 10 ? live.factor.toFixed(1) : live.factor.toFixed(0)}` : "";
  $("progress").firstElementChild.style.width = Math.min(100, 100 * live.time_s / site.duration_s) + "%";
  $("pause").textContent = live.paused ? "Resume" : "Pause";
  $("pause").hidden = !site.offered.pause || (live.ended && !site.offered.timeline_s);
  $("home").hidden = !site.offered.control || live.ended;
  $("report").hidden = !live.reported;
  for (const b of document.querySelectorAll("[data-factor]")) {
    b.hidden = !site.offered.speed || (live.ended && !site.offered.timeline_s);
    b.setAttribute("aria-pressed", (b.dataset.factor ? Number(b.dataset.factor) : null) === live.speed);
  }
  if (site.offered.timeline_s && !$("timeline").matches(":active")) $("timeline").value = live.time_s;
  if (live.ended && !site.offered.timeline_s) say(live.reported ? "The mission is over; its report is ready." : "The mission is over.");
  else say("");
}

function say(text) {
  if ($("notice").textContent !== text) $("notice").textContent = text;
  $("notice").hidden = !text;
}

/** The scale ends at its red end, which is above the highest reading. */
function nameScale() {
  const { site } = known;
  $("scale-low").textContent = "≤ " + number(site.grey_ppm, site.digits);
  $("scale-high").textContent = number(topPpm(), site.digits);
  $("scale-most").textContent = Number.isFinite(highest) ? `, highest ${number(highest, site.digits)}` : "";
}

// What the map shows in words, for who does not see it.
function describe() {
  const { live, site } = known, m = live.model;
  const wind = m ? `wind ${m.wind_speed_m_s.toFixed(1)} m/s from ${((m.axis_deg[0] + 180) % 360).toFixed(0)}°` : "wind unknown";
  $("wind-label").textContent = m ? wind.slice(5) : "–";
  $("wind-needle").style.transform = `rotate(${m ? m.axis_deg[0] : 0}deg)`;
  $("wind-needle").style.visibility = m ? "visible" : "hidden";
  const peak = live.peak ? `peak ${$("peak-number").textContent}, ${$("peak-rest").textContent}` : "no peak yet";
  $("map").setAttribute("aria-label", `Map of ${site.mission}: ${live.vehicles.length} vehicles, ${wind}, ${peak}. Arrow keys move the map, + and - zoom, f shows everything.`);
}

// ---- talk ----------------------------------------------------------------------------------

const SLOW = [drawSection, () => { fillModel(); nameScale(); }, drawReadings, () => { fillEvents(); describe(); }];
let drawing = false, hurry = true, turn = 0;

function show() {
  drawing = false;
  if (!known.live) return;
  const began = performance.now();
  fillHeader(); fillTeam(); fillPeak(); fillGap();
  drawMap();
  // What changes slowly takes turns, so that no frame is long.
  for (const draw of hurry ? SLOW : [SLOW[turn++ % SLOW.length]]) draw();
  hurry = false;
  // For who measures: the longest and the last of the drawing, ms.
  const took = performance.now() - began;
  document.body.dataset.drawMs = took.toFixed(1);
  document.body.dataset.drawMostMs = Math.max(Number(document.body.dataset.drawMostMs || 0), took).toFixed(1);
}

function soon() { if (!drawing) { drawing = true; requestAnimationFrame(show); } }
function atOnce() { hurry = true; soon(); }

function send(command) {
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(command));
}

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  socket.onmessage = message => { take(JSON.parse(message.data)); soon(); };
  socket.onclose = () => {
    if (!(known.live && known.live.ended)) say("No connection to the mission; reconnecting …");
    setTimeout(connect, 1500);
  };
}

function listen() {
  $("pause").onclick = () => send({ command: known.live && known.live.paused ? "resume" : "pause" });
  $("home").onclick = async () => {
    const up = known.live.vehicles.filter(v => v.airborne).length;
    if (await sure(`Call all ${up} vehicles in the air home to land? This ends the search.`)) send({ command: "home" });
  };
  for (const b of document.querySelectorAll("[data-factor]")) {
    b.onclick = () => send({ command: "speed", factor: b.dataset.factor ? Number(b.dataset.factor) : null });
  }
  $("fit").onclick = () => { showAll(); };
  $("nearer").onclick = () => zoom(1.4);
  $("further").onclick = () => zoom(1 / 1.4);
  const timeline = $("timeline"), span = known.site.offered.timeline_s;
  timeline.hidden = !span;
  if (span) {
    [timeline.min, timeline.max] = span;
    timeline.oninput = () => send({ command: "seek", time_s: Number(timeline.value) });
  }
  window.addEventListener("resize", atOnce);
  listenMap(select, (e, n, at) => goTo(e, n, at, send));
  listenTeam(send, arm, atOnce);
}

async function start() {
  const site = known.site = await (await fetch("site.json")).json();
  document.title = "Plumage: " + site.mission;
  $("mission").textContent = site.mission;
  $("phases").replaceChildren(...PHASES.map(([, name]) => { const item = document.createElement("li"); item.textContent = name; return item; }));
  nameScale();
  $("scale-gas").textContent = `ppm ${formula(site.gas)}, readings`;
  $("scale-bar").style.background = `linear-gradient(90deg, ${site.colours.map(([at]) => `${colourAt(at)} ${100 * at}%`).join(",")})`;
  listen(); drawMap(); connect();
}

start();
