import subprocess
import sys

import pytest

import elastocal as ec

NAMES = [
    "Campaign",
    "Comparison",
    "Conformity",
    "CorrectedPath",
    "CorrectedRobot",
    "DiagnosisResult",
    "Effect",
    "InputError",
    "MeasurementPlan",
    "Overview",
    "Plots",
    "Robot",
    "Verdict",
    "Verification",
    "__version__",
    "certify",
    "check",
    "compare",
    "diagnose",
    "plan",
    "read_campaign",
    "read_model",
    "read_robot",
    "read_verdict",
    "simulate",
    "verify",
]


def test_public_names_are_stable():
    assert sorted(ec.__all__) == NAMES
    assert set(NAMES) <= set(dir(ec))


@pytest.mark.parametrize("name", NAMES)
def test_public_names_are_documented(name):
    assert getattr(ec, name).__doc__


def test_a_wrong_name_is_no_attribute():
    with pytest.raises(AttributeError, match="no attribute 'diagnoze'"):
        _ = ec.diagnoze


def test_import_loads_no_library():
    loaded = "import sys, elastocal; print(*sys.modules)"
    modules = subprocess.check_output([sys.executable, "-c", loaded], text=True).split()
    assert not {"numpy", "scipy", "pandas", "matplotlib"} & set(modules)


def test_diagnosis_in_memory_needs_neither_snakemake_nor_mujoco():
    program = (
        "import sys, elastocal as ec; ec.diagnose, ec.Campaign, ec.plan;"
        "print(*sys.modules)"
    )
    modules = subprocess.check_output(
        [sys.executable, "-c", program], text=True
    ).split()
    assert not {"snakemake", "mujoco", "pinocchio", "matplotlib"} & set(modules)
