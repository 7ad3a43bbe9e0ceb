"""Fit the probability that a cause is true to the outcomes of gap-bench, and compare it with the rules in use.

Make the outcomes with both generators, then fit (needs numpy):

    gap-bench --quick 2400 --first-seed 40000000 --outcomes plume.jsonl
    gap-bench --quick 2400 --first-seed 50000000 --generator puffs --outcomes puffs.jsonl
    python fit_probability.py plume.jsonl puffs.jsonl

Coefficients for the finder need about 3,000 cases: with fewer the bin above .95 holds too few to be told from .9.
One row per cause of every set that the finder judged. The map is a logistic regression with a ridge penalty, which
cross-validation by case chooses. Every figure is of cases that the fit has not seen: other folds of the same
generator's cases, or the other generator's.
"""

import json
import sys

import numpy as np

FOLDS = 10
PENALTIES = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
BINS = (0.0, 0.5, 0.8, 0.95, 1.0 + 1e-9)
STATED, NAMED = 0.5, 0.95

# As infer::Features::terms gives them.
TERMS = (
    "ln widening",
    "ln departure",
    "other causes of the set",
)
# As the finder bounds what the map says.
MOST_WITHOUT_GAIN = 0.94


def cases_of(path):
    """Cases that were made and answered."""
    with open(path, encoding="utf-8") as lines:
        outcomes = [json.loads(line) for line in lines]
    made = [o for o in outcomes if "task" in o and not o["unreachable"] and o["said"]]
    return made


def table(cases):
    """Terms, truth and case of every cause that was judged."""
    rows = [
        (cause["terms"], cause["is_true"], k)
        for k, case in enumerate(cases)
        for causes in case["considered"]
        for cause in causes
    ]
    if not rows:
        raise SystemExit("no cause was judged in these outcomes; expected some hundred cases")
    x, y, of = (np.array(column, float) for column in zip(*rows))
    return x, y, of.astype(int)


class Map:
    """Logistic regression on standardised terms, by Newton steps."""

    def __init__(self, x, y, of, penalty):
        self.mean, self.sd = x.mean(0), x.std(0) + 1e-9
        # The causes of one case tell less than as many of different cases.
        weight = np.bincount(of)[of] ** -0.5
        z = self._columns(x)
        ridge = penalty * np.eye(z.shape[1])
        ridge[0, 0] = 1e-6
        self.at = np.zeros(z.shape[1])
        for _ in range(50):
            p = 1.0 / (1.0 + np.exp(-z @ self.at))
            information = (z * (weight * p * (1.0 - p))[:, None]).T @ z + ridge
            step = np.linalg.solve(information, z.T @ (weight * (y - p)) - ridge @ self.at)
            self.at += step
            if abs(step).max() < 1e-9:
                break

    def _columns(self, x):
        return np.c_[np.ones(len(x)), (x - self.mean) / self.sd]

    def __call__(self, x):
        return 1.0 / (1.0 + np.exp(-self._columns(x) @ self.at))

    def raw(self):
        """Constant and coefficients on terms that are not standardised."""
        slopes = self.at[1:] / self.sd
        return self.at[0] - slopes @ self.mean, slopes


def held_out(x, y, of, penalty):
    """Probability of each cause by the other folds of cases."""
    fold = np.random.default_rng(1).permutation(of.max() + 1) % FOLDS
    fold = fold[of]
    p = np.zeros(len(y))
    for k in range(FOLDS):
        own = fold == k
        if own.any():
            p[own] = Map(x[~own], y[~own], of[~own], penalty)(x[own])
    return p


def log_loss(p, y):
    p = np.clip(p, 1e-4, 1.0 - 1e-4)
    return -np.mean(y * np.log(p) + (1.0 - y) * np.log(1.0 - p))


def chosen(x, y, of):
    return min(PENALTIES, key=lambda penalty: log_loss(held_out(x, y, of, penalty), y))


def reliability(what, p, y):
    print(f"  {what}: log loss {log_loss(p, y):.3f}")
    for low, high in zip(BINS, BINS[1:]):
        own = (p >= low) & (p < high)
        if own.any():
            n = own.sum()
            stated, true = p[own].mean(), y[own].mean()
            hits = int(y[own].sum())
            print(f"    [{low:.2f}, {min(high, 1.0):.2f}): stated {stated:.3f}, true {true:.3f} ({hits}/{n})")


def bounded(p, cause):
    """A probability of the map as the finder states it."""
    most = 1.0 if cause["left_out_low"] > 0.0 else MOST_WITHOUT_GAIN
    return min(p, cause["by_evidence"], most)


def standing(case, probabilities):
    """The first set judged all of whose causes reach STATED, with their probabilities; the base has none."""
    for causes in case["considered"]:
        own = [bounded(next(probabilities), c) for c in causes]
        if all(p >= STATED for p in own):
            return list(zip(causes, own))
    return []


def by_rules(case):
    """What the finder stated: the last set that it judged."""
    last = case["considered"][-1] if case["considered"] else []
    names = [c["mechanisms"] for c in case["said"]["causes"]]
    return [(c, c["probability"]) for c in last if c["mechanisms"] in names]


def figures(what, cases, stated):
    """Rates of cases by what is stated in each."""
    def rate(name, picked, hit):
        own = [(c, s) for c, s in zip(cases, stated) if picked(c)]
        print(f"    {name}: {sum(hit(c, s) for c, s in own)} of {len(own)}")

    def nats(case):
        return min((h["nats"] for h in case["truth"]), default=0.0)

    def nothing(case):
        return case["task"]["kind"] == "Nothing"

    def one(case):
        return isinstance(case["task"]["kind"], dict) and "One" in case["task"]["kind"]

    def alone(_, s):
        return any(c["is_true"] and len(c["mechanisms"]) == 1 for c, _ in s)

    def wrong(_, s):
        return any(not c["is_true"] and len(c["mechanisms"]) == 1 and p >= NAMED for c, p in s)

    print(f"  {what}")
    rate("nothing hidden, a cause stated", nothing, lambda _, s: bool(s))
    rate("nothing hidden, a cause named", nothing, lambda _, s: any(p >= NAMED for _, p in s))
    rate("a wrong single name", lambda c: not nothing(c), wrong)
    rate("D 20-60, truth stated", lambda c: one(c) and 20 <= nats(c) < 60, lambda _, s: any(c["is_true"] for c, _ in s))
    rate("D >= 60, truth stated", lambda c: one(c) and nats(c) >= 60, lambda _, s: any(c["is_true"] for c, _ in s))
    rate("D >= 60, alone in its set", lambda c: one(c) and nats(c) >= 60, alone)


def compared(cases, p, of):
    stated = [standing(case, iter(p[of == k])) for k, case in enumerate(cases)]
    figures("rules", cases, [by_rules(case) for case in cases])
    figures("map", cases, stated)


def main(paths):
    sets = {path: cases_of(path) for path in paths}
    tables = {path: table(cases) for path, cases in sets.items()}
    for path, (x, y, of) in tables.items():
        penalty = chosen(x, y, of)
        p = held_out(x, y, of, penalty)
        print(f"{path}: {len(sets[path])} cases, {len(y)} causes judged, {y.mean():.3f} true, penalty {penalty}")
        stated = [c["by_evidence"] for case in sets[path] for causes in case["considered"] for c in causes]
        reliability("probability of the evidence", np.array(stated), y)
        reliability("map, other folds", p, y)
        compared(sets[path], p, of)
        for other in paths:
            if other != path:
                ox, oy, oof = tables[other]
                po = Map(x, y, of, penalty)(ox)
                reliability(f"map, on {other}", po, oy)
                compared(sets[other], po, oof)
    x, y, of = (np.concatenate(parts) for parts in zip(*tables.values()))
    sizes = np.cumsum([0] + [len(c) for c in sets.values()])
    of = np.concatenate([t[2] + start for t, start in zip(tables.values(), sizes)])
    penalty = chosen(x, y, of)
    p = held_out(x, y, of, penalty)
    print(f"all: {sizes[-1]} cases, {len(y)} causes judged, penalty {penalty}")
    reliability("map, other folds", p, y)
    compared([c for cases in sets.values() for c in cases], p, of)
    constant, slopes = Map(x, y, of, penalty).raw()
    print(f"  constant {constant:.3f}")
    for name, slope in zip(TERMS, slopes):
        print(f"  {name}: {slope:.3f}")


if __name__ == "__main__":
    main(sys.argv[1:])
