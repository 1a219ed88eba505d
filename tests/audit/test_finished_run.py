"""Random streams against those of the pipeline, samples of rows, and findings."""

import numpy as np
import pandas as pd
import pytest

from elastocal.random_streams import open_stream
from elastocal_proof.audit.finished_run import (
    compare,
    open_philox_stream,
    require,
    require_each_once,
)


@pytest.mark.parametrize(
    "name",
    [(1, "kuka", "identification/force", 0), (7, "fanuc", "noise/6DoF/again", 999)],
)
def test_the_stream_equals_that_of_the_pipeline(name):
    assert (open_philox_stream(*name).random(5) == open_stream(*name).random(5)).all()


def test_a_sample_is_drawn_by_the_name_of_the_file(run):
    picked = run.pick("a", 1000)
    assert (
        len({*picked}) == 20
        and (picked == run.pick("a", 1000)).all()
        and (picked != run.pick("b", 1000)).any()
    )
    assert run.pick("a", 3).tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("found", "holds"),
    [(1.0 + 0.9e-9, True), (1.0 + 1.1e-9, False), (np.nan, False), (np.inf, False)],
)
def test_a_difference_is_measured_by_the_largest_expected_value(found, holds):
    finding = compare("c", "b", [found, 0.5], [1.0, 0.5])
    assert finding.holds is holds and (finding.note == "") is holds
    # Equal values hold even without any tolerance.
    assert compare(
        "c", "b", [found, np.nan, np.inf], [found, np.nan, np.inf], 0.0
    ).holds


def test_a_note_states_why_a_check_fails_and_rows_number_all_combinations():
    assert (
        compare("c", "b", [1.0, 2.5], [1.0, 2.0]).note
        == "value 1: found 2.5, expected 2"
    )
    assert "found 1 values, expected 2" in compare("c", "b", [1.0], [1.0, 2.0]).note
    assert (
        require("c", "b", holds=True, note="why").note == ""
        and require("c", "b", holds=False, note="why").note == "why"
    )
    frame = pd.DataFrame({"a": [0, 0, 1, 1], "b": [1, 2, 1, 2]})
    assert require_each_once(frame, a=range(2), b=range(1, 3)).holds
    assert not require_each_once(frame.head(3), a=range(2), b=range(1, 3)).holds
