"""What the report says about metrics follows from their tables."""

from made_study_tables import TITLES, score_pairs, strategy_scores

from elastocal.report.metric_answers import METRIC_NAMES, metric_summary, score_rows


def test_scores_have_their_rank_in_brackets():
    row = score_rows(strategy_scores(), TITLES)[1]
    assert (row["robot"], row["strategy"], row["rms_um"]) == ("kuka", "staged", "90.00 ± 0.50 (2)")
    assert set(METRIC_NAMES) < set(row)


def test_reversed_pairs_are_counted_by_metric_and_the_widest_is_named():
    found = metric_summary(score_pairs(), TITLES)
    assert found["pairs"] == "2" and found["reversed_by"] == "k_Σ of the fixed joints (1)"
    assert "k_Σ of all joints" in found["never"] and "fixed joints" not in found["never"]
    assert "of 6DoF on Kuka is 2.00 times (1.50 to 2.50) that of staged, its RMS 0.83 times" in found["example"]
