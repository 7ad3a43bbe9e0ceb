"""What crossings of a displaced plume tell: expected values of crates/sc/tests/information.rs.

python3 with NumPy. E[A_i A_j] by Gauss-Hermite quadrature over correlated displacements, then P^-1 + G' N^-1 G.
"""
import numpy as np

NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(80)
WEIGHTS = WEIGHTS / WEIGHTS.sum()
SHARE, HEIGHT_M, WIND_M_S, C_MAX_M, PEAK_M, NOISE = 0.5, 880.0, 8.0, 2400.0, 1155.0, 0.01
RATIO = SHARE / (1 - SHARE)


def sigma_z_m(x):
    return 0.06 * x / np.sqrt(1 + 0.0015 * x)


def read(zeta, n):
    return np.exp(-((zeta + n) ** 2) / 2)


def mean(zeta):
    return (WEIGHTS * read(zeta, np.sqrt(RATIO) * NODES)).sum()


def mean_of_product(a, b, rho):
    first = np.sqrt(RATIO) * NODES[:, None]
    second = np.sqrt(RATIO) * (rho * NODES[:, None] + np.sqrt(1 - rho**2) * NODES[None, :])
    return (WEIGHTS[:, None] * WEIGHTS[None, :] * read(a, first) * read(b, second)).sum()


def correlation(a, b):
    travel_a, travel_b = a[1] / WIND_M_S, b[1] / WIND_M_S
    shared = min(a[0], b[0]) - max(a[0] - travel_a, b[0] - travel_b)
    return max(0.0, shared) / np.sqrt(travel_a * travel_b)


def precision(crossings):
    count = len(crossings)
    zeta = [(z - HEIGHT_M) / (sigma_z_m(x) * np.sqrt(1 - SHARE)) for _, x, z in crossings]
    noise = np.zeros((count, count))
    for i in range(count):
        for j in range(count):
            both = mean_of_product(zeta[i], zeta[j], correlation(crossings[i], crossings[j]))
            noise[i, j] = both / mean(zeta[i]) / mean(zeta[j]) - 1
        noise[i, i] += 0.2**2 + (NOISE * np.exp((1 - SHARE) * zeta[i] ** 2 / 2)) ** 2
    information = np.diag(1 / np.array([0.3, 50, 0.3, 0.2]) ** 2)
    if count:
        rows = [(z - HEIGHT_M, sigma_z_m(x), np.log(C_MAX_M / x)) for _, x, z in crossings]
        gradient = np.array([[1, d / s**2, (d / s) ** 2, p] for d, s, p in rows])
        information = information + gradient.T @ np.linalg.solve(noise, gradient)
    covariance = np.linalg.inv(information)
    nearer = np.log(C_MAX_M / PEAK_M)
    asked = {
        "peak": [1, 0, 0, nearer],
        "flux": [1, 0, 1, nearer],
        "c_max": [1, 0, 0, 0],
        "height_m": [0, 1, 0, 0],
        "sigma_z": [0, 0, 1, 0],
    }
    return {k: round(float(np.sqrt(np.array(v) @ covariance @ np.array(v))), 6) for k, v in asked.items()}


print(precision([]))
print(precision([(0, 2400, 880)]))
print(precision([(0, 1155, 880), (40, 1155, 910), (90, 1300, 850), (400, 2400, 880)]))
