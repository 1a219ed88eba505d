"""The oracle knows the effect and its joints, and is judged like the engine."""

import json

import numpy as np
import pytest
from analysed_robots import ROBOTS
from made_blind_documents import PLAN
from scipy.stats import chi2

from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.case import noise_facts
from elastocal.fitting.tolerances import estimated_noise
from elastocal.loop.whole import cases_in, diagnosed
from elastocal.mechanics.sites import sites_of
from elastocal_proof.blind.cases import Case, make_case
from elastocal_proof.blind.oracle import members_of, oracle


def keys(effect, joints, chain):
    return [[c.key for c in members] for members in members_of(effect, joints, candidates_on(sites_of(chain)).values())]


def test_members_are_the_candidates_at_the_true_joints(kuka):
    assert keys("joint_offset", (3,), kuka.chain) == [["joint_offset@3"]]
    assert keys("cross_compliance", (2, 5), kuka.chain) == [["cross_compliance@2+5"]]
    (weights,) = keys("link_weight", (2, 3), kuka.chain)
    assert {key.partition("[")[0] for key in weights} == {"link_weight@2", "link_weight@3"}
    assert keys("link_elasticity", (2,), kuka.chain) == [["link_elasticity@2"]]


def test_frames_of_a_load_error_are_variants_and_bands_of_orders_are_parts(kuka):
    frames = [[f"force_bias[{axes} axes{how}]"] for how in ("", " in the pull") for axes in ("base", "flange")]
    assert keys("force_bias", (), kuka.chain) == frames
    (bands,) = keys("transmission_harmonic", (4,), kuka.chain)
    assert len(bands) == 7


def made(folder, *effects, level=200.0, setting="weight_compensated"):
    """A case of a seed of its own: its truth and its folder; of an arm that weighs nothing, for the engine of the loop."""
    case = Case(
        "/".join((*effects, setting)),
        "single",
        "kuka",
        effects,
        (level,) * len(effects),
        setting,
        271828,
        changes=PLAN["settings"][setting],
    )
    make_case(case, folder / "blind", folder / "sealed", ROBOTS)
    truth = json.loads((folder / "sealed" / f"{case.name}.json").read_text(encoding="utf-8"))
    return truth, (folder / "blind" / case.name).as_posix()


@pytest.fixture(scope="module")
def offset(tmp_path_factory):
    truth, folder = made(tmp_path_factory.mktemp("offset"), "joint_offset")
    return truth, folder, diagnosed(folder, ROBOTS.as_posix(), 1)


def test_what_the_engine_names_rightly_the_oracle_fits_the_same(offset):
    truth, folder, verdict = offset
    assert [effect["name"] for effect in verdict["effects"]] == ["joint_offset"]
    found = oracle(truth, verdict, folder, ROBOTS.as_posix(), 1)
    assert found["candidates"] == [f"joint_offset@{truth['defects'][0]['joints'][0]}"]
    assert found["detected"] and found["p_value"] < 1e-6
    # The engine has a prior on the size and a size of the pose error: both cost next to nothing here.
    assert found["heldout"] == pytest.approx(verdict["heldout"]["after"], rel=2e-3)


def test_without_an_effect_it_is_the_declared_model(offset):
    _, folder, verdict = offset
    found = oracle({"defects": []}, verdict, folder, ROBOTS.as_posix(), 1)
    assert found["heldout"] == verdict["heldout"]["before"] and not found["detected"]


@pytest.mark.slow
def test_p_values_of_effects_that_are_not_there_are_uniform(tmp_path):
    """Friction at each of six joints that have none, together by Fisher's method at 0.1 % at either end.

    P-values that are ten times too small are seen with a power of 0.94 (tenfold of 100,000 draws of six).
    """
    _, folder = made(tmp_path)
    case, _ = cases_in(folder, ROBOTS)
    known = {"noise": noise_facts(estimated_noise(case)[0])}
    absent = [{"defects": [{"effect": "hysteresis", "joints": [joint]}]} for joint in range(1, 7)]
    p_values = np.array([oracle(truth, known, folder, ROBOTS.as_posix(), 1)["p_value"] for truth in absent])
    low, high = chi2.ppf([1e-3, 1 - 1e-3], 2 * len(p_values))
    assert low < -2 * np.log(p_values).sum() < high


def test_outside_of_the_catalogue_there_is_none(offset):
    _, folder, verdict = offset
    assert oracle({"defects": [{"effect": "outside:refraction", "joints": []}]}, verdict, folder, ROBOTS.as_posix(), 1) is None


@pytest.mark.slow
def test_without_its_covariate_not_even_the_oracle_sees_it(offset, tmp_path):
    truth, folder = made(tmp_path, "hysteresis", setting="without_approach")
    verdict = diagnosed(folder, ROBOTS.as_posix(), 1)
    found = oracle(truth, verdict, folder, ROBOTS.as_posix(), 1)
    assert (found["candidates"], found["p_value"]) == ([], 1.0)
    assert found["heldout"]["rms_m"] == pytest.approx(verdict["heldout"]["before"]["rms_m"], rel=1e-6)
