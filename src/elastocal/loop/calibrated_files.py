"""The calibrated robot of a campaign that was diagnosed, from the tables of its diagnosis, without a fit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.scope import calibrated_on, with_form
from elastocal.campaigns.columns import columns_of
from elastocal.errors import InputError
from elastocal.fitting.case import case_from, noise_from
from elastocal.io.checksums import check_checksums
from elastocal.io.json_files import read_json
from elastocal.io.storage import read_table
from elastocal.loop.diagnosis_tables import final_parameters, rows_left_out, step_model
from elastocal.loop.fit_columns import covariance_from
from elastocal.loop.loading import load_campaign
from elastocal.loop.schemas import CORRELATIONS, STEPS, measurements

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.fitting.case import Case

# Of results/loop/<campaign>/.
DESCRIPTIONS, TRAINING, HELD_OUT, DIAGNOSIS = "campaign.json", "training.parquet", "held_out.parquet", "diagnosis.json"
STEPS_TABLE, CORRELATIONS_TABLE = "steps.parquet", "correlations.parquet"
_FILES = (DESCRIPTIONS, TRAINING, HELD_OUT, DIAGNOSIS, STEPS_TABLE, CORRELATIONS_TABLE)


@dataclass(frozen=True)
class Diagnosed:
    """A campaign and what its diagnosis found.

    Attributes
    ----------
    name : str
        Of the campaign.
    case : Case
        Of the training poses, without their gross errors.
    calibrated : CalibratedRobot
        By the final model.
    verdict : dict
        As verdict.json, without what held-out poses say.
    """

    name: str
    case: Case
    calibrated: CalibratedRobot
    verdict: dict[str, Any]


def load_diagnosed(folder: str | Path, robots_folder: str | Path, results: str | Path) -> Diagnosed:
    """A campaign that was diagnosed and has not changed since.

    Parameters
    ----------
    folder, robots_folder : str or Path
        As in `reading.read_campaign`.
    results : str or Path
        Holds a folder for each campaign with the tables of its diagnosis.

    Returns
    -------
    Diagnosed

    Raises
    ------
    InputError
        Not diagnosed, changed since, or a file of the diagnosis that is no longer what the pipeline wrote.
    """
    descriptions, *parts = load_campaign(folder, robots_folder)
    name = descriptions["campaign"]["campaign"]
    tables = Path(results).absolute() / name
    again = f"a campaign as it was diagnosed: elastocal diagnose {folder}"
    if not all((tables / file).is_file() for file in _FILES):
        raise InputError(folder, "", f"no diagnosis of it in {results}", again)
    # Of a job Snakemake's script does it; here people and their editors have been at the files.
    top = tables.parents[2]
    check_checksums([(tables / file).relative_to(top).as_posix() for file in _FILES], top)
    columns = [columns_of(part) for part in parts]
    kept = [
        read_table(tables / file, measurements(part.joint_angles.shape[1]))
        for file, part in zip((TRAINING, HELD_OUT), parts, strict=True)
    ]
    same = _described(read_json(tables / DESCRIPTIONS)) == _described(descriptions)
    if not (same and all(map(_same, kept, columns))):
        raise InputError(folder, "", "changes since its diagnosis", again)
    facts, steps = read_json(tables / DIAGNOSIS), read_table(tables / STEPS_TABLE, STEPS)
    case = case_from(descriptions, columns[0])
    case = case.select(~rows_left_out(case, facts))
    last = len(facts["steps"]) - 1
    model, estimate = step_model(case, facts, steps, last)
    covariance = covariance_from(final_parameters(facts, steps), read_table(tables / CORRELATIONS_TABLE, CORRELATIONS))
    noise = noise_from({"noise": facts["steps"][last]["noise"]})
    calibrated = calibrated_on(case, model, estimate, covariance, noise)
    calibrated = with_form(calibrated, facts["document"].get("other_models_m") or 0.0)
    return Diagnosed(name, case, calibrated, facts["document"])


def judged_as(found: Diagnosed, verdict: Mapping[str, Any]) -> Diagnosed:
    """A diagnosed campaign whose predicted errors are as large as verdict.json says after a look at held-out poses."""
    stated = verdict.get("accuracy")
    if not stated:
        return found
    return replace(found, calibrated=with_form(found.calibrated, stated["form_m"], stated["contradicted"]))


def _described(descriptions: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """What a campaign says of itself, wherever its folder is."""
    if descriptions is None:
        return None
    return {**descriptions, "source": "", "held_out": _described(descriptions.get("held_out"))}


def _same(one: Mapping[str, np.ndarray], other: Mapping[str, Any]) -> bool:
    def equal(a: np.ndarray, b: np.ndarray) -> bool:
        return a.shape == b.shape and bool(((a == b) | ((a != a) & (b != b))).all())

    return set(one) == set(other) and all(equal(np.asarray(one[name]), np.asarray(other[name])) for name in one)
