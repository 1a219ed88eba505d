"""Bootstrap weights: each replicate counts everything a random number of times, the first exactly once."""

import numpy as np

from elastocal.study.bootstrap import bootstrap_weights


def test_bootstrap_weights_do_not_depend_on_blocks_or_on_the_number_of_replicates():
    whole = bootstrap_weights(1, "kuka", range(10), 20)
    np.testing.assert_array_equal(
        np.hstack([bootstrap_weights(1, "kuka", part, 20) for part in (range(3), range(3, 10))]), whole
    )
    np.testing.assert_array_equal(bootstrap_weights(1, "kuka", range(10), 5), whole[:6])
