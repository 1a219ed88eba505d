"""The summary has a row for each campaign and session, with errors computed by hand."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from made_loop_tables import effect_entry, make_verdict

from elastocal.loop.summary import tabulate_campaigns


def make_campaign_verdict(kind, *effects):
    missing = [
        replace(effect_entry(name), joints=tuple(joints)) for name, joints in effects
    ]
    return make_verdict(kind, missing)


def make_residuals(before, after=None, pose=None, repeat=None, session=0):
    """Return held-out rows with errors along x, mm."""
    before = np.asarray(before, float)
    after = before if after is None else np.asarray(after, float)
    count = len(before)
    table = {
        "session": np.full(count, session),
        "pose": np.arange(count) if pose is None else pose,
    }
    table |= {
        "load": 0,
        "target": 0,
        "repeat": np.zeros(count, int) if repeat is None else repeat,
    }
    for stage, values in (("before", before), ("after", after)):
        table |= {f"{stage}_dx": 1e-3 * values, f"{stage}_dy": 0.0, f"{stage}_dz": 0.0}
    return pd.DataFrame(table)


def test_errors_are_distances_of_averaged_repeats_in_millimetres():
    residuals = {
        "one": make_residuals([1.0, -2.0, 3.0], [0.1, 0.1, -0.4]),
        "two": make_residuals([1.5, -0.5, 0.25], pose=[4, 4, 7], repeat=[0, 1, 0]),
    }
    first, second = tabulate_campaigns(
        {name: make_campaign_verdict("named") for name in residuals}, residuals, {}, 1
    ).itertuples()
    assert (first.campaign, first.session, first.poses) == ("one", 0, 3)
    assert (
        first.before_mean_mm,
        first.before_rms_mm,
        first.before_max_mm,
    ) == pytest.approx((2.0, np.sqrt(14 / 3), 3.0))
    assert first.before_p95_mm == pytest.approx(2.9)
    assert (
        first.after_mean_mm,
        first.after_rms_mm,
        first.after_max_mm,
    ) == pytest.approx((0.2, np.sqrt(0.06), 0.4))
    # The error of the repeats is that of the mean of 1.5 and -0.5.
    assert (
        second.poses == 2
        and second.before_mean_mm == pytest.approx(0.375)
        and second.before_max_mm == pytest.approx(0.5)
    )


def test_the_folds_of_a_campaign_are_one_row_with_all_poses_and_counted_verdicts():
    verdicts = {
        "fold 1": make_campaign_verdict("named", ("joint_offset", (3,))),
        "alone": make_campaign_verdict("adequate"),
        "fold 2": make_campaign_verdict(
            "class", ("joint_offset", (3,)), ("payload", ())
        ),
        "fold 3": make_campaign_verdict("named", ("joint_offset", (3,))),
    }
    residuals = {
        name: make_residuals([1.0 + k, 1.0 + k], pose=[2 * k, 2 * k + 1])
        for k, name in enumerate(verdicts)
    }
    table = tabulate_campaigns(
        verdicts, residuals, {"all folds": ["fold 1", "fold 2", "fold 3"]}, 1
    ).set_index("campaign")
    assert list(table.index) == ["alone", "all folds"]
    folded = table.loc["all folds"]
    assert folded.poses == 6 and folded.before_mean_mm == pytest.approx((1 + 3 + 4) / 3)
    assert folded.verdict == "2 of 3: named; 1 of 3: class"
    assert (
        folded.effects
        == "2 of 3: joint_offset (joint 3); 1 of 3: joint_offset (joint 3) + payload"
    )
    assert (table.verdict["alone"], table.effects["alone"]) == ("adequate", "none")
