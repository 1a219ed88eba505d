"""Tables of the study's report that a reader looks up, as a page of the documentation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from elastocal.report.decision_answers import DESIGN_NAMES

if TYPE_CHECKING:
    from collections.abc import Mapping

_HEAD = """# Tables of the study

Written by `make pictures`; [what they mean](study.md). After ± stands the standard deviation between studies where a score of
averaged models is meant, and one Monte Carlo standard error elsewhere; brackets hold 95 % intervals.
"""
_WHO = {"robot": "robot", "strategy": "strategy"}
_SCORES = ("k_Σ (%)", "n by k_Σ", "dev (µm)", "n by dev")


def study_page(facts: Mapping[str, Any]) -> str:
    """The page in Markdown, from what the report states (reports/answers.json)."""
    length = facts["length"]
    sections = (
        (
            "Claims of the paper",
            'What studies of its size find. "All joints" and "fixed joints" are the two counts of joints in k_Σ (R10).',
            "claims",
            {"number": "no.", "claim": "claim of the paper"} | {name: name for name in ("place", "found", "p", "verdict")},
        ),
        (
            f"Table 4 over {facts['studies']} studies, poses measured",
            f"Scores at {length} configurations; n: configurations at which a score reaches its limit. The last two columns "
            "average compliances instead of stiffnesses.",
            "table4",
            _WHO | _scored("pose") | {"pose compliance 0": "k_Σ, mean ĉ (%)", "pose compliance 2": "dev, mean ĉ (µm)"},
        ),
        ("Table 4, positions of one reflector", "", "table4", _WHO | _scored("one reflector")),
        ("Table 4, positions of three reflectors", "", "table4", _WHO | _scored("three reflectors")),
        (
            "From which cost of a configuration a further measurement pays",
            f"For {facts['accuracy_um']} µm; break-even in measurements.\n\n![Cost of each set of points](costs.png)",
            "break_even",
            {"robot": "robot", "points": "points", "configurations": "configurations", "against": "6DoF alone"}
            | {"break_even": "break-even"},
        ),
        (
            f"Designs of {length} configurations, simulated",
            "RMS in µm of chosen and of random configurations, by direction of the load.",
            "simulated",
            {"robot": "robot", "load": "load", "unobservable": "unobservable"}
            | {name: f"{name} (µm)" for name in DESIGN_NAMES}
            | {"gain": "random over I"},
        ),
    )
    return _HEAD + "".join(
        f"\n## {title}\n\n{words}\n\n{_table(facts[key], columns)}\n" for title, words, key, columns in sections
    )


def _scored(measured: str) -> dict[str, str]:
    return {f"{measured} stiffness {place}": head for place, head in enumerate(_SCORES)}


def _table(rows: list[dict[str, str]], columns: Mapping[str, str]) -> str:
    frame = pd.DataFrame(rows, dtype=str).reindex(columns=[*columns], fill_value="")
    return frame.rename(columns=dict(columns)).to_markdown(index=False, disable_numparse=True)
