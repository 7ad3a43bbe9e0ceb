"""The ground of scenarios/mountains.toml, by formula and of no real place.

A valley towards 60 degrees, level for 900 m to both sides, between slopes of 350 m, and a hill of 200 m in it 2.5 km
from the stack; the ground at the stack is 600 m. Run: python3 tests/oracle/mountains.py > scenarios/mountains.asc
"""
import numpy as np

LAT, LON, STEP = 46.5, 9.5, 0.001
lat = LAT + STEP * np.arange(-45, 46)[::-1]
lon = LON + STEP * np.arange(-60, 61)
north = (lat - LAT)[:, None] * 111_170.0
east = (lon - LON)[None, :] * 111_320.0 * np.cos(np.radians(LAT))
axis = np.radians(60.0)
along, across = east * np.sin(axis) + north * np.cos(axis), east * np.cos(axis) - north * np.sin(axis)
slope = 350.0 * (1.0 - np.exp(-((np.maximum(np.abs(across) - 900.0, 0.0) / 1000.0) ** 2)))
hill = 200.0 * np.exp(-0.5 * (((along - 2500.0) / 600.0) ** 2 + (across / 500.0) ** 2))
height = 600.0 + slope + hill
print(f"ncols {len(lon)}\nnrows {len(lat)}\nxllcenter {lon[0]:.3f}\nyllcenter {lat[-1]:.3f}\ncellsize {STEP}\nNODATA_value -9999")
for row in height:
    print(" ".join(f"{h:.0f}" for h in row))
