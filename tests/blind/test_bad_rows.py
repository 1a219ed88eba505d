"""Campaigns with bad rows beside the same without: what is drawn, and what is said of a case."""

from collections import Counter

import numpy as np
import pytest
from analysed_robots import ROBOTS
from made_proofs import made_slips
from scipy.stats import binomtest

from elastocal.io.storage import read_table, write_table
from elastocal_proof.blind import bad_rows as module
from elastocal_proof.blind import schemas
from elastocal_proof.blind.bad_rows import MIXTURE, SAME, compare_case, draw_campaign, draw_seeds, judge_cases, summarize
from elastocal_proof.plant.bad_rows import BadReading
from elastocal_proof.plant.campaigns import measured_table

KUKA = ROBOTS / "kuka.yaml"


@pytest.fixture(scope="module")
def drawn():
    with pytest.MonkeyPatch.context() as patch:
        # Sizing takes long, and is of no matter here.
        patch.setattr(module, "_faint", lambda *_: ())
        return [draw_campaign(KUKA, seed) for seed in draw_seeds(KUKA, 1, 60)]


def answered(gross=(), verdict="adequate"):
    """A verdict on any folder, by which rows are named."""
    entries = [{"rows": [row]} for row in gross]
    document = {"verdict": verdict, "effects": [], "heldout": {"after": {"rms_m": 1e-4}}, "gross_errors": entries}
    return lambda folder, robots, seed: document


def test_more_cases_change_none_that_is_there_and_another_seed_changes_all():
    few, more = draw_seeds(KUKA, 1, 5), draw_seeds(KUKA, 1, 9)
    assert more[:5] == few and len(set(more)) == 9
    assert not set(few) & set(draw_seeds(KUKA, 2, 5)) and few != draw_seeds(ROBOTS / "abb.yaml", 1, 5)


def test_campaigns_are_of_a_users_size_and_of_every_kind(drawn):
    for made in drawn:
        table, _ = measured_table(made.robot, made.design, made.schedule)
        assert 40 <= len(table["pose"]) <= 200
        assert 20 <= made.design.poses <= 60 and made.design.held_out == round(0.3 * made.design.poses)
    designs = [made.design for made in drawn]
    for seen in (
        {len(design.ladder) for design in designs},
        {len(design.points) for design in designs},
        {design.measured for design in designs},
        {design.frame for design in designs},
        {design.declared_noise is None for design in designs},
        {bool(design.covariates) for design in designs},
    ):
        assert len(seen) == 2


def test_truths_come_as_often_as_the_mixture_says(drawn):
    assert sum(MIXTURE.values()) == pytest.approx(1.0)
    count = Counter(made.kind for made in drawn)
    assert set(count) == set(MIXTURE) - {"one, at 200"}
    assert all(not made.defects for made in drawn if made.kind == "nothing")
    assert all(len(made.defects) > 1 for made in drawn if made.kind in ("joint offsets", "two, large"))


@pytest.mark.slow
def test_a_campaign_that_a_reader_takes_is_diagnosed_and_its_rows_go_to_a_file_and_back(tmp_path):
    seed = draw_seeds(KUKA, 1, 1)[0]
    found = compare_case(KUKA, ROBOTS, seed)
    assert set(found["clean_verdict"]) == {"adequate"} and np.isfinite(found["damaged_heldout_rms_m"]).all()
    write_table(tmp_path / "t.parquet", schemas.BAD_ROWS, [found], {})
    back = read_table(tmp_path / "t.parquet", schemas.BAD_ROWS)
    np.testing.assert_array_equal(back["size"], found["size"])
    assert back["bad_rows"].tolist() == found["bad_rows"].tolist()
    # Its own seed alone decides.
    again = compare_case(KUKA, ROBOTS, seed)
    assert all((np.asarray(again[name]) == np.asarray(found[name])).all() for name in found)


def test_rows_are_named_where_the_verdict_has_them_counted_from_one(monkeypatch):
    seed = draw_seeds(KUKA, 1, 3)[2]
    monkeypatch.setattr(module, "diagnosed", answered())
    silent = compare_case(KUKA, ROBOTS, seed)
    assert not silent["named"].any() and not silent["wrongly_named"].any()
    bad = [int(row) for rows in silent["bad_rows"] for row in rows.split()]
    monkeypatch.setattr(module, "diagnosed", answered(bad))
    told = compare_case(KUKA, ROBOTS, seed)
    assert told["named"].all() and not told["wrongly_named"].any()
    # The stand-in names them in the clean file as well.
    assert set(told["clean_rows_lost"]) == {len(bad)}
    monkeypatch.setattr(module, "diagnosed", answered([row + 1 for row in bad]))
    beside = compare_case(KUKA, ROBOTS, seed)
    assert beside["wrongly_named"][0] > 0 and not beside["named"].all()


def test_of_a_slip_all_rows_that_contradict_the_robot_must_be_named():
    slip = BadReading("joint_angle", (3, 4, 5), (900.0, 50.0, 2.0))
    assert module._is_named(slip, {3, 4}) and not module._is_named(slip, {3, 5})
    small = BadReading("position", (7,), (6.0,))
    assert module._is_named(small, {7}) and not module._is_named(small, set())


@pytest.fixture
def slips():
    return judge_cases({"kuka": made_slips(), "abb": made_slips(seed=5)})


def figure(table, quantity, of):
    (row,) = table[(table["quantity"] == quantity) & (table["of"] == of)].to_dict("records")
    return row


def test_a_case_counts_once_however_many_slips_it_has(slips):
    cases = slips.drop_duplicates(["robot", "seed"])
    row = figure(summarize(slips), SAME, "all cases")
    assert row["cases"] == len(cases) == 80 < len(slips)
    assert row["hits"] == (cases["damaged_verdict"] == "adequate").sum() < 80
    interval = binomtest(int(row["hits"]), 80).proportion_ci(0.95, "exact")
    np.testing.assert_allclose([row["low"], row["high"]], [interval.low, interval.high], rtol=1e-8)
    assert row["target"] == 0.97 and row["holds"] == (row["rate"] >= 0.97)


def test_a_verdict_is_the_same_where_word_and_mechanisms_are_and_stricter_with_joints(slips):
    one = slips.iloc[:1].drop(columns=[name for name in slips if "_same" in name or name == "heldout_ratio"])
    said = {"damaged_verdict": one["clean_verdict"].iloc[0], "damaged_found": one["clean_found"].iloc[0]}
    one = one.assign(**said, damaged_found_at="payload 2")
    found = judge_cases({"kuka": one.drop(columns="robot")}).iloc[0]
    assert found["damaged_same"] and not found["damaged_same_joints"]
    other = judge_cases({"kuka": one.assign(damaged_verdict="class").drop(columns="robot")}).iloc[0]
    assert not other["damaged_same"]
