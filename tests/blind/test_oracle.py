"""The oracle knows the effect and its joints and is judged like the engine; of the best
analyst nobody is right more often."""

import json
from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import ROBOTS
from made_blind_documents import PLAN
from scipy.stats import multivariate_normal

from elastocal.effects.catalogue import candidates_on
from elastocal.loop.whole import diagnose_folder
from elastocal.mechanics.sites import build_sites
from elastocal_proof.blind import oracle as module
from elastocal_proof.blind.cases import BlindCase, list_cases, write_sealed_case
from elastocal_proof.blind.oracle import (
    assess_best_analyst,
    compute_log_bayes_factors,
    fit_oracle,
    list_variants,
)


def keys(effect, joints, robot):
    return [
        [c.key for c in members]
        for members in list_variants(
            effect, joints, candidates_on(build_sites(robot)).values()
        )
    ]


def test_members_are_the_candidates_at_the_true_joints(kuka):
    assert keys("joint_offset", (3,), kuka) == [["joint_offset@3"]]
    (weights,) = keys("link_weight", (2, 3), kuka)
    assert {key.partition("[")[0] for key in weights} == {
        "link_weight@2",
        "link_weight@3",
    }


def made(folder, *effects, level=200.0, setting="weight_compensated"):
    """A case of a seed of its own: its truth and its folder; of an arm that weighs
    nothing, for the engine of the loop."""
    key = "/".join((*effects, setting))
    levels = (level,) * len(effects)
    changes = PLAN["settings"][setting]
    case = BlindCase(
        key, "single", "kuka", effects, levels, setting, 271828, changes=changes
    )
    write_sealed_case(case, folder / "blind", folder / "sealed", ROBOTS)
    truth = json.loads(
        (folder / "sealed" / f"{case.name}.json").read_text(encoding="utf-8")
    )
    return truth, (folder / "blind" / case.name).as_posix()


def test_what_the_engine_names_rightly_the_oracle_fits_the_same_and_without_an_effect_the_declared_model(
    tmp_path,
):
    truth, folder = made(tmp_path, "joint_offset")
    verdict = diagnose_folder(folder, ROBOTS.as_posix(), 1)
    assert [effect["name"] for effect in verdict["effects"]] == ["joint_offset"]
    found = fit_oracle(truth, verdict, folder, ROBOTS.as_posix(), 1)
    assert found["candidates"] == [f"joint_offset@{truth['defects'][0]['joints'][0]}"]
    assert found["detected"] and found["p_value"] < 1e-6
    # The engine has a prior on the size and a size of the pose error: both cost next to
    # nothing here.
    assert found["heldout"] == pytest.approx(verdict["heldout"]["after"], rel=2e-3)
    found = fit_oracle({"defects": []}, verdict, folder, ROBOTS.as_posix(), 1)
    assert found["heldout"] == verdict["heldout"]["before"] and not found["detected"]


SOME = ("force_bias", "joint_tilt", "setup_step", "tracker_scale")


@pytest.fixture(scope="module")
def cases():
    """A single defect at 200 for each of some kinds, and a pair, on the arm that is
    solved fastest."""
    parts = [{"robots": ["kuka"], "single": 1, "levels": [200.0], "pair": 1}]
    return list_cases(
        PLAN | {"sizes": {"some": {"purpose": "limit", "parts": parts}}}, "some", 3
    )


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(module, "NAMED", SOME)


@pytest.mark.slow
def test_bayes_factors_are_ratios_of_normal_densities():
    draws = np.random.default_rng(1)
    units = draws.standard_normal((6, 16))
    units /= np.linalg.norm(units, axis=0)
    residuals = draws.standard_normal((6, 3))
    columns = np.array([np.arange(8), np.arange(8, 16)])
    found = compute_log_bayes_factors(
        units.T @ units, units.T @ residuals, columns, 25.0
    )
    for number, chosen in enumerate(columns):
        covariance = np.eye(6) + 25.0 / 8 * units[:, chosen] @ units[:, chosen].T
        expected = [
            multivariate_normal.logpdf(r, cov=covariance)
            - multivariate_normal.logpdf(r, cov=np.eye(6))
            for r in residuals.T
        ]
        np.testing.assert_allclose(found[number], expected, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("effect", SOME)
def test_a_defect_that_shows_well_is_detected_and_named(cases, few, effect):
    case = next(case for case in cases if case.effects == (effect,))
    found = assess_best_analyst(PLAN, case, ROBOTS)
    assert found["detected"] and found["right"] and found["mechanisms"] == [effect]
    assert found["probability"] > 0.9


@pytest.mark.slow
def test_a_pair_is_named_and_what_hardly_shows_is_not_detected(cases, few):
    single = next(case for case in cases if case.effects == (SOME[2],))
    both = replace(
        single, effects=(SOME[0], SOME[2]), levels=(200.0, 200.0), group="pair"
    )
    found = assess_best_analyst(PLAN, both, ROBOTS)
    assert found["right"] and found["mechanisms"] == [SOME[0], SOME[2]]
    assert not assess_best_analyst(PLAN, replace(single, levels=(0.5,)), ROBOTS)[
        "detected"
    ]


@pytest.mark.slow
def test_a_sixth_of_the_cases_that_targets_compare_with_is_in_the_sample(monkeypatch):
    monkeypatch.setattr(
        module, "assess_best_analyst", lambda plan, case, robots_folder: {"right": True}
    )

    def in_sample(seed, group="single", level=50.0, of="retained"):
        truth = {
            "case": {
                "key": "k",
                "group": group,
                "robot": "kuka",
                "effects": ["payload"],
                "levels": [level],
            }
            | {"setting": "usual", "seed": seed},
            "defects": [{"of": of}],
        }
        return module.limit_of_sample(PLAN, truth, ROBOTS) is not None

    # Of a binomial distribution, 99.9 %.
    assert 70 <= sum(in_sample(seed) for seed in range(600)) <= 131
    chosen = next(seed for seed in range(100) if in_sample(seed))
    assert in_sample(chosen, "pair", 200.0) and in_sample(chosen, level=25.0)
    assert not any(
        (
            in_sample(chosen, level=200.0),
            in_sample(chosen, "outside"),
            in_sample(chosen, of="raw"),
        )
    )
