"""From a chain to places on paper: links follow one another and do not cross, joints and measuring points stand on them."""

from itertools import combinations, pairwise

import numpy as np
import pytest
from drawn_schemes import DRAWN

from elastocal.figures.scheme_layout import DRAWING_MM, Joint, Point, Segment, lay_out, project_on_paper
from elastocal.figures.scheme_sheet import SYMBOL_RADIUS_MM
from elastocal.mechanics.robot import with_target_offset

LAID_OUT = {}


@pytest.fixture(params=DRAWN)
def drawn(request):
    """A robot with its items and the direction on paper of what recedes."""
    name = request.param
    if name not in LAID_OUT:
        LAID_OUT[name] = lay_out(DRAWN[name].chain)
    return DRAWN[name], *LAID_OUT[name]


def of(kind, items):
    return [item for item in items if isinstance(item, kind)]


def side(one, other, point):
    return np.sign(round(float((other - one)[0] * (point - one)[1] - (other - one)[1] * (point - one)[0]), 9))


def cross(one, other):
    """Whether two strokes cross, by the sides on which the ends of each lie of the other."""
    a, b, c, d = one.start, one.end, other.start, other.end
    return side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0


def test_links_follow_one_another_from_the_origin(drawn):
    _, items, _ = drawn
    segments = of(Segment, items)
    np.testing.assert_allclose(segments[0].start, 0)
    for one, following in pairwise(segments):
        np.testing.assert_allclose(one.end, following.start)


def test_links_do_not_cross(drawn):
    _, items, _ = drawn
    assert not [pair for pair in combinations(of(Segment, items), 2) if cross(*pair)]


@pytest.mark.parametrize("name", ["kuka", "fanuc"])
def test_a_robot_is_drawn_at_a_scale_at_which_it_fits_the_drawing(name):
    items, _ = lay_out(DRAWN[name].chain)
    places = [place for item in of(Segment, items) for place in (item.start, item.end)]
    assert (np.ptp(places, axis=0) <= DRAWING_MM).all()


def test_a_link_points_where_its_direction_is_projected(drawn):
    _, items, depth = drawn
    for segment in of(Segment, items):
        shown, expected = segment.end - segment.start, project_on_paper(segment.direction, depth)
        np.testing.assert_allclose(shown / np.linalg.norm(shown), expected / np.linalg.norm(expected))
        assert np.linalg.norm(segment.direction) == pytest.approx(1)


def test_every_joint_is_drawn_once_apart_from_the_others_and_on_the_arm(drawn):
    robot, items, _ = drawn
    joints = of(Joint, items)
    assert [joint.number for joint in joints] == list(range(1, robot.joints + 1))
    ends = [end for segment in of(Segment, items) for end in (segment.start, segment.end)]
    for joint in joints:
        carrier = joint.carrier
        if carrier is None:
            assert min(np.linalg.norm(joint.place - end) for end in ends) < 1e-9
        else:
            # Moved along its own axis, it remains the same joint.
            assert abs(joint.axis @ carrier.direction) == pytest.approx(1)
            parts = np.linalg.norm(joint.place - carrier.start), np.linalg.norm(carrier.end - joint.place)
            assert sum(parts) == pytest.approx(np.linalg.norm(carrier.end - carrier.start)) and min(parts) > 0
    for one, other in combinations(joints, 2):
        assert np.linalg.norm(one.place - other.place) > SYMBOL_RADIUS_MM


def test_labels_are_the_lengths_of_the_chain_in_millimetres(drawn):
    robot, items, _ = drawn
    lengths = [1000 * t.constant for t in robot.chain.transforms if t.kind == "T" and t.constant]
    labelled = [segment for segment in of(Segment, items) if segment.label]
    assert [segment.length_m for segment in labelled] == pytest.approx([abs(length) / 1000 for length in lengths])
    for number, (segment, length) in enumerate(zip(labelled, lengths, strict=True), start=1):
        name, value = segment.label.removesuffix(" mm").split(" = ")
        assert name == f"$l_{{{number}}}$" and float(value.replace("\N{MINUS SIGN}", "-")) == pytest.approx(length, abs=0.05)


def test_measuring_points_stand_at_their_place_on_the_arm_and_only_an_offset_moves_them():
    robot = DRAWN["kuka"]
    points = of(Point, LAID_OUT.get("kuka", lay_out(robot.chain))[0])
    assert [point.name for point in points] == [point.name for point in robot.chain.points]
    assert all(np.allclose(point.place, point.node) for point in points)
    moved = of(Point, lay_out(with_target_offset(robot, (0.0, 0.1, 0.05)).chain)[0])
    assert all(np.linalg.norm(point.place - point.node) > 5 for point in moved if np.linalg.norm(point.offset))
    assert [point for point in moved if np.linalg.norm(point.offset)]
