"""What a verdict, a table of splits and an overview say of residuals; a figure altered is found."""

import pytest
from audited_campaigns import failed_once_altered

VERDICT, SPLITS = "reports/loop/cell/verdict.json", "reports/loop/cell/splits.csv"
DIAGNOSED = "what the diagnosis reported"


@pytest.mark.parametrize(
    ("keys", "change", "expected"),
    [
        (["verdict"], lambda _: "class", DIAGNOSED),
        (["effects", 0, "probability"], lambda _: 0.95, DIAGNOSED),
        (["effects", 0, "heldout_gain"], lambda _: 0.9, "gain of each effect"),
        (["compliance_urad_per_Nm", "before", 0], lambda value: 1.1 * value, "compliances of the declared model"),
        (["heldout", "after", "p95_m"], lambda value: 1.1 * value, "errors after"),
        (
            ["heldout", "outside_range", "outside", "before", "max_m"],
            lambda value: 1.1 * value,
            "errors before outside the range of the fitted poses",
        ),
        (["heldout", "reduction_std_error"], lambda value: 1.1 * value, "standard error of the reduction"),
        (["heldout", "share_below_max"], lambda _: 0.9, "poses, share below the largest error"),
        (["heldout", "outside_range", "poses"], lambda _: 2, "poses, share below the largest error"),
        (["heldout", "noise_floor_rms_m"], lambda value: 1.1 * value, "what the noise leaves"),
    ],
)
def test_a_figure_of_a_verdict_altered_is_found(diagnosed, keys, change, expected):
    assert expected in failed_once_altered(diagnosed, VERDICT, keys, change)


def test_a_warning_of_the_diagnosis_that_a_verdict_leaves_out_is_found(diagnosed):
    diagnosis, warnings = "results/loop/cell/diagnosis.json", ["document", "warnings"]
    assert failed_once_altered(diagnosed, diagnosis, warnings, lambda _: ["few"], VERDICT) == [DIAGNOSED]


@pytest.mark.parametrize(
    ("column", "expected"),
    [
        ("before_rms_m_high", "intervals hold their before_rms_m"),
        ("after_rms_m", "held-out errors, standard error of the reduction"),
        ("reduction_std_error", "held-out errors, standard error of the reduction"),
    ],
)
def test_an_error_or_interval_altered_is_found(diagnosed, column, expected):
    assert expected in failed_once_altered(diagnosed, SPLITS, (column, 0), lambda _: 1e-9)
