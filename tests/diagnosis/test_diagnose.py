"""What training poses say of a campaign: noise, faults, effects one at a time, and the figures of the verdict."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_folders import PLAN, made_folder, made_table
from planted import planted

from elastocal.data_checks.protocol import Fault
from elastocal.diagnosis import diagnose as module
from elastocal.diagnosis.diagnose import _effect_steps, diagnose
from elastocal.diagnosis.judge import judge
from elastocal.diagnosis.linearize import linearized
from elastocal.diagnosis.refit import fit_with_sizes, selected
from elastocal.diagnosis.search import posterior
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.displacement import joint_compliances
from elastocal.loop.whole import cases_in

OFFSET = 1e-3


@pytest.fixture(scope="module")
def diagnosed(kuka, config_folder, tmp_path_factory):
    """Diagnoses by the noise that is declared, m, of measurements that scatter by 60 um without repeats."""
    found = {}
    for declared_m in (6e-5, 1e-6):
        folder = tmp_path_factory.mktemp("noise") / "made"
        table = made_table(kuka, "made", plan=PLAN, offset_of_joint_3=OFFSET)
        first = [repeat == 0 for repeat in table["repeat"]]
        table = {name: [value for value, kept in zip(values, first, strict=True) if kept] for name, values in table.items()}
        changes = {"noise": {"position_m": declared_m}, "declared": ["link_geometry"]}
        case, _ = cases_in(made_folder(folder, kuka, table=table, **changes), config_folder / "robots")
        found[declared_m] = diagnose(case, Settings(), 1)
    return found


def test_a_model_that_is_kept_without_what_was_found_has_the_noise_that_it_leaves(kuka, config_folder, tmp_path):
    table = made_table(kuka, "made", plan=PLAN, offset_of_joint_3=OFFSET)
    case, _ = cases_in(made_folder(tmp_path / "made", kuka, table=table, declared=[]), config_folder / "robots")
    kept = diagnose(case, Settings(useful=1e9), 1)
    assert [effect["adopted"] for effect in kept.document["effects"]] == [False] and kept.document["kept"] == "declared"
    factor = kept.document["noise"]["factor"]
    assert factor > 1.1 and factor == pytest.approx(np.sqrt(kept.document["misfit"]["before"]))


def _priors(fitted):
    return {
        parameter.prior_std for owner, parameter in fitted.parameters if owner.startswith("link_geometry") and parameter.sized
    }


def test_sizes_and_verdict_do_not_follow_the_noise_that_was_declared(diagnosed):
    right, wrong = diagnosed[6e-5], diagnosed[1e-6]
    assert _priors(right.declared) == _priors(right.final) == _priors(wrong.declared) == _priors(wrong.final)
    # The wrong zero of a joint is a wrong geometry of its link, which is declared.
    assert right.document["verdict"] == wrong.document["verdict"] == "adequate"
    assert right.document["noise"]["factor"] == pytest.approx(1.0, abs=0.3)
    assert wrong.document["noise"]["factor"] == pytest.approx(60.0, rel=0.3)
    errors = [np.sqrt(np.diag(each.final.covariance)) for each in (right, wrong)]
    np.testing.assert_allclose(errors[0], errors[1], rtol=0.35)
    assert right.final.converged and wrong.final.converged


@pytest.mark.parametrize("error_rad", [0.0, 3e-4])
def test_an_error_that_all_measurements_of_a_pose_share_is_noise_of_the_model_and_said(
    error_rad, kuka, config_folder, tmp_path
):
    """Joints that stand otherwise in each pose than they report, by the same in all of its measurements."""
    table = made_table(kuka, "made", plan=replace(PLAN, poses=40))
    drawn = error_rad * np.random.default_rng(3).standard_normal((max(table["pose"]) + 1, 6))
    table |= {f"q{joint}": table[f"q{joint}"] + drawn[table["pose"], joint - 1] for joint in range(1, 7)}
    case, _ = cases_in(made_folder(tmp_path / "made", kuka, table=table), config_folder / "robots")
    found = diagnose(case, Settings(), 1)
    said = [line for line in found.document["warnings"] if "err together" in line]
    assert found.document["verdict"] == "adequate"
    assert len(said) == (error_rad > 0)
    # To the steps of its grid, of which neighbours differ by a factor of two.
    assert found.final.noise.pose_rad == pytest.approx(error_rad, rel=0.8)
    assert found.document["noise"]["pose_rad"] == found.final.noise.pose_rad


@pytest.mark.slow
def test_what_is_a_function_of_the_joints_is_no_error_of_poses_and_no_declared_model_covers_it(kuka, config_folder, tmp_path):
    """A deviation of joint 2 by two others at once: without candidates all measurements of a pose seem to err together."""
    table = made_table(kuka, "made", plan=replace(PLAN, poses=150, ladder=(0,), repeats=1, repeated_poses=0))
    table |= {"q2": table["q2"] + 3e-4 * np.sin(table["q1"]) * np.cos(table["q3"])}
    case, _ = cases_in(made_folder(tmp_path / "made", kuka, table=table), config_folder / "robots")
    found = diagnose(replace(case, candidates={}), Settings(), 1)
    assert found.document["repeatable"]["remains"] and found.document["verdict"] == "unexplained"
    assert found.final.noise.pose_rad == pytest.approx(Settings().pose_repeatability_rad, rel=0.3)
    assert "function of the joint angles" in found.document["contradictions"][0]
    assert not any("err together" in line for line in found.document["warnings"])


@pytest.fixture(scope="module")
def case(cases):
    return cases[0]


@pytest.fixture(scope="module")
def found(case):
    """Its diagnosis with every seventh candidate and that of the offset, and what was reported on the way."""
    few = dict(list(case.candidates.items())[::7]) | {"joint_offset@3": case.candidates["joint_offset@3"]}
    lines = []
    return diagnose(replace(case, candidates=few), Settings(), 1, lines.append), lines


def test_steps_go_from_the_frames_alone_to_the_springs_to_the_effect(found):
    """Springs are declared as to be identified; the frame is the base, so that the first step has nothing to fit."""
    diagnosis, _ = found
    effects = [[effect.key for effect in step.fitted.model.effects] for step in diagnosis.steps]
    springs = [key for key in effects[1] if key.startswith("joint_compliance")]
    assert effects == [[], springs, [*springs, "joint_offset@3"]] and len(springs) == 1
    assert diagnosis.declared is diagnosis.steps[1].fitted and diagnosis.final is diagnosis.steps[2].fitted
    size = diagnosis.final.estimate.coefficients[-1][0]
    assert size == pytest.approx(OFFSET, abs=4 * np.sqrt(diagnosis.final.covariance[-1, -1]))


def test_compliances_before_and_after_are_those_of_the_fits_in_microradians(found):
    diagnosis, _ = found
    facts = diagnosis.document["compliance_urad_per_Nm"]
    declared, final = diagnosis.declared, diagnosis.final
    np.testing.assert_allclose(facts["before"], 1e6 * joint_compliances(declared.model, declared.estimate))
    error = np.array(facts["std_error"])
    # What is averaged over the models is within its own standard error of the one that is fitted.
    after = 1e6 * joint_compliances(final.model, final.estimate)
    assert (np.abs(facts["after"] - after) <= error).all() and (error > 0).all()
    # With a prior of ten times what such a joint has: of some the loads of a pull tell nothing.
    usual = np.array([final.parameters[n][1].plausible for n in final.places_of("joint_compliance")])
    assert facts["identifiable"] == (error < 1e6 * usual).tolist() and any(facts["identifiable"])


def faults(*decisive):
    return [Fault(f"fault_{n}", (), "as measured", (), (1.0, 1.0), (), one) for n, one in enumerate(decisive)]


@pytest.mark.parametrize(
    ("decisive", "verdict", "names"),
    [((True,), "named", ["fault_0"]), ((True, False, True), "several", ["fault_0", "fault_2"])],
)
def test_measurements_at_fault_end_the_diagnosis_at_the_declared_model(decisive, verdict, names, case, monkeypatch):
    monkeypatch.setattr(module, "faults", lambda campaign, measurements: faults(*decisive))
    monkeypatch.setattr(module, "_explained", None)
    diagnosis = diagnose(case, Settings(), 1)
    document = diagnosis.document
    assert diagnosis.evidence is None and diagnosis.final is diagnosis.declared
    assert document["verdict"] == verdict and [entry["name"] for entry in document["effects"]] == names
    assert (document["probabilities"], document["misfit"], document["candidates_tested"]) == (None, None, 0)
    # What is not decisive is a warning, and nothing else is.
    minor = [line for line in document["warnings"] if line.startswith("fault_")]
    assert minor == [f"fault_{n}: as measured" for n, is_decisive in enumerate(decisive) if not is_decisive]


@pytest.mark.parametrize(
    ("most", "steps"),
    [
        (4, ["transmission_harmonic", "joint_offset", "payload"]),
        (3, ["transmission_harmonic", "joint_offset", "payload"]),
        (2, ["transmission_harmonic", "2 further effects"]),
    ],
)
def test_effects_are_added_one_at_a_time_that_which_explains_most_first_or_of_many_the_rest_together(kuka, most, steps):
    """A wave, a smaller offset and a still smaller payload; the last step is the final model, and each has those before it."""
    sizes = {"payload": [5.0, 0, 0, 0], "transmission_harmonic@2[orders 1-2]": [0, 0, 1e-3, 0], "joint_offset@3": [6e-4]}
    campaign = planted(kuka, sizes, seed=1, poses=40)
    candidates = [campaign.candidates[key] for key in sizes]
    line = linearized(campaign.declared, campaign.observations, candidates, Settings())
    names, met = {key.split("@")[0] for key in sizes}, posterior(line.problem)
    mechanisms = [{line.problem.units[number].mechanism for number in model.units} for model in met.models]
    best = SimpleNamespace(named=tuple(sorted(names)), model=mechanisms.index(names))
    found = SimpleNamespace(linearized=line, posterior=met, conclusion=SimpleNamespace(best=best))
    chosen = selected(line, met.models[best.model])
    final = fit_with_sizes(campaign.declared, campaign.observations, campaign.declared.noise, chosen)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("elastocal.diagnosis.diagnose._MOST_STEPS", most)
        case = SimpleNamespace(observations=campaign.observations)
        made = _effect_steps(case, campaign.declared, final, found)
    assert [step.name for step in made] == [f"with {name}" for name in steps] and made[-1].fitted is final
    known = len(campaign.declared.model.effects)
    counts = [len(step.fitted.model.effects) - known for step in made]
    assert counts == ([1, 2, 3] if len(steps) == 3 else [1, 3])
    misfit = [(step.fitted.whitened(step.fitted.residual) ** 2).sum() for step in made]
    assert misfit == sorted(misfit, reverse=True)


def test_frames_alone_are_kept_where_they_predict_left_out_poses_better(kuka, config_folder, tmp_path, monkeypatch):
    table = made_table(kuka, "made", offset_of_joint_3=OFFSET)
    folder = made_folder(tmp_path / "made", kuka, table=table, declared=["link_geometry"])
    case, held_out = cases_in(folder, config_folder / "robots")
    settings = replace(Settings(), numbers_a_parameter=np.inf)
    usual = diagnose(case, settings, 1)
    assert usual.document["kept"] != "frames" and not any("left out in turn" in line for line in usual.document["warnings"])
    # Were they to lose.
    monkeypatch.setattr(module, "certain_loss", lambda squares, others: True)
    found = diagnose(case, settings, 1)
    assert found.document["kept"] == "frames" and found.steps[-1].kind == "kept" and found.final.model.effects == ()
    assert any("left out in turn" in line and "frames and targets alone" in line for line in found.document["warnings"])
    heldout = judge(found, held_out, 1).document["heldout"]
    assert heldout["after"]["rms_m"] == pytest.approx(heldout["uncalibrated"]["rms_m"], rel=1e-3)
    assert diagnose(case, replace(settings, numbers_a_parameter=0.0), 1).document["kept"] != "frames"
