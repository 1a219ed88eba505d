"""Strategies that are compared on the same data sets."""

import numpy as np
import pandas as pd
import pytest
from made_audits import CONFIGURATION, ROBOT, failed

from elastocal.audit import tables
from elastocal.audit.audited import Audited
from elastocal.audit.rankings import scored, strategy_pairs, strategy_scores

STRATEGIES = {
    key: {"name": f"{key} alone", "stages": [{"points": ["hand"], "joints": [1, 2]}]} for key in ("hand", "arm", "same")
}
USES = ("mean", "mean_square", "p95", "pooled_p95", "pooled_p95_influence", "iso_9283", "path_mean_square", "path_max")


@pytest.fixture
def run(tmp_path):
    """Three strategies, of which the third is the first under another name."""
    for folder in ("uses", "metrics/two/100um", "replicates/two/100um"):
        (tmp_path / "results" / folder).mkdir(parents=True)
    (tmp_path / "reports/tables").mkdir(parents=True)
    parts = []
    for key in STRATEGIES:
        rng = np.random.default_rng(1 if key != "arm" else 2)
        scale = 1.5 if key == "arm" else 1.0
        part = pd.DataFrame(scale * rng.uniform(1, 2, (9, len(USES))), columns=USES)
        part["pooled_p95"], part["iso_9283"] = scale, np.nan
        parts.append(part.assign(strategy=STRATEGIES[key]["name"], data_set=np.arange(9)))
        at = {"length": [5], "k_sigma": [-scale], "k_sigma_fixed_joints": [scale], "deviation": [1e-6 * scale]}
        pd.DataFrame(at).to_parquet(tmp_path / f"results/metrics/two/100um/{key}.parquet")
        drawn = {name: values[0] * rng.uniform(0.9, 1.1, 10) for name, values in at.items() if name != "length"}
        drawn |= {"length": np.full(10, 5), "replicate": np.arange(1, 11)}
        pd.DataFrame(drawn).to_parquet(tmp_path / f"results/replicates/two/100um/{key}.parquet")
    pd.concat(parts).to_parquet(tmp_path / "results/uses/two.parquet")
    settings = CONFIGURATION | {"tables": CONFIGURATION["tables"] | {"classical_strategy": "hand"}}
    return Audited(tmp_path, settings, {"two": ROBOT}, STRATEGIES, 4)


def test_one_estimator_under_two_names_has_one_rank_and_is_no_pair(run):
    table = strategy_scores(run).query("metric == 'rms_um'").set_index("strategy")
    assert table["rank"].to_dict() == {"hand alone": 1, "arm alone": 3, "same alone": 1}
    assert table.loc["same alone", ["ratio", "ratio_low", "ratio_high"]].tolist() == [1, 1, 1]
    pairs = strategy_pairs(run)
    assert set(zip(pairs["strategy"], pairs["other"], strict=True)) == {("hand alone", "arm alone")}


def test_a_place_out_of_reach_has_no_score(run):
    assert "iso_9283_um" not in scored(run, "two")


def test_a_metric_that_ranks_the_other_way_round_is_reversed(run):
    """The mean of the second strategy far below, its RMS error above."""
    path = run.folder / "results/uses/two.parquet"
    uses = pd.read_parquet(path)
    uses.loc[uses["strategy"] == "arm alone", "mean"] *= 0.1
    uses.to_parquet(path)
    reversed_ = strategy_pairs(run).set_index("metric")["reversed"]
    assert reversed_["mean_um"]
    assert not reversed_["p95_um"]


@pytest.mark.parametrize(("column", "value"), [("ratio_low", 0.5), ("reversed", True), ("other", "somebody else")])
def test_a_cell_of_the_pairs_that_does_not_follow_is_found(run, column, value):
    file = "reports/tables/strategy_pairs.csv"
    pairs = strategy_pairs(run)
    pairs.to_csv(run.folder / file, index=False)
    assert failed(tables.table(run, file, "strategy_pairs")) == []
    pairs.loc[1, column] = value
    pairs.to_csv(run.folder / file, index=False)
    run.table.cache_clear()
    assert failed(tables.table(run, file, "strategy_pairs")) == ["rows" if column == "other" else f"column {column}"]
