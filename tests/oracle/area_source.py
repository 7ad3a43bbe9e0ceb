"""Concentration downwind of an area source by brute force: point sources every half metre.

c = sum Q/N / (2 pi u sy sz) exp(-y^2/2sy^2) (exp(-(z-H)^2/2sz^2) + exp(-(z+H)^2/2sz^2)),
the integral of the Gaussian point source over the area (US EPA-454/B-95-003b, section 1.2.3; Turner 1970).
Rural Briggs spread. Prints the lines that crates/plume/src/area_tests.rs holds.
Run: python3 tests/oracle/area_source.py
"""
import numpy as np

SIGMAS = {
    "A": (lambda x: .22 * x * (1 + 1e-4 * x) ** -.5, lambda x: .20 * x),
    "D": (lambda x: .08 * x * (1 + 1e-4 * x) ** -.5, lambda x: .06 * x * (1 + 1.5e-3 * x) ** -.5),
    "F": (lambda x: .04 * x * (1 + 1e-4 * x) ** -.5, lambda x: .016 * x * (1 + 3e-4 * x) ** -1),
}
STEP_M = 0.5


def excess(shape, length, width, axis_deg, wind_from_deg, klass, height, places, q=1.0, u=3.0):
    a = np.arange(-length / 2 + STEP_M / 2, length / 2, STEP_M)
    b = np.arange(-width / 2 + STEP_M / 2, width / 2, STEP_M)
    a, b = (g.ravel() for g in np.meshgrid(a, b))
    if shape == "ellipse":
        inside = (2 * a / length) ** 2 + (2 * b / width) ** 2 <= 1
        a, b = a[inside], b[inside]
    t = np.radians(axis_deg)  # from north, clockwise: the length lies along it
    east, north = a * np.sin(t) + b * np.cos(t), a * np.cos(t) - b * np.sin(t)
    w = np.radians(wind_from_deg + 180.0)
    we, wn = np.sin(w), np.cos(w)
    sy, sz = SIGMAS[klass]
    out = []
    for pe, pn, pz in places:
        de, dn = pe - east, pn - north
        x, y = de * we + dn * wn, de * wn - dn * we
        x, y = x[x >= 1], y[x >= 1]
        s, v = sy(x), sz(x)
        shape_ = np.exp(-.5 * (y / s) ** 2) / (s * v)
        up = np.exp(-.5 * ((pz - height) / v) ** 2) + np.exp(-.5 * ((pz + height) / v) ** 2)
        out.append((shape_ * up).sum() * q / len(a) / (2 * np.pi * u))
    return out


PLACES = [  # over the area's middle and lee, just outside, abeam, and far; heights of drones
    (0, 0, 40), (120, 0, 25), (120, 60, 30), (220, 0, 25), (300, -80, 40), (250, 40, 60),
    (600, 0, 25), (600, 150, 60), (1500, 0, 100), (1500, 100, 25),
]
if __name__ == "__main__":
    for shape, length, width, axis, wind, klass, height in [
        ("rectangle", 300, 200, 0, 270, "D", 0),
        ("rectangle", 300, 200, 30, 265, "D", 5),
        ("ellipse", 400, 250, 60, 280, "A", 0),
        ("ellipse", 400, 250, 90, 270, "D", 2),
        ("rectangle", 150, 150, 45, 270, "F", 0),
    ]:
        c = excess(shape, length, width, axis, wind, klass, height, PLACES)
        numbers = ", ".join(f"{v:.5e}" for v in c)
        print(f'("{shape}", {length}, {width}, {axis}, {wind}, "{klass}", {height}, [{numbers}]),')
