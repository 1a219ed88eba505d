"""Elastostatic calibration of serial robots.

The names below are what people import; `import elastocal` alone loads none of them. The
science is importable without the pipeline that runs it: its packages and their layers
stand in `[tool.importlinter]` of pyproject.toml, and docs/architecture.md says what each
is for. What proves it is a package of its own, `elastocal_proof`, which `elastocal demo`
alone imports.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from elastocal.application.path_correction import CorrectedPath
    from elastocal.errors import InputError
    from elastocal.interface.campaigns import Campaign, read_campaign
    from elastocal.interface.comparison import Comparison, compare
    from elastocal.interface.corrected_robot import (
        CorrectedRobot,
        certify,
        read_model,
        verify,
    )
    from elastocal.interface.diagnoses import DiagnosisResult, diagnose
    from elastocal.interface.planning import MeasurementPlan, check, plan, simulate
    from elastocal.interface.plots import Plots
    from elastocal.interface.robots import read_robot
    from elastocal.loop.overview import Overview
    from elastocal.loop.verification import Verification
    from elastocal.mechanics.robot import Robot
    from elastocal.validation.conformity import Conformity
    from elastocal.verdict import Effect, Verdict, read_verdict

__version__ = "0.1.0"

# Modules of the public names.
_HOMES = {
    "Campaign": "elastocal.interface.campaigns",
    "Comparison": "elastocal.interface.comparison",
    "Conformity": "elastocal.validation.conformity",
    "CorrectedPath": "elastocal.application.path_correction",
    "CorrectedRobot": "elastocal.interface.corrected_robot",
    "DiagnosisResult": "elastocal.interface.diagnoses",
    "Effect": "elastocal.verdict",
    "InputError": "elastocal.errors",
    "MeasurementPlan": "elastocal.interface.planning",
    "Overview": "elastocal.loop.overview",
    "Plots": "elastocal.interface.plots",
    "Robot": "elastocal.mechanics.robot",
    "Verdict": "elastocal.verdict",
    "Verification": "elastocal.loop.verification",
    "certify": "elastocal.interface.corrected_robot",
    "check": "elastocal.interface.planning",
    "compare": "elastocal.interface.comparison",
    "diagnose": "elastocal.interface.diagnoses",
    "plan": "elastocal.interface.planning",
    "read_campaign": "elastocal.interface.campaigns",
    "read_model": "elastocal.interface.corrected_robot",
    "read_robot": "elastocal.interface.robots",
    "read_verdict": "elastocal.verdict",
    "simulate": "elastocal.interface.planning",
    "verify": "elastocal.interface.corrected_robot",
}

__all__ = [
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


def __getattr__(name: str) -> Any:
    """Import a public name on its first use."""
    if name not in _HOMES:
        message = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(message)
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    """List the public names, those that are not imported yet too."""
    return sorted({*globals(), *_HOMES})
