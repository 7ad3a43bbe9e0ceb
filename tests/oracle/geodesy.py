"""East and north of the As Pontes stack by ECEF differences (Hofmann-Wellenhof et al. 2008).

Writes tests/oracle/geodesy.in:  python3 tests/oracle/geodesy.py > tests/oracle/geodesy.in
"""
from math import cos, radians, sin, sqrt

A, F = 6378137.0, 1 / 298.257223563
E2 = F * (2 - F)


def ecef(lat, lon):
    n = A / sqrt(1 - E2 * sin(lat) ** 2)
    return n * cos(lat) * cos(lon), n * cos(lat) * sin(lon), n * (1 - E2) * sin(lat)


LAT0, LON0 = radians(43.4417), radians(-7.8631)
X0 = ecef(LAT0, LON0)
print("[")
for lat, lon in ((43.4617, -7.8331), (43.4417, -7.9331), (43.3917, -7.8631)):
    x = ecef(radians(lat), radians(lon))
    dx, dy, dz = (a - b for a, b in zip(x, X0))
    east = -sin(LON0) * dx + cos(LON0) * dy
    north = -sin(LAT0) * cos(LON0) * dx - sin(LAT0) * sin(LON0) * dy + cos(LAT0) * dz
    print(f"    ({lat}, {lon}, {east:.6f}, {north:.6f}),")
print("]")
