"""A million places of the plume from NumPy: best and median of 60 runs, ms; `cargo bench -p plume` has the same of Rust."""

import pathlib
import time

import numpy as np

import plumage

SCENARIO = pathlib.Path(__file__).parents[2] / "scenarios" / "as-pontes.toml"


def main() -> None:
    plume = plumage.Plume(SCENARIO)
    rng = np.random.default_rng(1)
    count = 1_000_000
    # As in benches/plume.rs: level after level of a box downwind.
    east_m, north_m = rng.uniform(0.0, 8000.0, count), rng.uniform(-2000.0, 2000.0, count)
    height_agl_m = np.repeat(np.linspace(10.0, 900.0, 10), count // 10)
    out = np.empty(count)
    for name, given in (("into a given array", out), ("a new array each", None)):
        times_ms = []
        for _ in range(60):
            begun = time.perf_counter()
            plume.ppm(east_m, north_m, height_agl_m, out=given)
            times_ms.append(1e3 * (time.perf_counter() - begun))
        times_ms.sort()
        print(f"{name:20} {times_ms[0]:8.3f} {times_ms[30]:8.3f}")


if __name__ == "__main__":
    main()
