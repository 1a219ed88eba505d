"""Streams as they are described are streams as they are drawn; rows of a sample."""

import numpy as np
import pytest

from elastocal.random_streams import stream
from elastocal_proof.audit.audited import numbers


@pytest.mark.parametrize("name", [(1, "kuka", "identification/force", 0), (7, "fanuc", "noise/6DoF/again", 999)])
def test_numbers_are_those_of_the_pipeline(name):
    assert (numbers(*name).random(5) == stream(*name).random(5)).all()


@pytest.mark.parametrize("place", range(4))
def test_every_part_of_a_name_makes_other_numbers(place):
    names = [1, "kuka", "force", 2]
    other = list(names)
    other[place] = 3 if isinstance(names[place], int) else "other"
    assert not np.isclose(numbers(*names).random(5), numbers(*other).random(5)).any()


def test_a_sample_is_drawn_by_the_name_of_the_file(run):
    picked = run.pick("a", 1000)
    assert len({*picked}) == 20 and (picked == run.pick("a", 1000)).all() and (picked != run.pick("b", 1000)).any()
    assert run.pick("a", 3).tolist() == [0, 1, 2]
