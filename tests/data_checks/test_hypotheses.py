"""The list of hypotheses: each a each of the file, those of the fewest eachs first."""

import numpy as np
import pytest
from made_campaigns import Plan, made, with_measured

from elastocal.data_checks.alternatives import other_interpretations
from elastocal.data_checks.hypotheses import discrete, fitted, shifts


def test_what_is_simple_comes_first_and_no_each_is_there_twice(fanuc):
    campaign = made(fanuc, 1, Plan(poses=10))
    single = [*discrete(campaign), *shifts(campaign)]
    assert single[0].joints == (1,)
    details = [each.detail for each in single]
    assert len(set(details)) == len(details)
    assert [each.detail for each in fitted(campaign)] == ["frame", "targets", "targets"]
    for each in single:
        read = each.read(campaign)
        assert read is not campaign and len(read.measurements) <= len(campaign.measurements)


@pytest.mark.parametrize(("kind", "keys"), [("row of its target", ("target",)), ("pose", ("target", "load", "repeat"))])
@pytest.mark.parametrize("steps", [1, -1])
def test_measured_columns_of_each_target_or_pose_moved_by_one_are_named(fanuc, kind, keys, steps):
    campaign = made(fanuc, 1, Plan(poses=14, loads=1))
    measurements, source = campaign.measurements, np.arange(14 * 8)
    groups = np.unique(np.column_stack([getattr(measurements, key) for key in keys]), axis=0, return_inverse=True)[1].ravel()
    for group in range(groups.max() + 1):
        members = np.flatnonzero(groups == group)
        source[members] = np.roll(members, steps)
    turned = measurements.rotation_vector[source]
    (fault,) = other_interpretations(with_measured(campaign, position=measurements.position[source], rotation_vector=turned))
    # Of two loads of a pose each second row is of the next pose: both words say so.
    assert (fault.name, fault.decisive) == ("shuffled_rows", True)
    assert fault.detail.endswith("up" if steps > 0 else "down")
