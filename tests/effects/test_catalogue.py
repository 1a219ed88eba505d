"""The catalogue as a whole: its contents, its candidates on any chain, and a new effect as
one module."""

import re
import sys
from dataclasses import replace

import numpy as np
import pytest
import yaml
from catalogue_lists import CANDIDATES, has_own_test, listed_candidates
from support import ODD_CHAINS, OTHER_CHAINS, chain_of, refused
from synthetic import (
    conditions_on,
    displacements,
    equipped,
    make_estimate,
    make_model,
    make_states,
    observe_exactly,
    slopes,
    small_steps,
)

import elastocal.effects
from elastocal.campaigns.campaign import Target
from elastocal.effects import catalogue
from elastocal.effects.catalogue import (
    candidates_on,
    declared_candidates,
    list_bundled_effects,
)
from elastocal.effects.conditions import replace_total_load
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import evaluate_conditions
from elastocal.mechanics.kinematics import compute_poses

CHAINS = ["fanuc", "fixed rotations", *ODD_CHAINS]
# Symbols of which the units of parameters are composed.
UNIT_SYMBOLS = {"1", "rad", "m", "N", "kg", "K", "h"}
# What one parameter of plausible size may do to a robot of this size under some
# kilonewton: more is no small deviation.
LEAST_M = 1e-7
LARGEST_M = 2e-2


@pytest.fixture(params=CHAINS)
def chain(request, fanuc):
    return (
        fanuc.chain
        if request.param == "fanuc"
        else chain_of((OTHER_CHAINS | ODD_CHAINS)[request.param])
    )


def test_fixed_laws_depend_on_joint_angles_alone(
    chain,
):
    joints = equipped(chain).joints
    states = make_states(joints, 5, seed=1)
    elsewhere = make_states(joints, 5, seed=2)
    unchanged = conditions_on(chain, states)
    changed = replace(
        conditions_on(chain, elsewhere, 2 * unchanged.compliance),
        joint_angles=unchanged.joint_angles,
    )
    fixed = [
        candidate
        for candidate in candidates_on(unchanged.sites).values()
        if candidate.fixed
    ]
    assert {candidate.effect for candidate in fixed} >= {
        "transmission_harmonic",
        "bearing_runout",
        "link_geometry",
    }
    for candidate in fixed:
        for law, again in zip(
            candidate.displacement(unchanged),
            candidate.displacement(changed),
            strict=True,
        ):
            assert law.keys() == again.keys() and all(
                (law[at] == again[at]).all() for at in law
            ), candidate.key


def test_catalogue_agrees_with_its_written_list():
    """If a law is changed on purpose, `make catalogue` writes the list again; names
    of effects stay, because campaigns and results have them."""
    written = yaml.safe_load(CANDIDATES.read_text(encoding="utf-8"))
    listed = listed_candidates()
    for name, effect in list_bundled_effects().items():
        if name not in written and has_own_test(effect):
            # A new effect, whose own test says what it is.
            del listed[name]
    assert listed == written
    assert [list(entry["candidates"]) for entry in listed.values()] == [
        list(entry["candidates"]) for entry in written.values()
    ]


def test_every_effect_has_a_docstring_and_a_formula():
    for name, effect in list_bundled_effects().items():
        assert effect.doc and effect.formula, name


def test_every_effect_states_whether_it_moves_the_robot(
    fanuc,
):
    """A correction must not move the robot by an error of the tracker, its targets, the
    force sensor or the set-up."""
    sites = equipped(fanuc.chain)
    for name, effect in list_bundled_effects().items():
        instruments = effect.family == "load" or any(
            candidate.of_setup for candidate in effect.candidates(sites)
        )
        assert effect.moves_robot is not (
            instruments or name in ("nest_eccentricity", "tracker_scale")
        ), name


def test_parameters_have_units_names_and_positive_plausible_sizes(chain):
    for candidate in candidates_on(equipped(chain)).values():
        names = [p.name for p in (*candidate.parameters, *candidate.shapes)]
        assert candidate.parameters and len(names) == len(set(names)), candidate.key
        for parameter in candidate.parameters:
            symbols = set(re.findall(r"[A-Za-z]+|1", parameter.unit))
            assert symbols and symbols <= UNIT_SYMBOLS, (candidate.key, parameter)
            assert 0 < parameter.plausible < np.inf
        for shape in candidate.shapes:
            # A geometric series of values never comes to zero, evenly spaced ones may.
            assert shape.unit and (
                shape.lowest >= 0 if shape.tried else shape.lowest > 0
            )
            assert shape.lowest < shape.start < shape.highest
            assert shape.unit != "s" or (shape.lowest, shape.start, shape.highest) == (
                900,
                3600,
                36000,
            )
        # Or measurements at too few angles would pass for a test of it.
        assert not candidate.distinct_angles or candidate.joints or candidate.turning


def test_nest_eccentricity_needs_a_revolute_last_joint():
    """A reflector that a slide carries keeps its side to the tracker: there is no angle
    that it could circle with."""
    scara = "Rz(q1) Tx(0.4) Rz(q2) Tx(0.3) Tz(-q3) [end]"
    turning = "Rz(q1) Tx(0.4) Tz(-q2) Tx(0.3) Rz(q3) [end]"
    offered = [
        "nest_eccentricity" in candidates_on(equipped(chain_of(text)))
        for text in (scara, turning)
    ]
    assert offered == [False, True]


def test_plausible_sizes_cause_plausible_displacements(fanuc):
    around = conditions_on(fanuc.chain, make_states(6, 30, seed=1), fanuc.compliance)
    model = make_model(fanuc.chain)
    states = make_states(6, 30, seed=1)
    estimate = make_estimate(model)
    jacobian = linearize(
        model, estimate, observe_exactly(model, estimate, states), around
    ).coordinate_jacobian
    for candidate in candidates_on(around.sites).values():
        made = displacements(
            candidate, around, *[shape.start for shape in candidate.shapes]
        )
        size = np.array([parameter.plausible for parameter in candidate.parameters])
        moved = np.einsum("src,dsc->dsr", jacobian, made) * size[:, None, None]
        largest = np.linalg.norm(moved, axis=-1).max()
        assert LEAST_M < largest < LARGEST_M, (candidate.key, largest)


@pytest.mark.parametrize("chain", ["fixed rotations", *ODD_CHAINS], indirect=True)
def test_sensitivities_of_every_candidate_agree_with_central_differences(chain):
    targets = (
        Target("A", chain.end_effector.name, None),
        Target("B", chain.points[0].name, (0.1, -0.2, 0.05)),
    )
    bare = make_model(chain, targets, rows=6)
    states = make_states(chain.coordinates, 4, seed=2)
    rng = np.random.default_rng(0)
    for candidate in candidates_on(bare.sites).values():
        model = make_model(
            chain, targets[1:], 6, fitted_frames=False, effects=(candidate,)
        )
        if candidate.effect in ("joint_offset", "payload", "lost_motion"):
            model = make_model(chain, targets, 6, effects=(candidate,))
        estimate = make_estimate(model, seed=3)
        around = evaluate_conditions(model, estimate, states)
        observations = observe_exactly(model, estimate, states)
        steps = np.diag(small_steps(model, estimate))
        # Of a long law, steps of all parameters at once.
        steps = (
            steps if len(steps) < 6 else rng.standard_normal((2, len(steps))) @ steps
        )
        expected = slopes(model, estimate, observations, around, steps)
        actual = (
            linearize(model, estimate, observations, around).sensitivities @ steps.T
        )
        scale = np.maximum(np.abs(expected).max(axis=(0, 1)), 1e-300)
        np.testing.assert_allclose(
            actual / scale, expected / scale, rtol=0, atol=1e-5, err_msg=candidate.key
        )


def test_only_effects_that_need_a_load_vanish_without_a_load(chain):
    states = make_states(chain.coordinates, 6, seed=7)
    states.wrench[:] = 0.0
    around = conditions_on(chain, states)
    for candidate in candidates_on(around.sites).values():
        made = displacements(
            candidate, around, *[shape.start for shape in candidate.shapes]
        )
        # A payload always has a weight; it needs a load only to be distinguishable from
        # the weight of the arm.
        assert made.any() != (
            "load" in candidate.needs and candidate.effect != "payload"
        ), candidate.key


def test_needs_are_the_covariates_that_the_displacement_reads(fanuc):
    around = conditions_on(fanuc.chain, make_states(6, 5, seed=8))
    for candidate in candidates_on(around.sites).values():
        for name, attribute in (
            ("approach", "approach"),
            ("time", "time_s"),
            ("temperature", "temperature_c"),
        ):
            without = replace(around, **{attribute: None})
            start = [shape.start for shape in candidate.shapes]
            if name in candidate.needs:
                with pytest.raises((TypeError, AttributeError)):
                    candidate.displacement(without, *start)
            else:
                candidate.displacement(without, *start)


def test_laws_depend_only_on_loads_of_coordinates_that_they_displace(chain):
    """The sensitivities to errors of masses are computed on these coordinates alone."""
    around = conditions_on(chain, make_states(chain.coordinates, 6, seed=12))
    for candidate in candidates_on(around.sites).values():
        start = [shape.start for shape in candidate.shapes]
        laws = candidate.displacement(around, *start)
        displaced = sorted({coordinate for law in laws for coordinate in law})
        elsewhere = 2.0 * around.total + 1.0
        elsewhere[:, displaced] = around.total[:, displaced]
        again = displacements(candidate, replace_total_load(around, elsewhere), *start)
        np.testing.assert_array_equal(
            again, displacements(candidate, around, *start), err_msg=candidate.key
        )


NEW = '''
import numpy as np

from elastocal.effects.protocol import Parameter, effect


@effect("drift", "foot that sinks")
def sinking_foot(own, sites):
    """Gravity pulls the foot down, for some reason."""
    depth = (Parameter("depth", "m", 1e-3),)
    yield own.candidate((), depth, lambda around: [{sites.base[2]: -np.ones(len(around.wrench))}])
'''


def clear_catalogue():
    catalogue.list_effects.cache_clear()
    list_bundled_effects.cache_clear()


@pytest.fixture
def add_module(tmp_path, monkeypatch):
    """Add a module to the catalogue's package for one test."""
    folders = [*elastocal.effects.__path__, str(tmp_path)]
    monkeypatch.setattr(elastocal.effects, "__path__", folders)
    added = []

    def write_module(name, text):
        (tmp_path / f"{name}.py").write_text(text)
        added.append(name)
        clear_catalogue()

    yield write_module
    clear_catalogue()
    for name in added:
        sys.modules.pop(f"elastocal.effects.{name}", None)
        vars(elastocal.effects).pop(name, None)


def test_a_new_effect_needs_only_one_module(fanuc, add_module):
    before = set(list_bundled_effects())
    add_module("anything", NEW)
    assert set(list_bundled_effects()) == {*before, "sinking_foot"}
    model = make_model(
        fanuc.chain, (Target("A", "6DoF", (0, 0, 0)),), fitted_frames=False
    )
    candidate = candidates_on(model.sites)["sinking_foot"]
    assert declared_candidates(["sinking_foot"], model.sites)[0].key == "sinking_foot"
    sunk = model.with_effects((candidate,))
    states = make_states(6, 3)
    states.wrench[:] = 0
    estimate = make_estimate(model).with_effects((candidate,))
    estimate.coefficients[0][:] = 0.02
    expected = compute_poses(
        fanuc.chain, states.joint_angles, fanuc.chain.end_effector
    )[0] - [
        0,
        0,
        0.02,
    ]
    np.testing.assert_allclose(
        observe_exactly(sunk, estimate, states).position, expected, atol=1e-14
    )


def test_an_unknown_effect_is_refused(fanuc):
    with refused("campaign.yaml", "declared", "link_weight"):
        declared_candidates(["link_wait"], equipped(fanuc.chain), "campaign.yaml")
