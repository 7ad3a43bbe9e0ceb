"""The page and a report in a browser: is it drawn, does anything cover another, does each button do what it says?

    python3 tests/oracle/page.py target/release/plumage

Needs the PyPI packages playwright and axe-playwright-python, and a Chromium, the one that CHROMIUM names or that is on PATH.
Flies the reference mission with 6 and with 100 vehicles and looks at it at 1280 x 800 and at 390 x 844. Ends with 1 and says what
is wrong.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).parent.parent.parent
SCENARIO = ROOT / "scenarios/as-pontes-steady.toml"
SIZES = [(1280, 800), (390, 844)]
# Largest message, bytes, and longest median of the drawing, ms, that a page may have with a hundred vehicles.
LARGEST, LONGEST_MS = 50_000, 50
# Smallest side of what a finger has to meet, CSS pixels (WCAG 2.5.5).
FINGER = 44

wrong = []


def check(good, what):
    if not good:
        wrong.append(what)
        print("WRONG:", what, flush=True)


def hundred(folder):
    """The mission with a hundred vehicles on a field of ten by ten homes, the last of them a stand-in."""
    text = SCENARIO.read_text()
    head, rest = text.split("[[vehicle]]", 1)
    tail = rest[rest.index("\n[reality"):]
    vehicles = ""
    for k in range(100):
        kind = "stand-in" if k == 99 else "simulated"
        lat, lon = 43.427 + 0.0006 * (k // 10), -7.846 + 0.0008 * (k % 10)
        vehicles += f'[[vehicle]]\nid = "{k + 1}"\naircraft = "{ROOT}/aircraft/x8.toml"\nkind = "{kind}"\n'
        vehicles += f"home = {{ lat_deg = {lat:.5f}, lon_deg = {lon:.5f} }}\n\n"
    path = folder / "hundred.toml"
    path.write_text(head + vehicles + tail)
    return path


class Mission:
    """A mission that flies, with its page."""

    def __init__(self, program, scenario, out):
        self.process = subprocess.Popen(
            [program, "run", scenario, "--out", out, "--serve", "127.0.0.1:0", "--speed", "20", "--hold"],
            stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        for line in self.process.stderr:
            found = re.search(r"live page: (http://\S+)", line)
            if found:
                self.url = found.group(1)
                break
        else:
            raise SystemExit("the mission shows no page")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()


COLOURS = """id => { const c = document.getElementById(id), d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
  const seen = new Set(); for (let i = 0; i < d.length; i += 4) seen.add(d[i] << 16 | d[i+1] << 8 | d[i+2]); return seen.size; }"""
BOXES = """selectors => selectors.flatMap(s => [...document.querySelectorAll(s)].map(e => [s, e.getBoundingClientRect()]))
  .filter(([, b]) => b.width > 0 && b.height > 0).map(([s, b]) => [s, b.left, b.top, b.right, b.bottom])"""


# Texts of the figures that leave their figure or cover another.
TEXTS = """() => [...document.querySelectorAll(".plot svg")].flatMap(svg => {
  const edge = svg.getBoundingClientRect(), texts = [...svg.querySelectorAll("text")].filter(t => t.textContent.trim())
    .map(t => [t.textContent, t.getBoundingClientRect()]);
  const clipped = texts.filter(([, b]) => b.left < edge.left - 1 || b.right > edge.right + 1 || b.top < edge.top - 1 || b.bottom > edge.bottom + 1)
    .map(([t]) => `"${t}" is clipped`);
  const covered = texts.flatMap(([t, a], i) => texts.slice(i + 1).filter(([, b]) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1
    && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 4).map(([u]) => `"${t}" covers "${u}"`));
  return [...clipped, ...covered];
})"""


def texts_apart(page, name):
    """Every text of every figure can be read."""
    faults = page.evaluate(TEXTS)
    check(not faults, f"{name}: " + "; ".join(faults[:5]))


def look_at_report(browser, report):
    """The mission's report as a file, on a desk and on a phone."""
    for width, height in SIZES:
        page = browser.new_page(viewport={"width": width, "height": height})
        faults = []
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.goto(report.as_uri())
        page.wait_for_timeout(500)
        name = f"report at {width} px"
        check(not faults, f"{name}: {faults[:1]}")
        figures = page.locator(".plot").count()
        check(figures >= 2 and page.locator(".plot svg").count() == figures, f"{name}: not every figure is drawn")
        texts_apart(page, name)
        wide = page.evaluate("document.documentElement.scrollWidth - window.innerWidth")
        check(wide <= 0, f"{name}: {wide} px wider than the window")
        page.close()


def boxes_apart(page, name):
    """Nothing that lies on the map covers another, and nothing is wider than the page."""
    boxes = page.evaluate(BOXES, [".legend", ".wind", ".scale", ".tools", ".rulers"])
    check(len(boxes) == 5, f"{name}: {len(boxes)} of 5 things lie on the map")
    for i, (a, left, top, right, bottom) in enumerate(boxes):
        for b, l, t, r, u in boxes[i + 1:]:
            check(min(right, r) <= max(left, l) or min(bottom, u) <= max(top, t), f"{name}: {a} and {b} cover each other")
    wide = page.evaluate("document.documentElement.scrollWidth - window.innerWidth")
    check(wide <= 0, f"{name}: {wide} px wider than the window")


def look(page, name, messages):
    for canvas, least in [("map-ground", 20), ("map", 8), ("section", 20)]:
        colours = page.evaluate(COLOURS, canvas)
        check(colours >= least, f"{name}: {canvas} has {colours} colours, expected {least} or more")
    lines = page.locator("#readings svg [clip-path] path").count()
    check(lines >= 1, f"{name}: no line of readings is drawn")
    texts_apart(page, name)
    boxes_apart(page, name)
    check(max(messages) <= LARGEST, f"{name}: a message of {max(messages)} bytes")
    times = []
    for _ in range(15):
        page.wait_for_timeout(210)
        times.append(float(page.evaluate("document.body.dataset.drawMs")))
    median = sorted(times)[len(times) // 2]
    check(median <= LONGEST_MS, f"{name}: drawing takes {median} ms")
    faults = [v for v in Axe().run(page).response["violations"] if v["impact"] in ("serious", "critical")]
    check(not faults, f"{name}: axe: " + ", ".join(f"{v['id']} ({v['nodes'][0]['html'][:80]})" for v in faults))
    print(f"{name}: drawn in {median} ms, messages up to {max(messages)} bytes", flush=True)


def until(page, script, what):
    try:
        page.wait_for_function(script, timeout=20_000)
    except Exception:
        check(False, what)


def doing(page, text):
    """Waits until the selected vehicle is said to do that."""
    until(page, f"document.getElementById('vehicle-doing').textContent.includes('{text}')", f"a vehicle is not: {text}")


def press(page):
    """Each button, and what comes back from the mission."""
    until(page, "[...document.querySelectorAll('#team tr')].some(r => /point|pass|take off/.test(r.textContent))", "nobody flies")
    page.click("#team tbody tr:nth-child(1) .name")
    page.click("#follow")
    page.click("#take-over")
    check("Take 1 over?" in page.text_content("#sure-question"), "take over does not ask")
    page.click("#sure button[value=no]")
    page.wait_for_timeout(800)
    check("PILOT" not in page.text_content("#vehicle-doing"), "no is taken for yes")
    page.click("#take-over")
    page.click("#sure button[value=yes]")
    doing(page, "PILOT")
    page.click("#go-to")
    box = page.locator("#map").bounding_box()
    page.fill("#go-to-alt", "5000")
    page.mouse.click(box["x"] + .62 * box["width"], box["y"] + .45 * box["height"])
    until(page, "document.getElementById('refusal').textContent.includes('expected at most')", "5,000 m are not refused where clicked")
    page.click("#hand-back")
    until(page, "!document.getElementById('vehicle-doing').textContent.includes('PILOT')", "hand back does nothing")
    page.click("#pause")
    until(page, "document.getElementById('pace').textContent === 'paused'", "pause does nothing")
    page.click("#pause")
    page.click("[data-factor='10']")
    until(page, "document.querySelector(\"[data-factor='10']\").getAttribute('aria-pressed') === 'true'", "x 10 does nothing")
    page.click("#vehicle-home")
    doing(page, "home")
    page.click("#home")
    check("home to land?" in page.text_content("#sure-question"), "All home does not ask")
    page.click("#sure button[value=yes]")
    until(page, "document.querySelector('#phases .now').textContent === 'Home'", "all home does nothing")
    page.focus("#map")
    before = page.evaluate(COLOURS, "map-ground")
    for key in ("+", "ArrowLeft", "f"):
        page.keyboard.press(key)
    page.wait_for_timeout(500)
    check(before > 0 and page.evaluate(COLOURS, "map-ground") > 0, "keys leave an empty map")


def main(program):
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    if not chromium:
        raise SystemExit("no Chromium: set CHROMIUM")
    folder = Path(tempfile.mkdtemp())
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for team, scenario in [(6, SCENARIO), (100, hundred(folder))]:
            with Mission(program, scenario, folder / f"out-{team}") as mission:
                for width, height in SIZES:
                    name = f"{team} vehicles, {width} x {height}"
                    context = browser.new_context(viewport={"width": width, "height": height}, has_touch=width < 600, bypass_csp=True)
                    page = context.new_page()
                    messages = []
                    page.on("websocket", lambda s: s.on("framereceived", lambda m: messages.append(len(m))))
                    page.on("pageerror", lambda e: check(False, f"{name}: {e}"))
                    page.goto(mission.url)
                    until(page, f"document.querySelectorAll('#team tbody tr').length === {team}", f"{name}: no {team} rows")
                    until(page, "document.getElementById('wind-label').textContent !== '–'", f"{name}: no model")
                    page.wait_for_timeout(2500)
                    look(page, name, messages)
                    if width < 600:
                        small = page.evaluate("""least => [...document.querySelectorAll('button, a, input')].map(e => [e.id || e.textContent,
                            e.getBoundingClientRect()]).filter(([, b]) => b.width && (b.height < least || b.width < least)).map(([i]) => i)""", FINGER)
                        check(not small, f"{name}: too small for a finger: {small[:5]}")
                    elif team == 6:
                        press(page)
                    context.close()
        out = folder / "report"
        subprocess.run([program, "run", SCENARIO, "--duration", "300", "--no-serve", "--out", out], check=True, capture_output=True)
        look_at_report(browser, out / "report.html")
        browser.close()
    shutil.rmtree(folder)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main(sys.argv[1])
