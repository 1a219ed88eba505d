"""Errors of several campaigns stand by their names, each at its value."""

import numpy as np
import pandas as pd
from drawn_figures import row_labels

from elastocal.figures.campaign_errors import campaign_errors

TABLE = pd.DataFrame(
    {
        "campaign": ["first_one", "second"],
        "poses": [24, 1],
        **{f"before_rms{end}_mm": values for end, values in (("", [0.4, 2.0]), ("_low", [0.3, 1.8]), ("_high", [0.5, np.inf]))},
        **{f"after_rms{end}_mm": values for end, values in (("", [0.2, 1.9]), ("_low", [0.1, 1.7]), ("_high", [0.3, 2.2]))},
    }
)


def test_each_campaign_has_both_errors_at_their_values():
    (axis,) = campaign_errors(TABLE).axes
    assert row_labels(axis) == ["first one", "second"]
    before, after = (container.lines[0].get_xydata() for container in axis.containers)
    np.testing.assert_allclose(before, [[0.4, 1], [2.0, 0]])
    np.testing.assert_allclose(after, [[0.2, 1], [1.9, 0]])
    assert all(np.isfinite(line.get_segments()).all() for container in axis.containers for line in container.lines[2])


def test_sessions_of_one_campaign_stand_by_their_poses():
    (axis,) = campaign_errors(TABLE.assign(campaign="folds")).axes
    assert row_labels(axis) == ["folds, 24 poses", "folds, 1 pose"]
