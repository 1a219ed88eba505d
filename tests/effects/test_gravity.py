"""Weights, beyond their closed forms: what is offered where, and the spring of a compensator."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import candidate_on, conditions_on, displacements, made_states

from elastocal.effects.catalogue import candidates_on
from elastocal.mechanics.robot import Mass
from elastocal.mechanics.sites import sites_of


def test_link_weight_of_the_arm_may_be_that_of_all_links_with_a_length(fanuc):
    whole = candidate_on(fanuc.chain, "link_weight[all links]")
    masses = [int(p.name.split("_")[-1]) for p in whole.parameters if p.unit == "kg"]
    moments = [p.name for p in whole.parameters if p.unit == "kg m"]
    assert masses == [2, 3, 6] and whole.location == ("arm",)
    assert moments == [f"moment_{name}" for name in ("z_of_link_2", "z_of_link_3", "y_of_link_6", "z_of_link_6")]
    # One finding with that of two links: a model has one of these laws.
    assert (
        candidate_on(fanuc.chain, "link_weight").location
        == whole.location
        != candidate_on(fanuc.chain, "link_weight@2").location
    )


def test_payload_hangs_at_the_flange_whatever_target_sits_there(fanuc):
    moved = replace(fanuc.chain, points=tuple(replace(p, offset_m=(0.2, 0.3, 0.4)) for p in fanuc.chain.points))
    states = made_states(6, 5, seed=3)
    ours, theirs = (displacements(candidate_on(c, "payload"), conditions_on(c, states)) for c in (moved, fanuc.chain))
    np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        ({"payload_kg": 210.0}, 0.15 * 210),
        # A sixth of the arm's own mass is what arms carry.
        ({"masses": (600.0, 300.0, 0.0)}, 0.15 * 900 / 6),
        ({"payload_kg": 20.0, "masses": (600.0, 300.0)}, 0.15 * 20),
        # Rated loads grow with the volume that an arm reaches.
        ({}, 0.15 * 8.0 * 3.107**3),
    ],
)
def test_plausible_payload_is_a_share_of_what_the_robot_carries_as_far_as_that_is_known(fanuc, known, expected):
    masses = tuple(Mass(2 + link, mass, (0.0, 0.0, 0.0), 0.1) for link, mass in enumerate(known.get("masses", ())))
    sites = replace(sites_of(fanuc.chain), masses=masses, payload_kg=known.get("payload_kg"))
    tool, alone = (c for c in candidates_on(sites).values() if c.effect == "payload")
    assert [p.plausible for p in tool.parameters] == pytest.approx([expected, *[0.2 * expected] * 3])
    assert [p.plausible for p in alone.parameters] == pytest.approx([expected])


def compensator(q, stiffness, crank, length, rest, start):
    """Torque of a spring between a crank on the joint and the frame."""
    distance = np.sqrt(crank**2 + length**2 + 2 * crank * length * np.cos(start + q))
    return stiffness * crank * length * (1 - rest / distance) * np.sin(start + q)


@pytest.mark.parametrize("start", [0.0, 0.7, 2.5])
def test_compensator_torque_spans_the_formula_of_a_spring_with_a_short_crank(start, fanuc):
    states = made_states(6, 60, seed=4)
    around = conditions_on(fanuc.chain, states)
    made = displacements(candidate_on(fanuc.chain, "compensator_torque@2"), around)
    assert not np.delete(made, 1, axis=2).any()
    columns = made[:, :, 1].T
    leftovers = []
    for crank in (0.1, 0.05):
        torque = compensator(states.joint_angles[:, 1], 1e4, crank, 1.0, 0.6, start)
        left = torque - columns @ np.linalg.lstsq(columns, torque, rcond=None)[0]
        leftovers.append(np.linalg.norm(left) / np.linalg.norm(torque))
    # What is left is of second order in crank over length.
    assert leftovers[0] < 0.005
    assert leftovers[1] < 0.4 * leftovers[0]
