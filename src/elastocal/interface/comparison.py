"""Compare diagnoses side by side: two runs, two dates or two robots."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from elastocal.counting import format_digits
from elastocal.errors import InputError
from elastocal.interface.arguments import check_instance
from elastocal.interface.diagnoses import DiagnosisResult
from elastocal.verdict import Verdict

if TYPE_CHECKING:
    import pandas as pd

    from elastocal.verdict import EffectParameter

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>Diagnoses side by side</title>
<style>
body {{ font: 15px/1.4 sans-serif; margin: 2em; }}
td, th {{ padding: 0.2em 1em 0.2em 0; text-align: left; vertical-align: top; }}
tr:nth-child(even) {{ background: #f3f3f3; }}
</style></head>
<body><h1>Diagnoses side by side</h1>
{table}
</body></html>
"""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Diagnoses side by side.

    Attributes
    ----------
    table : DataFrame
        A column for each diagnosis; rows for the verdict, the errors at held-out poses
        in mm, and each identifiable parameter of an effect that any of them has found.
    """

    table: pd.DataFrame = field(repr=False)

    def __str__(self) -> str:
        return self.table.to_string()

    def _repr_html_(self) -> str:
        return self.to_html()

    def to_html(self) -> str:
        """Format the table as HTML."""
        return self.table.to_html(border=0)

    def to_page(self) -> str:
        """Format the table as an HTML page of its own."""
        return _PAGE.format(table=self.to_html())


def compare(*diagnoses: DiagnosisResult | Verdict) -> Comparison:
    """Compare diagnoses side by side.

    Parameters
    ----------
    *diagnoses : DiagnosisResult or Verdict
        Two or more; a verdict that was read from verdict.json will do.
    """
    import pandas as pd

    if len(diagnoses) < 2:
        raise InputError("compare", "diagnoses", str(len(diagnoses)), "two or more")
    allowed = "results of ec.diagnose, or verdicts that ec.read_verdict returns"
    for diagnosis in diagnoses:
        kinds = (DiagnosisResult, Verdict)
        check_instance("compare", "diagnoses", diagnosis, kinds, allowed)
    verdicts = [
        diagnosis.verdict if isinstance(diagnosis, DiagnosisResult) else diagnosis
        for diagnosis in diagnoses
    ]
    names = _name_columns([verdict.campaign for verdict in verdicts])
    columns = {
        name: _describe_verdict(verdict)
        for name, verdict in zip(names, verdicts, strict=True)
    }
    # Rows keep the order in which they first appear.
    rows = list(dict.fromkeys(row for column in columns.values() for row in column))
    table = pd.DataFrame(columns, index=pd.Index(rows, name="")).fillna("")
    return Comparison(table)


def _name_columns(campaigns: list[str]) -> list[str]:
    """Name each column after its campaign; equal names are numbered."""
    return [
        name if campaigns.count(name) == 1 else f"{name} ({position})"
        for position, name in enumerate(campaigns, 1)
    ]


def _describe_verdict(verdict: Verdict) -> dict[str, str]:
    """Describe one diagnosis by the rows of the table."""
    heldout = verdict.heldout
    rows = {
        "verdict": verdict.verdict,
        "effects": ", ".join(effect.name for effect in verdict.effects) or "none",
        "held-out poses": str(heldout.poses),
        "RMS error before, mm": f"{1e3 * heldout.before.rms_m:.3f}",
        "RMS error after, mm": f"{1e3 * heldout.delivered.rms_m:.3f}",
        "largest error after, mm": f"{1e3 * heldout.delivered.max_m:.3f}",
        "noise of a coordinate, mm": f"{1e3 * verdict.noise.position_m:.3f}",
    }
    if verdict.accuracy is not None:
        rows["predicted RMS error, mm"] = f"{1e3 * verdict.accuracy.rms_m:.3f}"
    for effect in verdict.missing_effects:
        for parameter in effect.parameters:
            # Parameters of which the measurements say no more than their priors would
            # fill the table.
            if parameter.identifiable:
                rows[f"{parameter.name}, {parameter.unit}"] = _format_parameter(
                    parameter
                )
    return rows


def _format_parameter(parameter: EffectParameter) -> str:
    """Format a value with its standard error."""
    value = format_digits(parameter.value, 4)
    if parameter.std_error is None:
        return value
    return f"{value} ± {format_digits(parameter.std_error, 2)}"
