"""Contacts prefer no size of the robot, and strains are those of perturbed robots."""

from dataclasses import replace

import numpy as np
import pytest
from contact_campaigns import (
    build_contact_case,
    open_workshop,
    touch_crossing_planes,
    write_contacts,
)

from elastocal.fitting.contact_density import (
    _find_approach,
    compute_mean_strains,
)
from elastocal.fitting.least_squares import fit_model, register_placement
from elastocal.fitting.model import (
    apply_step,
    compute_residuals,
    evaluate_conditions,
    get_parameter_values,
    list_parameters,
)
from elastocal.fitting.noise import estimate_noise, set_prior_scale

DOCUMENT = {
    "measured": "plane",
    "declared": ["joint_offset", "link_geometry"],
    "noise": {"position_m": 5e-5},
}
# Lengths of links, of which the unknown offset of the tool is none: some scale a tool.
TOOL_SHARE = 0.05


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """Contacts of an exact robot with three planes."""
    workshop = open_workshop(9000, np.zeros(6))
    rows, features = touch_crossing_planes(workshop, 30, 5e-5)
    folder = tmp_path_factory.mktemp("contacts") / "cell"
    document = DOCUMENT | {"features": features}
    return build_contact_case(write_contacts(folder, document, rows))


def lengthen(model, parameters):
    """The step (P,) by which all links are longer by their own lengths."""
    step = np.zeros(len(parameters))
    for index, (owner, parameter) in enumerate(parameters):
        if owner.startswith("link_geometry") and parameter.unit == "m":
            link = int(owner.partition("@")[2])
            axis = "xyz".index(parameter.name[-1])
            step[index] = model.sites.link_vectors_m[link, axis]
    return step


def test_a_larger_robot_moves_its_target_farther_by_its_scale(case):
    start = register_placement(case.model, case.observations)
    strains = compute_mean_strains(case.model, start, case.observations)
    step = lengthen(case.model, list_parameters(case.model, start))
    assert strains @ step == pytest.approx(1.0, abs=TOOL_SHARE)


def test_frames_targets_and_features_strain_nothing_and_measured_heights_have_no_strain(
    case,
):
    start = register_placement(case.model, case.observations)
    strains = compute_mean_strains(case.model, start, case.observations)
    is_robot = [
        not owner.startswith(("target", "feature"))
        for owner, _ in list_parameters(case.model, start)
    ]
    assert not strains[~np.array(is_robot)].any()
    heights = np.full_like(case.observations.position, 1e-3)
    measured = replace(case.observations, position=heights)
    assert compute_mean_strains(case.model, start, measured) is None
    assert (
        compute_mean_strains(replace(case.model, measuring=None), start, measured)
        is None
    )


def test_strains_are_those_of_robots_with_other_parameters(case):
    """Heights grow faster or slower if the joints move as those of the nominal robot."""
    model, observations = case.model, case.observations
    start = register_placement(model, observations)
    motion, is_possible = _find_approach(model, start, observations)
    assert 0.8 < is_possible.mean() < 1.0
    owners = [owner for owner, _ in list_parameters(model, start)]
    step = 1e-3 * np.random.default_rng(1).standard_normal(len(owners))
    step[[owner.startswith(("target", "feature")) for owner in owners]] = 0.0

    def find_slopes(estimate):
        heights = []
        for sign in (1.0, -1.0):
            states = observations.states
            angles = states.joint_angles + sign * 1e-4 * motion
            moved = replace(observations, states=replace(states, joint_angles=angles))
            conditions = evaluate_conditions(model, estimate, moved.states)
            heights.append(-compute_residuals(model, estimate, moved, conditions))
        return (heights[0] - heights[1])[is_possible] / 2e-4

    nominal = find_slopes(start)
    np.testing.assert_allclose(nominal, 1.0, atol=1e-3)
    growth = (find_slopes(apply_step(model, start, step)) / nominal).mean()
    strains = compute_mean_strains(model, start, observations)
    assert abs(strains @ step) > 2e-4
    assert growth - 1.0 == pytest.approx(strains @ step, abs=2e-5)


def test_contacts_make_a_robot_neither_smaller_nor_larger(case):
    noise, _ = estimate_noise(case)
    wide = set_prior_scale(case.model, 10.0)
    fitted = fit_model(wide, case.observations, noise)
    values = get_parameter_values(fitted.model, fitted.estimate)
    lengths = lengthen(fitted.model, fitted.parameters)
    scale = lengths @ values / (lengths @ lengths)
    covariance = lengths @ fitted.covariance @ lengths
    std_error = np.sqrt(covariance) / (lengths @ lengths)
    # Over seeds, the scale is -0.30 +- 0.07 standard errors without the density of
    # contacts, and -0.005 +- 0.004 with it.
    assert std_error == pytest.approx(7e-3, rel=0.2)
    assert abs(scale) < 0.05 * std_error
