"""Configurations as an audit finds them are those that a campaign is parted by."""

import numpy as np

from elastocal.audit.configurations import configurations
from elastocal.campaigns.joint_space import configurations as parted


def test_configurations_are_those_that_hold_out_goes_by():
    rng = np.random.default_rng(1)
    angles = np.concatenate([rng.uniform(-0.1, 0.1, (60, 3)), np.linspace(0.0, 1.0, 60)[:, None] * [1.0, 0.0, 0.0]])
    found = configurations(angles)
    np.testing.assert_array_equal(found, parted(angles, np.arange(120)))
    assert 10 < found.max() < 119
