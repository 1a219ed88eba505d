"""Observability indices by hand."""

import numpy as np
import pytest

from elastocal.study.observability import observability


def test_indices_are_those_of_the_singular_values():
    singular = np.array([4.0, 2.0, 1.0])
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    indices = observability((turn * singular**2) @ turn.T, 4)
    assert [float(indices[name]) for name in ("O1", "O2", "O3", "O4", "O5")] == pytest.approx([1.0, 0.25, 1.0, 0.25, 1 / 1.75])
