"""Places on an arm: where they are, and when a tracker sees them."""

import numpy as np
import pandas as pd
import pytest
from made_studies import few_of
from scipy.optimize import minimize

from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.kinematics import poses
from elastocal.study.arm_points import BAR, FLANGE, _segment_distances, in_sight, place_columns, places
from elastocal.study.points import budget_blocks

# Upright column, then an arm of a metre that a joint turns in the level plane, then one of half a metre.
CHAIN = parse_chain("Tz(h) Rz(q1) Tx(a) [elbow] Rz(q2) Tx(b) [end]", {"h": 0.5, "a": 1.0, "b": 0.5}, "test")
ACCEPTANCE = 30.0


def place_of(joints, side, share=0.5, radius=0.1):
    found = [p for p in places(CHAIN, radius, 0.4) if p.joints == joints and p.side == side]
    return found[int(share * 4) - 1] if len(found) > 1 else found[0]


def look(place, angles, tracker, radius=0.1):
    return [bool(each[0]) for each in in_sight(CHAIN, np.array([angles]), place, tracker, radius, ACCEPTANCE)]


def test_places_lie_on_the_surface_of_links_that_a_joint_moves_and_on_the_flange():
    found = places(CHAIN, 0.1, 0.4)
    # Three on each of four sides of two links; the column, which no joint moves, has none; flange and four bars.
    assert len(found) == 2 * 12 + 1 + 4
    position, _ = poses(CHAIN, np.zeros(2), place_of(1, "+y").point)
    np.testing.assert_allclose(position, [0.5, 0.1, 0.5])
    assert place_of(1, "+y").along_m == pytest.approx(1.0) and place_of(2, FLANGE).along_m == pytest.approx(2.0)
    np.testing.assert_allclose(poses(CHAIN, np.zeros(2), place_of(2, f"{BAR} -z").point)[0], [1.5, 0, 0.1])


def test_a_link_no_longer_than_its_radius_has_no_place():
    assert {place.joints for place in places(CHAIN, 0.6, 0.4) if place.side != FLANGE and BAR not in place.side} == {1}


def test_a_target_that_looks_away_is_not_seen_and_one_askance_only_if_somebody_turns_it():
    ahead, aside = (0.5, 5.0, 0.5), (5.0, 5.0, 0.5)
    assert look(place_of(1, "+y"), [0, 0], ahead) == [True, True]
    assert look(place_of(1, "-y"), [0, 0], ahead) == [False, False]
    # 45 degrees off its axis; the second link is stretched out and lies below the beam.
    assert look(place_of(1, "+y"), [0, 0], aside) == [True, False]


def test_a_link_in_between_hides_a_target():
    # The forearm folded back over the side of the upper arm that looks to the tracker.
    folded = [0.0, np.radians(160)]
    assert look(place_of(1, "+y", 0.75), folded, (0.6, 5.0, 0.5), radius=0.05) == [False, False]
    assert look(place_of(1, "+y", 0.25), folded, (0.1, 5.0, 0.5), radius=0.05)[0]


def test_distances_of_segments_are_the_least_over_both():
    rng = np.random.default_rng(1)
    start, way, other, other_way = rng.normal(size=(4, 60, 3))
    found = _segment_distances(start, way, other, other_way)
    for row, distance in enumerate(found):

        def gap(at, row=row):
            return np.linalg.norm(start[row] + at[0] * way[row] - other[row] - at[1] * other_way[row])

        best = min(minimize(gap, x0, bounds=[(0, 1), (0, 1)]).fun for x0 in ([0.5, 0.5], [0, 0], [1, 1], [0, 1], [1, 0]))
        assert distance == pytest.approx(best, abs=1e-4)


ARM = {"sets": 6, "radius_m": 0.15, "bar_m": 0.5, "acceptance_deg": 30}


@pytest.fixture(scope="module")
def table(kuka):
    return pd.DataFrame(place_columns(few_of(kuka), (4.0, 0.0, 1.5), ARM))


def test_a_target_on_the_flange_is_the_end_effector_measured_twice(kuka, table):
    (block,) = budget_blocks(few_of(kuka), {"twice": ["6DoF", "6DoF"]})
    expected = block["bound"][block["length"] == 20]
    np.testing.assert_allclose(table[table.side == "flange"].bound, expected, rtol=1e-6)


def test_a_reflector_that_stays_as_it_is_is_seen_less_often_than_one_that_is_turned(table):
    assert (table.fixed <= table.turned).all() and 0 < table.fixed.mean() < table.turned.mean() < 0.7
