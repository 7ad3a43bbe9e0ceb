"""Campaigns: the same as the command's, by threads, by a Dask cluster, resumed and in parts."""

from __future__ import annotations

import pytest
from conftest import AS_PONTES, said

import plumage
from plumage.campaign import campaign, main, merge

ASKED = {"seeds": 2, "strategies": ["cs-ea", "lawnmower"], "duration_s": 60}
OPTIONS = ("--seeds", 2, "--strategies", "cs-ea,lawnmower", "--duration", 60)


@pytest.fixture(scope="module")
def whole() -> plumage.campaign.CampaignResult:
    return campaign(AS_PONTES, **ASKED)


def test_the_table_is_the_commands(whole, command, tmp_path):
    out = tmp_path / "out"
    said(command, "campaign", AS_PONTES, *OPTIONS, "--out", out)
    assert whole.table == (out / "campaign.md").read_text()
    assert whole.parquet == (out / "missions.parquet").read_bytes()
    assert whole.csv == (out / "missions.csv").read_bytes()
    frame = whole.to_pandas()
    assert list(zip(frame["strategy"], frame["seed"])) == [("cs-ea", 1), ("cs-ea", 2), ("lawnmower", 1), ("lawnmower", 2)]


def test_what_was_begun_goes_on_and_the_command_finds_it_done(whole, command, tmp_path):
    out, told = tmp_path / "out", []

    def enough(there, of):
        told.append((there, of))
        if there == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        campaign(AS_PONTES, **ASKED, out=out, progress=enough)
    again = []
    done = campaign(AS_PONTES, **ASKED, out=out, progress=lambda there, of: again.append((there, of)))
    assert told == [(1, 4), (2, 4)] and again == [(3, 4), (4, 4)]
    assert done == whole
    assert "4 of 4 missions are done already" in said(command, "campaign", AS_PONTES, *OPTIONS, "--out", out).stderr
    with pytest.raises(plumage.InputError, match="differs in the seeds"):
        campaign(AS_PONTES, **ASKED | {"seeds": 3}, out=out)


def test_parts_make_the_whole(whole, tmp_path):
    folders = [tmp_path / part for part in ("a", "b")]
    campaign(AS_PONTES, **ASKED, shard="1/2", out=folders[0])
    with pytest.raises(plumage.InputError, match="2 of 4 missions are missing"):
        merge(folders[:1])
    campaign(AS_PONTES, **ASKED, shard="2/2", out=folders[1])
    assert merge(folders) == whole
    for wrong in ("3/2", "x"):
        with pytest.raises(plumage.InputError, match="expected k/n"):
            campaign(AS_PONTES, **ASKED, shard=wrong)


def test_a_cluster_flies_the_same(whole, tmp_path, capsys):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    ) as cluster, distributed.Client(cluster) as client:
        assert campaign(AS_PONTES, **ASKED, client=client) == whole
        options = ["--seeds", "1..2", "--strategies", "cs-ea,lawnmower", "--duration", "60"]
        out = tmp_path / "out"
        main([str(AS_PONTES), *options, "--dask", cluster.scheduler_address, "--out", str(out)])
        assert capsys.readouterr().out.strip() == whole.table.strip()
        assert whole.parquet == (out / "missions.parquet").read_bytes()


@pytest.mark.parametrize("seeds", ["a..b", "0", "5..4", "-1..2", "1,x"])
def test_seeds_that_are_none_are_refused(seeds, capsys):
    with pytest.raises(SystemExit):
        main(["s.toml", "--out", "x", f"--seeds={seeds}"])
    assert f"{seeds}: expected a number of seeds, or seeds such as 5..12 or 1,4,9" in capsys.readouterr().err


def test_wrong_input_ends_with_its_message(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main([str(tmp_path / "none.toml"), "--out", str(tmp_path / "out"), "--strategies", "cs-ea"])
    assert ended.value.code == 2
    assert "none.toml" in capsys.readouterr().err
