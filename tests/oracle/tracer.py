"""Methane and acetylene of one plume, read by two analysers whose noise is correlated; the true rate is known.

The plume comes and goes (an intermittent gamma process with a memory of 40 s). Each reading of 1 s has noise: 0.8 of the
plume's standard deviation for acetylene, 0.5 for methane, correlated by 0.6 at the same second, as of a common cell. Both
zeros drift over the hour. Methane also has an independent source upwind with a slow part of 0.15.
Writes tests/oracle/tracer.csv and prints the true rate, the slope of an ordinary regression, which the noise bends, and that
of York et al. (2004, Am. J. Phys. 72:367), which knows the noise. Run: python3 tests/oracle/tracer.py
"""
import numpy as np

SEED, SECONDS = 20261129, 1800
M_CH4, M_C2H2 = 16.043e-3, 26.038e-3
TRACER_KG_S, RATE_KG_S = 0.8e-3, 1.5e-3

rng = np.random.default_rng(SEED)


def memory(n, seconds):
    r, out = np.exp(-1.0 / seconds), np.empty(n)
    out[0] = rng.normal()
    for k in range(1, n):
        out[k] = r * out[k - 1] + np.sqrt(1 - r * r) * rng.normal()
    return out


t = np.arange(SECONDS)
plume = np.clip(memory(SECONDS, 40.0) - 0.2, 0.0, None) ** 1.5
plume /= plume.std()
ratio = RATE_KG_S / TRACER_KG_S * M_C2H2 / M_CH4  # mole of CH4 a mole of C2H2
amplitude = 0.05  # ppm of C2H2 a standard deviation of the plume
noise = rng.multivariate_normal([0, 0], [[1, 0.6], [0.6, 1]], SECONDS)
sd_c2h2, sd_ch4 = 0.8 * amplitude, 0.5 * amplitude * ratio
c2h2 = 0.001 + amplitude * plume + sd_c2h2 * noise[:, 0] + 0.3 * amplitude * t / SECONDS
ch4 = 2.0 + ratio * amplitude * plume + sd_ch4 * noise[:, 1] - 0.5 * amplitude * t / SECONDS
ch4 += 0.15 * amplitude * ratio * memory(SECONDS, 120.0)

with open("tests/oracle/tracer.csv", "w") as out:
    out.write("time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppm,c2h2_ppm\n")
    for row in zip(t, ch4, c2h2):
        out.write("%d,car,45.0,5.0,103.0,%.5f,%.5f\n" % row)


def york(x, y, sx, sy, r):
    b = np.polyfit(x, y, 1)[0]
    wx, wy = 1 / sx**2, 1 / sy**2
    for _ in range(100):
        w = wx * wy / (wx + b * b * wy - 2 * b * r * np.sqrt(wx * wy))
        u, v = x - x.mean(), y - y.mean()
        beta = w * (u / wy + b * v / wx - (b * u + v) * r / np.sqrt(wx * wy))
        b = (beta * v).sum() / (beta * u).sum()
    return b


to_kg_s = TRACER_KG_S * M_CH4 / M_C2H2
print("true rate  %.4e kg/s" % RATE_KG_S)
print("ordinary   %.4e kg/s" % (np.polyfit(c2h2, ch4, 1)[0] * to_kg_s))
print("York       %.4e kg/s" % (york(c2h2, ch4, sd_c2h2, sd_ch4, 0.6) * to_kg_s))
ten = lambda x: x.reshape(-1, 10).mean(1)
print("ordinary, 10 s means %.4e kg/s" % (np.polyfit(ten(c2h2), ten(ch4), 1)[0] * to_kg_s))
