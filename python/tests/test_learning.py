"""The policy of the example against its lawnmower, in scenes that neither has seen."""

from __future__ import annotations

import sys

import pytest
from conftest import CLONE

pytest.importorskip("gymnasium")

sys.path.insert(0, str(CLONE / "python" / "examples"))
import learn_to_search as search


def test_what_was_learned_finds_more_peaks_than_a_lawnmower():
    rows = search.compare(search.Learned.LEARNED, scenes=64, first_seed=9_000_000)
    lawnmower, learned = rows["lawnmower"], rows["learned"]
    # Both keep out of the keep-out and inside the arena: leaving costs 10, and nothing else costs.
    assert lawnmower["reward"] > 5.0 and learned["reward"] > 5.0
    spread = (lawnmower["found_sd"] ** 2 + learned["found_sd"] ** 2) ** 0.5
    assert learned["found"] - lawnmower["found"] > 2.0 * spread
    assert learned["median_s"] < search.DURATION_S
