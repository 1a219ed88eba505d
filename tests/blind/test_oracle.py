"""The oracle knows the effect and its joints and is judged like the diagnosis."""

import json

import pytest
from analysed_robots import ROBOTS
from made_blind_documents import PLAN

from elastocal.effects.catalogue import candidates_on
from elastocal.loop.whole import diagnose_folder
from elastocal.mechanics.sites import build_sites
from elastocal_proof.blind import oracle
from elastocal_proof.blind.cases import BlindCase, write_sealed_case
from elastocal_proof.blind.oracle import (
    OracleFit,
    fit_oracle,
    list_variants,
)


@pytest.fixture
def list_keys(kuka):
    """List the keys of the candidates of each variant of an effect at some joints."""
    candidates = candidates_on(build_sites(kuka)).values()

    def keys_of(variant):
        return [candidate.key for candidate in variant]

    def list_keys(effect, joints):
        return [*map(keys_of, list_variants(effect, joints, candidates))]

    return list_keys


def test_a_variant_consists_of_the_candidates_at_the_true_joints(list_keys):
    assert list_keys("joint_offset", (3,)) == [["joint_offset@3"]]
    [weights] = list_keys("link_weight", (2, 3))
    locations = {key.partition("[")[0] for key in weights}
    assert locations == {"link_weight@2", "link_weight@3"}


def run_without_terms(monkeypatch, truth, verdict, folder):
    """Run the oracle as if the measurements could test nothing at all."""
    with monkeypatch.context() as patch:
        patch.setattr(oracle, "score_candidates", lambda *arguments: {})
        return fit_oracle(truth, verdict, folder, ROBOTS.as_posix(), 1)


def test_the_oracle_fits_what_the_diagnosis_names_rightly(tmp_path, monkeypatch):
    # The arm weighs nothing, so that the diagnosis is fast.
    setting = "weight_compensated"
    case = BlindCase(
        f"joint_offset/{setting}",
        "single",
        "kuka",
        ("joint_offset",),
        (200.0,),
        setting,
        271828,
        changes=PLAN["settings"][setting],
    )
    write_sealed_case(case, tmp_path / "blind", tmp_path / "sealed", ROBOTS)
    sealed = tmp_path / "sealed" / f"{case.name}.json"
    truth = json.loads(sealed.read_text(encoding="utf-8"))
    folder = (tmp_path / "blind" / case.name).as_posix()
    verdict = diagnose_folder(folder, ROBOTS.as_posix(), 1)
    assert [effect["name"] for effect in verdict["effects"]] == ["joint_offset"]
    oracle_of_untestable = run_without_terms(monkeypatch, truth, verdict, folder)
    assert oracle_of_untestable["candidates"] == []
    assert oracle_of_untestable["p_value"] == 1.0
    assert oracle_of_untestable["alternatives"] is None
    informed = fit_oracle(truth, verdict, folder, ROBOTS.as_posix(), 1)
    [joint] = truth["defects"][0]["joints"]
    assert informed["candidates"] == [f"joint_offset@{joint}"]
    assert informed["detected"]
    assert informed["p_value"] < 1e-6
    assert "link_geometry" in informed["alternatives"]
    assert "tracker_scale" not in informed["alternatives"]
    # The diagnosis has a prior of the size and estimates the pose error; both change
    # the errors very little here.
    assert informed["heldout"] == pytest.approx(verdict["heldout"]["after"], rel=2e-3)
    # Without an effect the oracle has the declared model.
    without_effect = fit_oracle({"defects": []}, verdict, folder, ROBOTS.as_posix(), 1)
    assert without_effect["heldout"] == verdict["heldout"]["declared"]
    assert not without_effect["detected"]


@pytest.mark.parametrize(
    ("p_value", "alternatives", "detected", "excludes_others"),
    [
        (1e-6, [], True, True),
        (1e-6, ["link_geometry"], True, False),
        (1e-6, None, True, False),
        (0.5, None, False, False),
    ],
)
def test_an_oracle_without_alternatives_excludes_all_others(
    p_value, alternatives, detected, excludes_others
):
    oracle_fit = OracleFit(None, [], p_value, alternatives)
    assert oracle_fit.detected == detected
    assert oracle_fit.excludes_others == excludes_others
