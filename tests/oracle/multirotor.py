"""Reference flights of the quadrotor: its published parameters integrated by SciPy.

    pip install scipy==1.17.1 numpy
    python3 tests/oracle/multirotor.py

writes, beside itself, multirotor_inputs.csv (rotor commands as shares of the highest speed and wind, held from the time
given) and multirotor_flight.csv (the state every 0.25 s). Attitude by Euler angles and rotor speeds as states of their
own, DOP853 with a relative tolerance of 1e-9, restarted at every change of the inputs. Parameters are read from
aircraft/quad.toml.
"""
import csv
import math
import os
import tomllib

import numpy as np
from scipy.integrate import solve_ivp

HERE = os.path.dirname(os.path.abspath(__file__))
with open(os.path.join(HERE, "../../aircraft/quad.toml"), "rb") as file:
    QUAD = tomllib.load(file)
RHO, G = 1.225, 9.80665
M = QUAD["body"]["mass_kg"]
INERTIA = np.array([QUAD["body"][k] for k in ("ixx_kg_m2", "iyy_kg_m2", "izz_kg_m2")])
R = QUAD["rotors"]
D = R["diameter_m"]
# Front right, back left, front left, back right; the first two turn counter-clockwise.
SIDES = [(1, 1, 1), (-1, -1, 1), (1, -1, -1), (-1, 1, -1)]


def rotation(roll, pitch, yaw):
    cr, sr, cp, sp, cy, sy = (
        f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin)
    )
    return np.array(
        [
            [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
            [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
            [-sp, sr * cp, cr * cp],
        ]
    )


def coefficient(poly, j):
    return poly[0] + poly[1] * j + poly[2] * j * abs(j)


def slope(_, s, command, wind):
    vel, (roll, pitch, yaw), rate, speed = s[3:6], s[6:9], s[9:12], s[12:16]
    to_ned = rotation(roll, pitch, yaw)
    flow = to_ned.T @ (vel - wind)
    force = -0.5 * RHO * np.linalg.norm(flow) * np.array(QUAD["drag"]["area_m2"]) * flow
    moment = np.zeros(3)
    for (fore, side, turn), omega in zip(SIDES, speed):
        place = np.array([fore * R["forward_m"], side * R["right_m"], -R["above_m"]])
        here = flow + np.cross(rate, place)
        n = omega / (2 * math.pi)
        j = -here[2] / (n * D)
        thrust = RHO * n**2 * D**4 * coefficient(R["thrust"], j)
        torque = RHO * n**2 * D**5 * coefficient(R["power"], j) / (2 * math.pi)
        drag = -R["drag_n_s2_rad_m"] * omega * here
        at_hub = np.array([drag[0], drag[1], -thrust])
        force = force + at_hub
        moment += np.cross(place, at_hub) + np.array([0.0, 0.0, turn * torque])
    acc = to_ned @ force / M + np.array([0.0, 0.0, G])
    p, q, r = rate
    angles = np.array(
        [
            p + (q * math.sin(roll) + r * math.cos(roll)) * math.tan(pitch),
            q * math.cos(roll) - r * math.sin(roll),
            (q * math.sin(roll) + r * math.cos(roll)) / math.cos(pitch),
        ]
    )
    spin = (moment - np.cross(rate, INERTIA * rate)) / INERTIA
    wanted = np.array(command) * R["max_rad_s"]
    lag = np.where(wanted > speed, R["lag_up_s"], R["lag_down_s"])
    return np.concatenate([vel, acc, angles, spin, (wanted - speed) / lag])


HOVER = math.sqrt(M * G / (4 * RHO * D**4 * R["thrust"][0])) * 2 * math.pi / R["max_rad_s"]
CALM, WIND = (0.0, 0.0, 0.0), (-6.0, 5.0, 0.0)


def each(a=0.0, b=0.0, c=0.0, d=0.0):
    return tuple(HOVER + x for x in (a, b, c, d))


CASES = {
    "climb": [(0.0, each(0.03, 0.03, 0.03, 0.03), CALM)],
    "descent": [(0.0, each(-0.02, -0.02, -0.02, -0.02), CALM)],
    "roll": [
        (0.2, each(-0.01, 0.01, 0.01, -0.01), CALM),
        (0.4, each(0.01, -0.01, -0.01, 0.01), CALM),
        (0.6, each(), CALM),
    ],
    "pitch in wind": [
        (0.2, each(-0.01, 0.01, -0.01, 0.01), WIND),
        (0.45, each(0.01, -0.01, 0.01, -0.01), WIND),
        (0.6, each(), WIND),
    ],
    "yaw": [(0.2, each(0.02, 0.02, -0.02, -0.02), CALM), (1.2, each(), CALM)],
    "gust": [(0.5, each(), WIND), (2.0, each(), CALM)],
}
END, STEP = 4.0, 0.25


def fly(inputs):
    state = np.concatenate([np.zeros(12), np.full(4, HOVER * R["max_rad_s"])])
    state[2] = -100.0
    changes = [(0.0, each(), CALM)] + inputs + [(END, None, None)]
    rows = []
    for (start, command, wind), (end, _, _) in zip(changes, changes[1:]):
        if end <= start:
            continue
        times = [k * STEP for k in range(1, int(END / STEP) + 1) if start < k * STEP <= end + 1e-9]
        solved = solve_ivp(
            slope, (start, end), state, "DOP853", times + ([end] if end not in times else []),
            args=(command, np.array(wind)), rtol=1e-9, atol=1e-10,
        )
        state = solved.y[:, -1]
        for at, s in zip(solved.t, solved.y.T):
            if any(abs(at - t) < 1e-9 for t in times):
                rows.append([at, s[0], s[1], -s[2], *s[3:6], *np.degrees(s[6:9])])
    return rows


with open(os.path.join(HERE, "multirotor_inputs.csv"), "w", newline="") as file:
    out = csv.writer(file)
    out.writerow("case,time_s,front_right,back_left,front_left,back_right,wind_n,wind_e,wind_d".split(","))
    for name, inputs in CASES.items():
        for at, command, wind in [(0.0, each(), CALM)] + inputs:
            out.writerow([name, at, *(f"{c:.12g}" for c in command), *wind])
with open(os.path.join(HERE, "multirotor_flight.csv"), "w", newline="") as file:
    out = csv.writer(file)
    out.writerow("case,time_s,north_m,east_m,alt_m,vn,ve,vd,roll_deg,pitch_deg,yaw_deg".split(","))
    for name, inputs in CASES.items():
        for row in fly(inputs):
            out.writerow([name, *(f"{value:.9g}" for value in row)])
