"""Contacts are where they should be, and measurements have the errors of their instrument."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elastocal_proof.plant.contacts import (
    Workshop,
    draw_form,
    find_view,
    read_gauge,
    read_length,
    seat_in_socket,
    see_board,
    touch_plane,
    touch_sphere,
    touch_surface,
)


def locate(angles):
    """A planar arm of two links of 1 m on a column that turns."""
    turn, first, second = angles.T
    reach = np.cos(first) + np.cos(first + second)
    height = np.sin(first) + np.sin(first + second)
    position = np.stack([reach * np.cos(turn), reach * np.sin(turn), height], axis=-1)
    return position, np.tile(np.eye(3), (len(angles), 1, 1))


@pytest.fixture
def workshop():
    limits = np.array([[-2.0, 2.0], [-1.0, 1.5], [0.2, 2.0]])
    return Workshop(locate, limits, np.random.default_rng(1))


def test_a_contact_without_play_is_exact(workshop):
    place = np.array([1.0, 0.5, 0.7])
    seat = workshop.find_tool(seat_in_socket(workshop, place, 0.0))[0]
    np.testing.assert_allclose(seat, place, atol=1e-10)
    normal = np.array([0.0, 0.6, 0.8])
    tip = workshop.find_tool(touch_plane(workshop, normal, 0.5, 0.0))[0]
    assert abs(normal @ tip - 0.5) < 1e-10
    tip = workshop.find_tool(touch_sphere(workshop, place, 0.1, 0.0))[0]
    assert abs(np.linalg.norm(tip - place) - 0.1) < 1e-10


def test_a_wavy_surface_is_touched_at_its_own_height(workshop):
    place = np.array([1.0, 0.5, 0.7])
    normal = np.array([0.0, 0.6, 0.8])
    form = draw_form(workshop.draws, 1e-3, 0.1)
    tip = workshop.find_tool(touch_surface(workshop, place, normal, form, 0.0))[0]
    height = form.find_height(tip)
    assert height != 0.0
    np.testing.assert_allclose(tip - place, height * normal, atol=1e-10)


def test_the_form_of_a_table_has_its_standard_deviation_and_its_length():
    draws = np.random.default_rng(3)
    steps = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [1.0, 0.0, 0.0]])
    heights = []
    for _ in range(400):
        form = draw_form(draws, 2e-4, 0.1)
        heights.append([form.find_height(step) for step in steps])
    covariance = np.cov(np.array(heights).T) / 4e-8
    # 400 forms: a correlation is within 0.15, and a variance within 20 %, with a
    # probability of 0.997.
    assert covariance[0, 0] == pytest.approx(1.0, rel=0.2)
    assert covariance[0, 1] == pytest.approx(np.exp(-0.5), abs=0.15)
    assert covariance[0, 2] == pytest.approx(0.0, abs=0.15)


def test_play_and_noise_have_their_standard_deviations(workshop):
    place = np.array([1.0, 0.5, 0.7])
    seats = [
        workshop.find_tool(seat_in_socket(workshop, place, 1e-4))[0] for _ in range(60)
    ]
    # 180 numbers: the standard deviation is within 16 % with probability 0.997.
    assert np.std(np.array(seats) - place) == pytest.approx(1e-4, rel=0.16)
    angles = workshop.draw_angles()
    lengths = [read_length(workshop, angles, place, 1e-4) for _ in range(400)]
    gauge = [read_gauge(workshop, angles, np.eye(3)[0], 1e-5) for _ in range(400)]
    assert np.std(lengths) == pytest.approx(1e-4, rel=0.12)
    assert np.std(gauge) == pytest.approx(1e-5, rel=0.12)


def test_a_board_is_less_certain_along_the_view_and_far_away(workshop):
    angles = workshop.draw_angles()
    position, rotation = workshop.find_tool(angles)
    scatter = []
    for range_m in (0.5, 1.0):
        board = (position + rotation @ np.array([0, 0, range_m]), rotation)
        seen = [see_board(workshop, angles, board, 1e-4, 0.2)[0] for _ in range(400)]
        scatter.append(np.std(seen, axis=0))
    np.testing.assert_allclose(scatter[0], [5e-5, 5e-5, 1.25e-4], rtol=0.15)
    np.testing.assert_allclose(scatter[1], [1e-4, 1e-4, 5e-4], rtol=0.15)


def test_what_is_out_of_reach_is_said(workshop):
    with pytest.raises(ValueError, match="does not reach"):
        seat_in_socket(workshop, np.array([9.0, 0.0, 0.0]), 0.0)


def test_an_approximation_changes_the_start_and_not_the_contact(workshop):
    rough = replace(workshop, approximate=lambda angles: locate(angles + 1e-3))
    place = np.array([1.0, 0.5, 0.7])
    seat = rough.find_tool(seat_in_socket(rough, place, 0.0))[0]
    np.testing.assert_allclose(seat, place, atol=1e-10)


def test_a_view_has_the_board_in_range_in_the_cone_and_not_oblique(workshop):
    def look(angles):
        """The same arm with a camera that looks along its forearm."""
        turn, first, second = angles.T
        turned = Rotation.from_euler(
            "ZY", np.column_stack([turn, np.pi / 2 - first - second])
        )
        return locate(angles)[0], turned.as_matrix()

    camera = replace(workshop, locate=look)
    away = Rotation.from_euler("y", np.pi / 2).as_matrix()
    board = np.array([2.2, 0.2, 0.5]), away
    for _ in range(10):
        position, rotation = camera.find_tool(find_view(camera, board))
        sight = board[0] - position
        distance = np.linalg.norm(sight)
        assert 0.3 < distance < 0.9
        assert sight @ rotation[:, 2] > distance * np.cos(0.35)
        assert sight[0] > distance * np.cos(0.8)
    with pytest.raises(ValueError, match="does not see"):
        find_view(camera, (np.array([9.0, 0.0, 0.0]), away))
