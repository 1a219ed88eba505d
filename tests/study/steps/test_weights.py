"""The weights table: how often each data set and each test configuration counts in each bootstrap replicate."""

import numpy as np

from elastocal.study.bootstrap import bootstrap_test_weights, bootstrap_weights
from elastocal.study.steps import blocks
from elastocal.study.steps.weights import DATA_SETS, TESTS, to_weights, weight_blocks


def test_the_weights_table_gives_back_the_weights_whatever_its_blocks(monkeypatch):
    for size in (500, 5, 2):
        monkeypatch.setattr(blocks, "SETS_PER_BLOCK", size)
        *sets, tests = weight_blocks("kuka", 1, 5, 7, 4)
        assert [block["members"] for block in sets] == [DATA_SETS] * -(-5 // size) and tests["members"] == TESTS
        np.testing.assert_array_equal(np.hstack([to_weights(b) for b in sets]), bootstrap_weights(1, "kuka", range(5), 4))
        np.testing.assert_array_equal(to_weights(tests), bootstrap_test_weights(1, "kuka", 7, 4))


def test_weights_of_a_table_written_by_hand():
    columns = {
        "number": np.array([4, 4, 4, 5, 5, 5]),
        "replicate": np.array([1, 2, 3, 1, 2, 3]),
        "count": np.array([0, 2, 1, 3, 0, 1]),
    }
    # Replicate 0 has every member once, the others their counts.
    assert to_weights(columns).tolist() == [[1, 1], [0, 3], [2, 0], [1, 1]]


def test_data_sets_count_once_on_average_and_independently_of_the_tests():
    sets, tests = (to_weights(block)[1:] for block in weight_blocks("kuka", 1, 400, 400, 50))
    # 20 000 Poisson counts of mean and variance one: five standard errors, a level of 1e-6 for each of two means and variances;
    # a mean or variance off by 8 % is seen with power above 0.99.
    for counts in (sets, tests):
        assert abs(counts.mean() - 1) < 5 / np.sqrt(counts.size)
        assert abs(counts.var() - 1) < 5 * np.sqrt(3 / counts.size)
    # Uncorrelated: at a level of 1e-6.
    assert abs(np.corrcoef(sets.ravel(), tests.ravel())[0, 1]) < 5 / np.sqrt(sets.size)
