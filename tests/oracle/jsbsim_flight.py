"""Reference flights by JSBSim with our coefficients.

    pip install jsbsim==1.3.3 scipy numpy
    python3 tests/oracle/jsbsim_flight.py

writes, beside itself, jsbsim_trim.csv (steady flight found on JSBSim's accelerations),
jsbsim_inputs.csv (controls and wind, held from the time given) and jsbsim_flight.csv (the state
every 0.5 s, glides every 5 s). JSBSim runs at 0.25 ms with third-order Adams-Bashforth.
"""
import csv
import math
import os
import tempfile

from scipy.optimize import fsolve

import jsbsim_aircraft as j

HERE = os.path.dirname(os.path.abspath(__file__))
RHO = 1.225
DT = 0.00025
TICK = 0.01


def trim(fdm, speed):
    def residual(x):
        j.start(fdm, speed, x[0], x[0], 0.0, (x[1], 0.0, 0.0, x[2]))
        return [
            fdm["accelerations/udot-ft_sec2"],
            fdm["accelerations/wdot-ft_sec2"],
            fdm["accelerations/qdot-rad_sec2"],
        ]

    x, info, found, message = fsolve(residual, [0.05, 0.0, 0.8], xtol=1e-13, full_output=True)
    if max(abs(r) for r in residual(x)) > 1e-7:
        raise SystemExit(f"no trim at {speed} m/s: {message}")
    return x


def pulse(base, index, size, start, length, opposite=True):
    """Changes of the controls: a doublet (or a single pulse) on one of them."""
    up, down = list(base), list(base)
    up[index] += size
    down[index] -= size
    calm = (0.0, 0.0, 0.0)
    out = [(0.0, tuple(base), calm), (start, tuple(up), calm), (start + length, tuple(base), calm)]
    if opposite:
        out[2:] = [(start + length, tuple(down), calm), (start + 2 * length, tuple(base), calm)]
    return out


def cases(base, rudder):
    calm = (0.0, 0.0, 0.0)
    step = list(base)
    step[3] += 0.15
    glide = list(base)
    glide[3] = 0.0
    gust = [
        (0.5 + 0.1 * k, tuple(base), tuple(0.5 * (1 - math.cos(math.pi * k / 10)) * g for g in (-2.0, 3.0, -1.5)))
        for k in range(21)
    ]
    yield "level", [(0.0, tuple(base), calm)], 10.0
    yield "elevator", pulse(base, 0, math.radians(3), 0.5, 0.4), 10.0
    yield "aileron", pulse(base, 1, math.radians(4), 0.5, 0.6), 10.0
    if rudder:
        yield "rudder", pulse(base, 2, math.radians(5), 0.5, 0.6), 10.0
    yield "throttle", [(0.0, tuple(base), calm), (1.0, tuple(step), calm)], 10.0
    yield "gust", [(0.0, tuple(base), calm)] + gust, 10.0
    yield "glide", [(0.0, tuple(glide), calm)], 60.0


def fly(fdm, speed, x, changes, duration):
    j.start(fdm, speed, x[0], x[0], 0.0, changes[0][1])
    every = 0.5 if duration <= 10 else 5.0
    pending = list(changes)
    rows = []
    for tick in range(round(duration / TICK) + 1):
        t = tick * TICK
        if tick % round(every / TICK) == 0:
            rows.append(
                (
                    t,
                    fdm["position/lat-gc-rad"] * (j.RADIUS_M + 400.0),
                    fdm["position/long-gc-rad"] * (j.RADIUS_M + 400.0),
                    fdm["position/h-sl-ft"] * j.FT,
                    *(math.degrees(fdm[f"attitude/{n}-rad"]) for n in ("phi", "theta", "psi")),
                    fdm["velocities/vt-fps"] * j.FT,
                )
            )
        while pending and pending[0][0] <= t + 1e-9:
            _, surfaces, wind = pending.pop(0)
            j.controls(fdm, surfaces)
            j.wind_at(fdm, wind)
        for _ in range(round(TICK / DT)):
            fdm.run()
    return rows


def main():
    trims, inputs, flights = [], [], []
    root = tempfile.mkdtemp()
    for name, speeds, rudder in (("x8", (14, 16, 18, 20, 22), False), ("ultrastick-25e", (16, 18, 20), True)):
        fdm = j.load(root, os.path.join(HERE, "..", "..", "aircraft", name + ".toml"), DT, RHO)
        for speed in speeds:
            x = trim(fdm, speed)
            trims.append((name, speed, *(f"{v:.12f}" for v in x)))
            base = (x[1], 0.0, 0.0, x[2])
            for case, changes, duration in cases(base, rudder):
                if speed != 18 and case != "level":
                    continue
                for t, surfaces, wind in changes:
                    inputs.append((name, speed, case, f"{t:.2f}", *(f"{v:.12f}" for v in surfaces + wind)))
                for row in fly(fdm, speed, x, changes, duration):
                    flights.append((name, speed, case, f"{row[0]:.2f}", *(f"{v:.5f}" for v in row[1:])))
                print(name, speed, case, flights[-1])

    def save(file, header, rows):
        with open(os.path.join(HERE, file), "w", newline="") as out:
            writer = csv.writer(out, lineterminator="\n")
            writer.writerow(header.split())
            writer.writerows(rows)

    save("jsbsim_trim.csv", "aircraft airspeed_m_s alpha_rad elevator_rad throttle", trims)
    save(
        "jsbsim_inputs.csv",
        "aircraft airspeed_m_s case time_s elevator_rad aileron_rad rudder_rad throttle"
        " wind_north_m_s wind_east_m_s wind_down_m_s",
        inputs,
    )
    save(
        "jsbsim_flight.csv",
        "aircraft airspeed_m_s case time_s north_m east_m alt_amsl_m roll_deg pitch_deg yaw_deg airspeed_m_s_now",
        flights,
    )


main()
