"""Values that a search tries for shapes; keys and locations of candidates."""

import numpy as np
import pytest

from elastocal.effects.protocol import (
    Candidate,
    Parameter,
    Shape,
    effect_of,
    require_unique,
)

TRIED = (
    Shape("when", "1", 0.5, 0.0, 1.0, tried=11),
    Shape("lag", "s", 3600.0, 900.0, 36000.0),
)


@pytest.mark.parametrize("shape", TRIED, ids=lambda shape: shape.name)
@pytest.mark.parametrize("count", [1, 2, 5])
def test_each_value_of_a_shape_represents_the_closest_part_of_the_range(shape, count):
    """On the scale on which they are spread: counted over a fine grid, whatever their
    order."""
    scale = (lambda value: value) if shape.tried else np.log
    every = np.linspace(scale(shape.lowest), scale(shape.highest), 100_001)
    values = np.random.default_rng(count).uniform(shape.lowest, shape.highest, count)
    nearest = np.argmin(np.abs(every[:, None] - scale(values)), axis=1)
    actual = shape.shares(values)
    np.testing.assert_allclose(
        actual, np.bincount(nearest, minlength=count) / len(every), atol=2e-5
    )
    assert actual.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("shape", TRIED, ids=lambda shape: shape.name)
def test_values_between_two_shapes_are_evenly_spaced_and_include_the_middle(
    shape,
):
    actual = (
        shape.between(0.2, 0.8, 7) if shape.tried else shape.between(1000.0, 4000.0, 7)
    )
    steps = np.diff(actual) if shape.tried else np.diff(np.log(actual))
    ends = (0.2, 0.8, 0.5) if shape.tried else (1000.0, 4000.0, 2000.0)
    assert len(actual) == 7 and ends[0] < actual[0] and actual[-1] < ends[1]
    np.testing.assert_allclose(steps, steps[0])
    np.testing.assert_allclose(actual[3], ends[2])


@pytest.mark.parametrize("few", [1, 2, 3, 7])
def test_values_of_a_shape_form_a_geometric_series_inside_its_range(
    few,
):
    """900 s to 36000 s is a factor of 40: a few values part it in so many and one more
    equal factors, without the ends."""
    expected = 900.0 * 40.0 ** (np.arange(1, few + 1) / (few + 1))
    np.testing.assert_allclose(TRIED[1].values(few), expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("joints", "detail", "location_name", "key", "location"),
    [
        ((), "", "", "law", ()),
        ((2,), "", "", "law@2", (2,)),
        (
            (1, 3),
            "one section",
            "one section",
            "law@1+3[one section]",
            (1, 3, "one section"),
        ),
        ((), "column", "column", "law[column]", ("column",)),
    ],
)
def test_key_and_location_of_a_candidate_have_its_effect_joints_and_detail(
    joints, detail, location_name, key, location
):
    law = Candidate(
        "law",
        "any",
        joints,
        detail,
        (Parameter("a", "rad", 1.0),),
        dict,
        location_name=location_name,
    )
    assert (law.key, law.location) == (key, location)
    assert effect_of(law.key) == "law"


def test_two_candidates_of_one_name_are_refused():
    require_unique(["payload", "payload[mass]"])
    with pytest.raises(ValueError, match="payload"):
        require_unique(["payload", "joint_offset@1", "payload"])
