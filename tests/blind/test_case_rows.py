"""One row a case: sizes, aliases by the truth, and errors that got worse in silence."""

import numpy as np
import pytest
from made_blind_documents import effect, oracle, silence, truth, verdict

from elastocal_proof.blind.case_rows import EXACT_ALIASES, case_row

# As the verdict says it, and what it says beside that.
GREW = "the RMS error of the validation poses grew from 0.100 to 0.110 mm"
OTHERS = [
    "few repeats",
    "2 of 9 validation poses lie outside the range of the fitted poses: errors there are extrapolated",
]


def test_right_place_is_the_right_effect_at_the_right_joints():
    document = truth(("joint_offset", 3))
    assert case_row(document, verdict("named", effect("joint_offset", 3)), oracle())["right_place"]
    assert not case_row(document, verdict("named", effect("joint_offset", 4)), oracle())["right_place"]
    several = truth(("joint_offset", 3), ("joint_offset", 5))
    assert case_row(several, verdict("named", effect("joint_offset", 3, 5)), oracle())["right_place"]
    assert not case_row(several, verdict("named", effect("joint_offset", 3)), oracle())["right_place"]


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        (verdict("named", before=1e-4, after=1.1e-4, reduction=(-0.14, -0.06)), (True, False, True)),
        (
            verdict("named", before=1e-4, after=1.1e-4, reduction=(-0.14, -0.06), warnings=[GREW]),
            (True, True, False),
        ),
        # A word about something else is no warning of this.
        (verdict("named", before=1e-4, after=1.1e-4, reduction=(-0.14, -0.06), warnings=OTHERS), (True, False, True)),
        (verdict("named", before=1e-4, after=1.1e-4, reduction=(-0.25, 0.05)), (False, False, False)),
        (silence(), (False, False, False)),
    ],
)
def test_worse_is_beyond_two_standard_errors(said, expected):
    row = case_row(truth(("payload",)), said, oracle())
    assert (row["worse"], row["warned"], row["worse_unwarned"]) == expected


def test_standard_error_is_the_verdicts_own():
    """The interval of few poses is wider than 1.96 of them on either side, and not in the middle."""
    said = verdict("named", reduction=(0.2, 0.6))
    said["heldout"]["reduction_std_error"] = 0.07
    row = case_row(truth(("payload",)), said, oracle())
    assert row["reduction"] == pytest.approx(0.5)
    assert row["reduction_std_error"] == 0.07


@pytest.mark.parametrize(
    ("effects", "reduction", "expected"),
    [
        ([effect("payload")], (-0.14, -0.06), (True, True)),
        ([effect("payload")], (-0.25, 0.05), (True, False)),
        ([], (-0.14, -0.06), (False, False)),
        ([effect("payload", adopted=False)], (-0.14, -0.06), (False, False)),
        ([effect("wrong_unit", adopted=False) | {"family": "data"}], (-0.14, -0.06), (False, False)),
        ([effect("wrong_unit", adopted=False) | {"family": "data"}, effect("payload")], (-0.14, -0.06), (True, True)),
    ],
)
def test_an_adopted_effect_that_makes_it_worse_counts_whether_warned_of_or_not(effects, reduction, expected):
    for warnings in ([], [GREW]):
        said = verdict("named", *effects, before=1e-4, after=1.1e-4, reduction=reduction, warnings=warnings)
        row = case_row(truth(("payload",)), said, oracle())
        assert (row["adopted"], row["worse_adopted"]) == expected


def test_exact_aliases_are_told_by_the_truth_and_its_joints():
    rows = [
        case_row(truth(place), said, oracle())["exact_alias"]
        for place in (("transmission_harmonic", 2), ("transmission_harmonic", 3), ("link_weight", 2), ("link_weight", 2, 3))
        for said in (silence(), verdict("named", effect(*place)))
    ]
    assert rows == [True, True, False, False, True, True, False, False]
    assert ("force_scale", ()) in EXACT_ALIASES


def test_an_arm_without_a_compensator_has_no_alias_of_one():
    place = ("transmission_harmonic", 2)
    on = {robot: case_row(truth(place, robot=robot), silence(), oracle())["exact_alias"] for robot in ("gp180", "iiwa14")}
    assert on == {"gp180": True, "iiwa14": False}


def test_a_fault_of_the_data_that_ended_a_diagnosis_has_no_errors():
    row = case_row(truth(("payload",)), verdict("named", effect("wrong_unit")) | {"heldout": None}, oracle())
    assert np.isnan(row["after_rms_m"]) and not row["worse"]


def test_size_is_given_against_the_noise():
    row = case_row(truth(("payload",), level=50.0), silence(), oracle())
    assert (row["raw"], row["retained"], row["level_of"]) == (200.0, 50.0, "retained")
    # 60 µm in all directions together, against 60 µm in each.
    assert row["signal_over_noise"] == pytest.approx(1 / np.sqrt(3))
    pair = case_row(truth(("payload",), ("joint_tilt", 2), group="pair"), silence(), oracle())
    assert pair["signal_over_noise"] == pytest.approx(np.sqrt(2 / 3))


def test_an_effect_without_its_covariate_is_hidden():
    blind = {"covariates": ["time", "temperature"]}
    assert case_row(truth(("hysteresis", 1), design=blind), silence(), oracle())["hidden"]
    assert not case_row(truth(("frame_drift",), design=blind), silence(), oracle())["hidden"]


def test_outside_of_the_catalogue_there_is_no_oracle():
    row = case_row(truth(("outside:refraction",), group="outside"), silence(), None)
    assert np.isnan(row["oracle_rms_m"]) and np.isnan(row["oracle_detected"])
