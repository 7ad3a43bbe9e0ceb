// The team: a table that stays readable with a hundred vehicles, and what can be done with the one that is selected.

import { $, known, clock, degrees, latLon, number } from "./shown.js";

const LEVELS = { automatic: "automatic", pilot: "PILOT", guardian: "Guardian" };
// Silent for so long a vehicle's link is taken for lost, s: as long as its Guardian waits.
const SILENT_S = 5;
// As the bridge warns, percent.
const LOW_BATTERY = 20;
const rows = new Map();
let order = "", say = () => {};

const WAITS = "waiting to take off";
const WHY_WAITS = "neighbours take off and land one after another, and only with time left to land";

const doing = v => v.silent_s > SILENT_S && v.airborne ? `silent ${clock(v.silent_s)}`
  : v.level !== "automatic" ? LEVELS[v.level] : v.airborne ? v.purpose || "automatic"
  : v.flew || known.live.phase === "home" || known.live.ended ? "on the ground" : WAITS;

/** How a vehicle is; nothing of a simulated one, also where a real one had its place before. */
const healthOf = v => v.real ? known.live.health[v.id] : undefined;

/** Sets a text only where it is another: a hundred rows are drawn five times a second. */
function set(node, text) { if (node.textContent !== text) node.textContent = text; }

function makeRow(v) {
  const row = document.createElement("tr"), name = document.createElement("button");
  row.dataset.id = v.id;
  for (let k = 0; k < 6; k++) row.insertCell();
  row.cells[5].className = "battery";
  name.type = "button"; name.className = "name";
  name.append(document.createElement("i"), v.id);
  row.cells[0].append(name);
  row.addEventListener("click", () => select(known.selected === v.id ? null : v.id));
  return row;
}

function fillRow(row, v) {
  row.className = (v.real ? "real " : "") + (v.level === "automatic" ? "" : "pilot ") + (v.silent_s > SILENT_S && v.airborne ? "silent " : "")
    + (v.id === known.selected ? "chosen" : "");
  row.cells[0].firstChild.setAttribute("aria-pressed", v.id === known.selected);
  row.cells[0].firstChild.title = v.real ? "real" : "simulated";
  set(row.cells[1], doing(v));
  if (row.cells[1].title !== (v.reason || "")) row.cells[1].title = v.reason || "";
  set(row.cells[2], number(v.agl, 0));
  set(row.cells[3], number(v.airspeed, 1));
  set(row.cells[4], number(v.ppm ?? NaN, known.site.digits));
  const left = healthOf(v)?.battery_percent;
  set(row.cells[5], left ?? "");
  row.cells[5].classList.toggle("low", left <= LOW_BATTERY);
}

/** Whether a vehicle is one of those asked for: by id, kind, level or what it does. */
function isAsked(v, words) {
  const text = `${v.id} ${v.real ? "real" : "simulated"} ${LEVELS[v.level]} ${doing(v)}`.toLowerCase();
  return words.every(word => text.includes(word));
}

/** How many vehicles do what, the most frequent first. */
function activities(vehicles) {
  const counts = new Map();
  for (const v of vehicles) {
    const what = v.silent_s > SILENT_S && v.airborne ? "silent" : doing(v);
    counts.set(what, (counts.get(what) || 0) + 1);
  }
  const why = what => what === WAITS ? ` (${WHY_WAITS})` : "";
  return [...counts].sort((a, b) => b[1] - a[1]).map(([what, count]) => `${count} ${what}${why(what)}`).join(", ");
}

export function fillTeam() {
  const { live } = known, words = $("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
  const shown = live.vehicles.filter(v => isAsked(v, words)).sort((a, b) => a.id.localeCompare(b.id, "en", { numeric: true }));
  const now = shown.map(v => v.id).join();
  for (const v of shown) if (!rows.has(v.id)) rows.set(v.id, makeRow(v));
  if (now !== order) { order = now; $("team").tBodies[0].replaceChildren(...shown.map(v => rows.get(v.id))); }
  for (const v of shown) fillRow(rows.get(v.id), v);
  const real = live.vehicles.filter(v => v.real).length, up = live.vehicles.filter(v => v.airborne).length;
  const many = live.vehicles.length > 8;
  set($("team-count"), `${live.vehicles.length}, ${real} real, ${up} in the air` + (words.length ? `; ${shown.length} shown` : "")
    + (many ? `: ${activities(live.vehicles)}` : ""));
  $("filter").hidden = !many;
  $("team").classList.toggle("simulated", !live.vehicles.some(healthOf));
  fillVehicle();
}

export function select(id) {
  known.selected = id;
  if (!id) known.follow = false;
  going(false);
  const row = id && rows.get(id);
  if (row) row.scrollIntoView({ block: "nearest" });
  say();
}

// ---- the selected one ----------------------------------------------------------------------

let armed = () => {};

/** Whether the next click on the map says where the selected vehicle goes. */
function going(on) {
  armed(on);
  $("go-to").setAttribute("aria-pressed", on);
  $("go-to-row").hidden = !on;
}

function fillVehicle() {
  const { live, site } = known, v = live.vehicles.find(v => v.id === known.selected);
  $("vehicle").hidden = !v;
  if (!v) return;
  const automatic = v.level === "automatic", can = site.offered.control && !live.ended;
  set($("vehicle-name"), `${v.id}, ${v.real ? "real" : "simulated"}`);
  const why = v.reason || (doing(v) === WAITS ? WHY_WAITS : "");
  set($("vehicle-doing"), doing(v) + (why ? `: ${why}` : ""));
  set($("vehicle-where"), `${degrees(latLon(v.e, v.n))}; ${v.alt} m AMSL, ${v.agl} m AGL; ${number(v.airspeed, 1)} m/s, heading ${v.heading}°; last message ${v.silent_s > 0 ? `${clock(v.silent_s)} ago` : "now"}`);
  fillHealth(healthOf(v));
  $("follow").setAttribute("aria-pressed", known.follow);
  // A real vehicle's pilot takes over by a remote control of his own.
  const flown = can && !v.real && v.airborne;
  $("take-over").hidden = !flown;
  set($("take-over"), automatic ? "take over" : "loiter here");
  $("go-to").hidden = !flown;
  $("hand-back").hidden = !can || automatic;
  $("vehicle-home").hidden = !can || !v.airborne;
}

/** How a real vehicle is: ids, mode, battery, link, and what of its checklist is not right. */
function fillHealth(h) {
  $("vehicle-health").hidden = !h;
  $("vehicle-findings").hidden = !(h && h.findings.length);
  if (!h) return;
  const heard = h.system_id == null ? "no heartbeat yet" : `system ${h.system_id}, component ${h.component_id}`;
  const part = (value, text) => value == null ? [] : [text];
  const lost = h.lost_frames + h.unreadable_frames + h.refused_frames;
  const words = [`${h.autopilot}, ${heard}`, ...part(h.flight_mode, h.flight_mode), ...part(h.armed, h.armed ? "armed" : "disarmed"),
    ...part(h.battery_percent, `battery ${h.battery_percent} %`), ...part(h.battery_v, `${number(h.battery_v ?? NaN, 1)} V`),
    ...part(h.satellites, `${h.satellites} satellites`),
    `${h.frames} frames` + (lost ? ` (${h.lost_frames} lost, ${h.unreadable_frames} unreadable, ${h.refused_frames} rejected)` : ""),
    ...part(h.checked, !h.checked ? "checklist pending" : h.findings.length ? `${h.findings.length} of the checklist to correct` : "checklist passed")];
  set($("vehicle-health"), words.join(", "));
  const says = h.findings.map(f => `${f.about}: ${f.says}`);
  const list = $("vehicle-findings");
  if (list.textContent === says.join("")) return;
  list.replaceChildren(...says.map((text, k) => {
    const item = document.createElement("li");
    item.textContent = text;
    item.className = h.findings[k].refused ? "refused" : "";
    return item;
  }));
}

/** Asks before a vehicle is taken from its automatic flight; no question where a pilot has it already. */
export async function sure(question) {
  const box = $("sure");
  $("sure-question").textContent = question;
  box.returnValue = "";
  box.showModal();
  return new Promise(answer => box.addEventListener("close", () => answer(box.returnValue === "yes"), { once: true }));
}

/** Says at a place on the map why a vehicle does not go there, until the next click or for some seconds. */
function refuse(text, [x, y]) {
  const box = $("refusal");
  clearTimeout(refuse.timer);
  box.textContent = text; box.hidden = !text;
  if (!text) return;
  const { width, height } = box.parentElement.getBoundingClientRect();
  box.style.left = Math.max(0, Math.min(x + 12, width - box.offsetWidth - 8)) + "px";
  box.style.top = Math.max(0, Math.min(y + 12, height - box.offsetHeight - 8)) + "px";
  refuse.timer = setTimeout(() => { box.hidden = true; }, 8000);
}

/** Why a vehicle would not go to a place, by its own rule; nothing where it may, or where the server does not answer. */
async function whyNot(vehicle, e, n, alt) {
  const asked = new URLSearchParams({ vehicle, e, n, alt_amsl_m: alt });
  try { return (await (await fetch(`refusal.json?${asked}`)).json()).why; } catch { return null; }
}

/** Sends the selected vehicle to a place of the map, which was clicked at `at`. */
export async function goTo(e, n, at, send) {
  const v = known.live.vehicles.find(v => v.id === known.selected), alt = Number($("go-to-alt").value);
  refuse("", at);
  if (!v || !Number.isFinite(alt)) { going(false); return; }
  const why = await whyNot(v.id, e, n, alt);
  // The next click may name another place.
  if (why) { refuse(`${v.id} does not go there: ${why}`, at); return; }
  going(false);
  const question = `Send ${v.id} to ${degrees(latLon(e, n), 4)}, ${alt} m AMSL? It circles there until you hand it back.`;
  if (v.level !== "automatic" || await sure(question)) send({ command: "go-to", vehicle: v.id, e, n, alt_amsl_m: alt });
}

export function listenTeam(send, arm, changed) {
  armed = arm; say = changed;
  const chosen = () => known.live.vehicles.find(v => v.id === known.selected);
  $("filter").oninput = fillTeam;
  $("follow").onclick = () => { known.follow = !known.follow; changed(); };
  $("hand-back").onclick = () => send({ command: "hand-back", vehicle: known.selected });
  $("vehicle-home").onclick = () => send({ command: "home", vehicle: known.selected });
  $("vehicle-close").onclick = () => select(null);
  $("take-over").onclick = async () => {
    const v = chosen();
    const question = `Take over ${v.id}? It circles where it is and leaves the search until you hand it back.`;
    if (v.level !== "automatic" || await sure(question)) send({ command: "take-over", vehicle: v.id });
  };
  $("go-to").onclick = () => {
    const on = $("go-to").getAttribute("aria-pressed") !== "true";
    if (on) $("go-to-alt").value = chosen().alt;
    going(on);
  };
}
