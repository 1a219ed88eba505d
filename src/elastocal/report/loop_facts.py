"""Everything that the report of a campaign states, worded, from the files that the loop wrote, and its pages."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from elastocal.application.accuracy import accuracy_from, accuracy_sentence
from elastocal.data_checks.protocol import data_at_fault
from elastocal.diagnosis.words import in_words
from elastocal.loop.error_table import error_rows
from elastocal.report.first_page import (
    AT_FAULT,
    TITLES,
    cause_rows,
    headline,
    held_out_sentence,
    probability_sentence,
    sentences,
    what_to_do,
    whose_errors,
)
from elastocal.report.loop_effects import NONE_FOUND, effect_facts
from elastocal.report.loop_errors import as_judged, range_sentence, remainder_sentence, split_rows, step_rows
from elastocal.report.loop_experiment import experiment_facts
from elastocal.report.loop_measurements import NOISE_SOURCES, made, measured, misfit_sentence, noise_rows
from elastocal.report.loop_method import method, setting_rows, untestable_rows
from elastocal.report.loop_parameters import compliance_rows, held_rows, left_to_priors, other_parameters
from elastocal.report.typesetting import compile_document
from elastocal.report.wording import as_sentence, length, minus

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    import numpy as np

    from elastocal.io.origin import Origin


def loop_facts(
    verdict: Mapping[str, Any],
    steps: Sequence[Mapping[str, Any]],
    splits: Sequence[dict[str, Any]],
    experiment: Sequence[Mapping[str, Any]],
    table: Mapping[str, np.ndarray],
    descriptions: Mapping[str, Any],
    parameters: Mapping[str, np.ndarray],
) -> dict[str, Any]:
    """Facts for the report of a campaign.

    `verdict`: contents of verdict.json. `steps`, `splits`, `experiment`: rows of before_after.csv, splits.csv and
    next_experiment.csv. `table`, `parameters` (N,): columns of the residuals and of the parameters of the final model.
    `descriptions`: contents of campaign.json. Returns JSON-serialisable; strings ready to print, lists for tables.
    """
    faulty = data_at_fault(verdict)
    # Probabilities are then those from before the measurements.
    searched = {entry["name"] for effect in verdict["effects"] for entry in effect["parameters"] if entry.get("shape")}
    untested = verdict["verdict"] == "not_testable"
    floor = verdict["heldout"]["noise_floor_rms_m"]
    return {
        "campaign": verdict["campaign"],
        "robot": descriptions["robot"]["name"],
        "made": made(descriptions["campaign"]),
        "verdict": AT_FAULT if faulty else TITLES[verdict["verdict"]],
        "faulty": faulty,
        "headline": headline(verdict),
        "sentences": sentences(verdict),
        "causes": [] if untested else cause_rows(verdict),
        "probabilities": "" if faulty or untested else probability_sentence(verdict["probabilities"]),
        "now": what_to_do(verdict, experiment),
        "warnings": [] if faulty else [_with_minus(as_sentence(in_words(warning))) for warning in verdict["warnings"]],
        "held_out_sentence": "" if faulty else held_out_sentence(verdict, steps),
        "accuracy": _accuracy(verdict),
        "errors": error_rows(verdict),
        "measured": measured(table, descriptions),
        "noise": noise_rows(verdict["noise"], descriptions["campaign"]["measured"] == "pose"),
        "noise_source": NOISE_SOURCES[verdict["noise"]["source"]],
        "misfit": misfit_sentence(verdict["misfit"]),
        "floor": length(floor),
        "steps": step_rows(steps, floor),
        "splits": split_rows(as_judged(splits, steps, verdict["heldout"])),
        "range": range_sentence(verdict["heldout"]),
        "remainder": "" if faulty else remainder_sentence(verdict["remainder"], verdict["heldout"]),
        "effects": [effect_facts(effect, verdict["heldout"]) for effect in verdict["effects"]],
        "none_found": NONE_FOUND.get(verdict["verdict"], NONE_FOUND["adequate"]),
        "experiment": experiment_facts(experiment, verdict.get("next_experiment")),
        "compliances": compliance_rows(verdict["compliance_urad_per_Nm"]),
        "compliances_identified": any(verdict["compliance_urad_per_Nm"]["std_error"]),
        "held": held_rows([*(name for name in verdict["held"] if name not in searched), *left_to_priors(parameters)]),
        "untestable": untestable_rows(verdict["untestable"]),
        "others": other_parameters(verdict, parameters),
        "method": method(verdict, descriptions),
        "settings": setting_rows(verdict["settings"]),
        "found": [effect["name"] for effect in verdict["effects"]],
    }


def write_loop_report(path: str | Path, facts: dict[str, Any], figures: Sequence[str], origin: Origin | None = None) -> None:
    """Compile the report of a campaign; the file appears whole or not at all.

    `path`: the PDF. `facts`: from `loop_facts`. `figures`: PDF files, named before_after, residuals, arrows, candidates and,
    where there are pairs, confounding. `origin`: named in the foot of each page.
    """
    names = [Path(figure).stem for figure in figures]
    compile_document(path, "loop.typ", {"facts": facts | {"figures": names}}, figures, origin)


def _accuracy(verdict: Mapping[str, Any]) -> str:
    if not verdict.get("accuracy"):
        return ""
    stated = accuracy_from(verdict["accuracy"])
    return f"{accuracy_sentence(stated)} {whose_errors(verdict['heldout']['after']['rms_m'], stated)}"


def _with_minus(text: str) -> str:
    """A sentence whose numbers have a true minus sign."""
    return re.sub(r"(?<= )-(?=\d)", minus("-"), text)
