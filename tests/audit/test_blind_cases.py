"""What a verdict is worth, one by one, and tables beside each other."""

import numpy as np
import pandas as pd
import pytest
from made_audits import failed
from made_blind_documents import effect, truth, verdict

from elastocal.audit.blind_cases import columns, outcome

ONE = truth(("joint_offset", 3))
TWO = truth(("joint_offset", 3), ("payload",))


@pytest.mark.parametrize(
    ("document", "said", "expected"),
    [
        (ONE, verdict("named", effect("joint_offset", 3)), (True, True, True, True, False)),
        (ONE, verdict("named", effect("payload")), (True, False, False, False, True)),
        (ONE, verdict("class", effect("payload", alternatives=["joint_offset@3"])), (True, False, False, True, False)),
        (ONE, verdict("adequate"), (False, False, False, False, False)),
        (TWO, verdict("several", effect("payload"), effect("joint_offset", 3)), (True, True, False, True, False)),
        # One effect cannot stand for both.
        (
            TWO,
            verdict("several", effect("payload", alternatives=["joint_offset"]), effect("lost_motion", 2)),
            (True, 0, 0, 0, 0),
        ),
        (TWO, verdict("class", effect("payload", alternatives=["joint_offset"]), effect("payload")), (True, 0, 0, True, 0)),
    ],
)
def test_an_outcome(document, said, expected):
    found = outcome(document, said)
    assert tuple(found[name] for name in ("detected", "exact", "named_right", "holds_truth", "wrong_name")) == expected


def test_columns_are_compared_one_by_one_and_the_rest_is_named():
    stated = pd.DataFrame({"name": ["a", "b"], "rate": [0.1, np.nan], "words": ["x", "y"]})
    found = columns("f", stated, stated.drop(columns="words"))
    assert failed(found) == [] and found[-1].checked == "4 of 6 cells followed; not words"
    assert failed(columns("f", stated, stated.assign(rate=[0.1001, np.nan]))) == ["column rate"]
    assert failed(columns("f", stated, stated.assign(name=["a", "c"]))) == ["column name"]
    assert failed(columns("f", stated, stated.head(1))) == ["rows"]
