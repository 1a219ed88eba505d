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


def test_a_fault_of_the_data_that_ended_a_diagnosis_has_no_errors():
    row = case_row(truth(("payload",)), verdict("named", effect("wrong_unit")) | {"heldout": None}, oracle())
    assert np.isnan(row["after_rms_m"]) and not row["worse"]
