"""The packet that pymavlink's fgFDM makes of a known state, and back.

    pip install pymavlink==2.4.50
    python3 tests/oracle/flightgear.py          # writes flightgear.hex beside itself
    python3 tests/oracle/flightgear.py FILE     # decodes a packet of 408 bytes and prints it
"""
import math
import os
import sys

from pymavlink import fgFDM

FOOT = 0.3048
fdm = fgFDM.fgFDM()
if len(sys.argv) > 1:
    fdm.parse(open(sys.argv[1], "rb").read())
    for name in fdm.variables():
        print(name, fdm.get(name))
    raise SystemExit

phi, theta = 0.25, -0.125
p, q, r = 0.5, -0.25, 0.125
v, alpha, beta = 18.288 / FOOT, 0.0625, -0.03125
turn = q * math.sin(phi) + r * math.cos(phi)
travel = math.radians(35.0)
for name, value in {
    "longitude": math.radians(-7.8631), "latitude": math.radians(43.4417), "altitude": 400.0, "agl": 60.0,
    "phi": phi, "theta": theta, "psi": 1.5, "alpha": alpha, "beta": beta,
    "phidot": p + turn * math.tan(theta), "thetadot": q * math.cos(phi) - r * math.sin(phi),
    "psidot": turn / math.cos(theta), "vcas": 18.288 * 3600 / 1852, "climb_rate": -10.0,
    "v_north": 50.0, "v_east": -20.0, "v_down": 10.0,
    "v_wind_body_north": v * math.cos(alpha) * math.cos(beta), "v_wind_body_east": v * math.sin(beta),
    "v_wind_body_down": v * math.sin(alpha) * math.cos(beta),
    "A_X_pilot": 1.0, "A_Y_pilot": -2.0, "A_Z_pilot": -32.0, "stall_warning": 1.0,
    "slip_deg": math.degrees(beta), "num_engines": 1, "eng_state": 2, "num_tanks": 0, "num_wheels": 1,
    "wow": 0, "cur_time": 1700000000, "visibility": 30000.0,
    "elevator": 0.1 / travel, "left_aileron": -0.2 / travel, "right_aileron": 0.2 / travel,
}.items():
    fdm.set(name, value)
with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "flightgear.hex"), "w") as out:
    out.write(fdm.pack().hex() + "\n")
