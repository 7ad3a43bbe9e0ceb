"""Fly many missions of one scenario, with local threads or the workers of a Dask cluster.

Missions, shards, resumed folders and tables are those of ``plumage campaign``: each can resume a folder of the other,
and ``plumage campaign merge`` or :func:`merge` combines shards.

>>> from dask.distributed import Client                                    # doctest: +SKIP
>>> result = campaign("scenarios/as-pontes.toml", seeds=range(1, 101), strategies=["cs-ea", "posterior"],
...                   out="out/campaign", client=Client("tcp://scheduler:8786"))   # doctest: +SKIP
>>> print(result.table)                                                    # doctest: +SKIP

The same from a shell: ``python -m plumage.campaign SCENARIO --seeds 1..100 --dask tcp://scheduler:8786 --out out/campaign``.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import functools
import os
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from . import _plumage
from ._scenario import ScenarioLike, scenario_of

if TYPE_CHECKING:
    import pandas
    from distributed import Client

__all__ = ["CampaignResult", "campaign", "merge"]


@dataclass(frozen=True)
class CampaignResult:
    """Results of the missions of a campaign."""

    #: The table, as Markdown: that of ``campaign.md``.
    table: str
    #: One row a mission, as Parquet: that of ``missions.parquet``.
    parquet: bytes
    #: The same as CSV.
    csv: bytes

    def to_pandas(self) -> pandas.DataFrame:
        """Return the missions as a DataFrame, one per row; needs pandas and pyarrow."""
        import io

        import pandas

        return pandas.read_parquet(io.BytesIO(self.parquet))


def campaign(
    scenario: ScenarioLike,
    *,
    seeds: int | Iterable[int] = 20,
    strategies: Iterable[str] = (),
    realities: Iterable[str | os.PathLike[str]] = (),
    vehicles: Iterable[int] = (),
    stand_ins: int | None = None,
    duration_s: float | None = None,
    gas: str | None = None,
    shard: str = "1/1",
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    client: Client | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> CampaignResult:
    """Fly every combination of strategies, realities, team sizes and seeds.

    seeds: a number of seeds, counted from 1, or the seeds themselves.
    strategies, realities, vehicles: the scenario's by default; docs/campaign.md lists the realities.
    stand_ins: number of vehicles, the last of the team, that are stand-ins for real ones.
    shard: "k/n" flies only every n-th mission, starting with the k-th.
    out: folder for missions and tables; an unfinished campaign in it is resumed.
    force: write into a folder that holds other files.
    client: Dask client; its workers need the same version of this package. By default local threads use all processors.
    progress: called with the number of finished missions and of all missions.
    """
    known = scenario_of(scenario).changed(duration_s=duration_s, gas=gas)
    ready = _plumage.Campaign(
        known,
        list(range(1, seeds + 1)) if isinstance(seeds, int) else list(seeds),
        list(strategies),
        [os.fspath(reality) for reality in realities],
        list(vehicles),
        stand_ins,
    )
    for warning in ready.check():
        warnings.warn(f"before take-off: {warning}", stacklevel=2)
    missions = ready.missions(shard)
    kept = None if out is None else _plumage.Kept(os.fspath(out), ready, shard, force)
    rows = {} if kept is None else dict(kept.there())
    missing = [mission for mission in missions if mission not in rows]
    flown = _by_threads(ready, missing) if client is None else _by_workers(ready, missing, client)
    for mission, row in flown:
        rows[mission] = row
        if kept is not None:
            kept.add(row)
        if progress is not None:
            progress(len(rows), len(missions))
    tables = ready.tables(list(rows.values()))
    if kept is not None:
        kept.finish(tables)
    return _result(tables)


def merge(folders: Iterable[str | os.PathLike[str]]) -> CampaignResult:
    """Merge the shards of a campaign; ``plumage campaign merge`` also writes the result to a folder."""
    return _result(_plumage.merged_tables([os.fspath(folder) for folder in folders]))


def _result(tables: list[tuple[str, bytes]]) -> CampaignResult:
    named: dict[str, Any] = {name: bytes(text) for name, text in tables}
    return CampaignResult(
        table=named["campaign.md"].decode(),
        parquet=named["missions.parquet"],
        csv=named["missions.csv"],
    )


def _by_threads(ready: _plumage.Campaign, missions: list[str]) -> Iterator[tuple[str, str]]:
    pool = concurrent.futures.ThreadPoolExecutor(os.cpu_count())
    try:
        futures = {pool.submit(ready.fly, mission): mission for mission in missions}
        for future in concurrent.futures.as_completed(futures):
            yield futures[future], future.result()
    finally:
        # After an interrupt the missions under way are waited for, and no other begun.
        pool.shutdown(cancel_futures=True)


def _by_workers(
    ready: _plumage.Campaign, missions: list[str], client: Client
) -> Iterator[tuple[str, str]]:
    from distributed import as_completed

    files = tuple(sorted(ready.files().items()))
    asked = client.scatter((ready.question(), files), broadcast=True)
    # The same mission flown again is wanted again: nothing is remembered by what it is called with.
    futures = [client.submit(_fly, asked, mission, pure=False) for mission in missions]
    try:
        for _, flown in as_completed(futures, with_results=True):
            yield flown
    finally:
        client.cancel(futures)


def _fly(asked: tuple[str, tuple[tuple[str, bytes], ...]], mission: str) -> tuple[str, str]:
    """Fly one mission on a worker."""
    return mission, _ready(*asked).fly(mission)


@functools.lru_cache(maxsize=4)
def _ready(question: str, files: tuple[tuple[str, bytes], ...]) -> _plumage.Campaign:
    """Return the missions of a campaign, which a worker reads once."""
    return _plumage.Campaign.of_question(question, dict(files))


def _seeds(text: str) -> list[int]:
    """Return seeds as ``plumage campaign`` reads them: a number of seeds, FIRST..LAST, or a list."""
    first, dots, last = text.partition("..")
    try:
        if dots:
            seeds = list(range(int(first), int(last) + 1))
        elif "," in text:
            seeds = [int(seed) for seed in text.split(",")]
        else:
            seeds = list(range(1, int(text) + 1))
    except ValueError:
        seeds = []
    if not seeds or min(seeds) < 0:
        raise argparse.ArgumentTypeError(f"{text}: expected a number of seeds, or seeds such as 5..12 or 1,4,9")
    return seeds


def _names(text: str) -> list[str]:
    return text.split(",")


def _numbers(text: str) -> list[int]:
    return [int(number) for number in text.split(",")]


def main(arguments: Sequence[str] | None = None) -> None:
    """Fly a campaign on a Dask cluster, or with local threads."""
    parser = argparse.ArgumentParser(prog="python -m plumage.campaign", description=main.__doc__)
    parser.add_argument("scenario", help="scenario file")
    parser.add_argument("--out", required=True, help="folder for missions and tables; an unfinished campaign in it is resumed")
    parser.add_argument("--dask", metavar="ADDRESS", help="scheduler, such as tcp://host:8786; default: local threads")
    parser.add_argument("--seeds", type=_seeds, default=_seeds("20"), help="number of seeds, FIRST..LAST or a list (default: 20)")
    parser.add_argument("--strategies", type=_names, default=[], help="search strategies, separated by commas")
    parser.add_argument("--realities", type=_names, default=[], help="realities, separated by commas")
    parser.add_argument("--vehicles", type=_numbers, default=[], help="sizes of the team, separated by commas")
    parser.add_argument("--gas", help="gas that the sensors measure")
    parser.add_argument("--duration", type=float, metavar="S", help="duration of each mission, s")
    parser.add_argument("--shard", default="1/1", metavar="K/N", help="fly only every N-th mission, from the K-th on")
    parser.add_argument("--force", action="store_true", help="write into a folder that holds other files")
    asked = parser.parse_args(arguments)
    client = None
    if asked.dask is not None:
        from distributed import Client

        client = Client(asked.dask)
    try:
        result = campaign(
            asked.scenario,
            seeds=asked.seeds,
            strategies=asked.strategies,
            realities=asked.realities,
            vehicles=asked.vehicles,
            gas=asked.gas,
            duration_s=asked.duration,
            shard=asked.shard,
            out=asked.out,
            force=asked.force,
            client=client,
            progress=lambda done, of: print(f"flown: {done} of {of}", file=sys.stderr),
        )
    except _plumage.InputError as error:
        parser.error(str(error))
    finally:
        if client is not None:
            client.close()
    print(result.table)


if __name__ == "__main__":
    main()
