"""Loaded configurations are values: what a step was given stays what it was given."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from elastocal.study.experiments import Experiments


@pytest.mark.parametrize("name", ["joint_angles", "wrench"])
def test_the_arrays_of_experiments_cannot_be_exchanged(name):
    experiments = Experiments(np.zeros((2, 3, 7)), np.ones((2, 3, 6)))
    with pytest.raises(FrozenInstanceError):
        setattr(experiments, name, np.zeros((2, 3, 6)))
