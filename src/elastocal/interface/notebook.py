"""What a notebook shows of a diagnosis: verdict, errors and a figure."""

from __future__ import annotations

import base64
from importlib.util import find_spec
from io import BytesIO
from typing import TYPE_CHECKING

from markupsafe import escape

from elastocal.application.statements import format_millimetres

if TYPE_CHECKING:
    from elastocal.interface.diagnoses import DiagnosisResult

_DOTS_PER_INCH = 110


def format_result(result: DiagnosisResult) -> str:
    """Format a diagnosis as HTML."""
    first, *others = result.lines
    rows = "".join(
        f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>"
        for name, value in _list_errors(result).items()
    )
    sentences = "".join(f"<p>{escape(line.strip())}</p>" for line in others)
    return (
        f"<div><p><strong>{escape(first)}</strong></p>{sentences}"
        f"<table>{rows}</table>{_format_figure(result)}</div>"
    )


def _format_figure(result: DiagnosisResult) -> str:
    """Format the errors of each model as a picture; nothing without matplotlib."""
    if find_spec("matplotlib") is None:
        return ""
    picture = BytesIO()
    result.plot.errors().savefig(picture, format="png", dpi=_DOTS_PER_INCH)
    encoded = base64.b64encode(picture.getvalue()).decode("ascii")
    alternative = "Errors of each model at held-out poses"
    return f'<img alt="{alternative}" src="data:image/png;base64,{encoded}">'


def _list_errors(result: DiagnosisResult) -> dict[str, str]:
    """Errors at held-out poses, in words."""
    errors = {
        "RMS position error before": format_millimetres(result.before.rms_m),
        "RMS position error after": format_millimetres(result.after.rms_m),
    }
    floor_m = result.verdict.heldout.noise_floor_rms_m
    if floor_m is not None:
        errors["RMS that noise alone leaves"] = format_millimetres(floor_m)
    return errors
