"""What a campaign says of its held-out poses: errors of each model with intervals, and where they are reported again."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.audit.elastic import STATE, Averages, averages, far_off, good_rows
from elastocal.audit.findings import Finding, compared, held
from elastocal.audit.fits import Campaign, Step, campaign_of, unsettled
from elastocal.audit.intervals import Errors, distances, drawn, limits, metrics, reduction
from elastocal.audit.streams import numbers

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.audit.audited import Audited

_METRICS = ("mean", "rms", "p95", "max")
# Nine digits of a table.
_DIGITS = 1e-8
# What a fit that is read from a file moves on by, as a share of an interval's end.
_OF_ENDS = 1e-5
_BY = "numpy's Philox stream, jackknife"


def before_after(run: Audited, file: str, campaign: str) -> list[Finding]:
    """Errors of every model on fitted and held-out poses, their intervals, and what is counted and divided.

    Returns by pinocchio's predictions; of a model that is not written down there the intervals are left out.
    """
    known = campaign_of(run, campaign)
    if known is None or any(step is None for step in known.steps):
        return []
    steps = [step for step in known.steps if step is not None]
    table = run.table(file)
    found = [_counts(file, table, steps)]
    fitted, unseen = (averages(good_rows(run, campaign, part), known.poses) for part in ("training", "held_out"))
    of_fitted, errors = (Errors(_distances(known, steps, seen), seen.pose) for seen in (fitted, unseen))
    counts = drawn(_stream(run, campaign, "held-out poses"), errors.poses)
    by = "pinocchio"
    for number, row in table.iterrows():
        place = int(str(number))
        head, settled = f"of step {place}", unsettled(steps[place], fitted, known.robot)
        for part, of_part in (("train", of_fitted), ("heldout", errors)):
            expected = metrics(of_part.distances[place])
            stored = [row[f"{part}_{name}_m"] for name in _METRICS]
            found.append(
                compared(file, f"{part} errors {head}", by, stored, [expected[name] for name in _METRICS], _DIGITS, settled)
            )
        ends = limits(errors, counts, place)
        for name in _METRICS:
            stored = [row[f"heldout_{name}_m_{end}"] for end in ("low", "high")]
            found.append(compared(file, f"interval of the {name} {head}", _BY, stored, ends[name], _OF_ENDS, settled))
    over_floor = table[[f"heldout_{name}_over_floor" for name in _METRICS]]
    errors_m = table[[f"heldout_{name}_m" for name in _METRICS]]
    floor = _floor(known, steps[-1], unseen)
    return [*found, compared(file, "errors over what the noise leaves", by, over_floor, errors_m / floor, 1e-7)]


def _counts(file: str, table: pd.DataFrame, steps: Sequence[Step]) -> Finding:
    expected = [len(step.parameters) - int(step.parameters["held"].sum()) for step in steps]
    return compared(file, "parameters of each model", "counting", table["parameters"], expected, 0.0)


def _distances(known: Campaign, steps: Sequence[Step], seen: Averages) -> tuple[np.ndarray, ...]:
    robot = known.robot
    return distances([robot.residuals(robot.all_loaded(step.springs, seen), seen) for step in steps])


def _floor(known: Campaign, step: Step, seen: Averages) -> float:
    """RMS error that the noise leaves: of the sensor in three directions, and of the joints as the target sees them."""
    noise, robot = step.noise, known.robot
    jacobian = robot.jacobians(robot.all_loaded(step.springs, seen), seen)[:, :3, : robot.joints]
    variance = 3 * noise["position_m"] ** 2 + ((jacobian * noise["joint_rad"]) ** 2).sum(axis=(1, 2))
    return float(np.sqrt((variance / seen.repeats).mean()))


def verdict(run: Audited, file: str, campaign: str) -> list[Finding]:
    """The verdict says what the diagnosis reported, and of held-out poses what the residuals say."""
    stated, diagnosed = run.document(file), run.document(f"results/loop/{campaign}/diagnosis.json")["document"]
    own = ("effects", "heldout", "remainder", "warnings")
    off = [name for name in diagnosed if name not in own and stated.get(name) != diagnosed[name]]
    kept = stated["warnings"][: len(diagnosed["warnings"])] == diagnosed["warnings"]
    off += [] if kept else ["warnings"]
    pairs = zip(stated["effects"], diagnosed["effects"], strict=True)
    judged = dict.fromkeys(("heldout_gain", "cost_m"))
    off += [reported["name"] for reported, found in pairs if reported | judged != found | judged]
    found = [held(file, "what the diagnosis reported", "diagnosis.json", not off, ", ".join(off), len(diagnosed))]
    springs = run.table(f"results/loop/{campaign}/steps.parquet").query("owner == 'joint_compliance'")
    declared = springs[springs["step"] == springs["step"].min()]["value"]
    if len(declared):
        before = stated["compliance_urad_per_Nm"]["before"]
        found.append(compared(file, "compliances of the declared model", "pandas", before, 1e6 * declared))
    errors = _of_residuals(run, campaign)
    if errors is None or stated["heldout"] is None:
        return found
    return [*found, *_stated_errors(run, file, campaign, stated["heldout"], errors), _gains(run, file, campaign, stated)]


def _stated_errors(run: Audited, file: str, campaign: str, reported: dict[str, Any], errors: Errors) -> list[Finding]:
    found = []
    for number, state in enumerate(("before", "after")):
        everywhere = metrics(errors.distances[number])
        checked = [(f"errors {state}", reported[state], everywhere)]
        for name, chosen in (("inside", ~errors.outside), ("outside", errors.outside)):
            if chosen.any():
                some = metrics(errors.distances[number][chosen])
                checked.append(
                    (f"errors {state} {name} the range of the fitted poses", reported["outside_range"][name][state], some)
                )
        for words, stored, expected in checked:
            values = [stored[f"{name}_m"] for name in _METRICS]
            found.append(compared(file, words, "pandas", values, [expected[name] for name in _METRICS], _DIGITS))
    counts = drawn(_stream(run, campaign, "held-out poses"), errors.poses)
    fallen = reduction(errors, counts, 0, 1)
    stored = [*reported["reduction_ci95"], reported["reduction_std_error"]]
    found.append(compared(file, "reduction: interval and standard error", _BY, stored, fallen, _DIGITS))
    stored = [reported["poses"], reported["share_below_max"], reported["outside_range"]["poses"]]
    numbered = [errors.poses, 0.05 ** (1 / errors.poses), len(np.unique(errors.pose[errors.outside]))]
    found.append(compared(file, "poses, share below the largest error", "Wilks' limit", stored, numbered))
    last = run.table(f"reports/loop/{campaign}/before_after.csv").iloc[-1]
    floor = last["heldout_rms_m"] / last["heldout_rms_over_floor"]
    stated = np.nan if reported["noise_floor_rms_m"] is None else reported["noise_floor_rms_m"]
    return [*found, compared(file, "what the noise leaves", "pandas", stated, floor, 2 * _DIGITS)]


def _gains(run: Audited, file: str, campaign: str, stated: dict[str, Any]) -> Finding:
    """Share by which each effect lowers the RMS, from the rows of the table of models."""
    rows = run.table(f"reports/loop/{campaign}/before_after.csv").set_index("step")["heldout_rms_m"]
    gains = {effect["name"]: effect["heldout_gain"] for effect in stated["effects"] if effect["heldout_gain"] is not None}
    places = [list(rows.index).index(f"with {name}") for name in gains]
    expected = [1 - rows.iloc[place] / rows.iloc[place - 1] for place in places]
    return compared(file, "gain of each effect", "pandas", list(gains.values()), expected, absolute=_DIGITS)


def splits(run: Audited, file: str, campaign: str) -> list[Finding]:
    """Errors on the held-out poses with their intervals; of other splits what rows say of each other."""
    table, found = run.table(file), []
    by = "pandas"
    ratio = 1 - table["after_rms_m"] / table["before_rms_m"]
    found.append(compared(file, "reductions", by, table["reduction"], ratio, absolute=_DIGITS))
    bounds = [("before_rms_m", "before_rms_m"), ("after_rms_m", "after_rms_m"), ("reduction", "reduction")]
    inside = [
        bool(table[f"{end}_low"].le(table[value]).all() and table[value].le(table[f"{end}_high"]).all())
        for end, value in bounds
    ]
    found.append(held(file, "intervals hold their estimates", by, all(inside), "one does not", 3 * len(table)))
    for split, rows in table[table["split"] != "held out"].groupby("split"):
        whole, parts = rows[rows["block"] == "all"], rows[rows["block"] != "all"]
        found.append(compared(file, f"poses of {split}", "counting", whole["poses"], [parts["poses"].sum()], 0.0))
    errors = _of_residuals(run, campaign)
    if errors is None:
        return found
    counts = drawn(_stream(run, campaign, "splits"), errors.poses)
    row = table[table["split"] == "held out"].iloc[0]
    stored = [row[f"{state}_rms_m{end}"] for state in ("before", "after") for end in ("", "_low", "_high")]
    expected = [
        each for model in (0, 1) for each in (metrics(errors.distances[model])["rms"], *limits(errors, counts, model)["rms"])
    ]
    stored += [row[f"reduction{end}"] for end in ("_low", "_high", "_std_error")]
    expected += reduction(errors, counts, 0, 1)
    return [
        *found,
        compared(file, "held-out errors and their intervals", _BY, stored, expected, scale=np.abs(expected), relative=_DIGITS),
    ]


def _of_residuals(run: Audited, campaign: str) -> Errors | None:
    """Held-out errors before and after from the residuals of a campaign whose test is part of it."""
    described = run.document(f"results/loop/{campaign}/campaign.json")
    unseen = good_rows(run, campaign, "held_out")
    # Of approaches the residuals do not say which they were.
    if described.get("held_out") is not None or unseen["approach1"].notna().any():
        return None
    frame = run.table(f"reports/loop/{campaign}/residuals.parquet")
    rows = frame[frame["held_out"] & ~frame["gross_error"] & ~frame["row"].isin(unseen.loc[far_off(unseen), "row"])]
    errors = _errors(rows)
    outside = rows.groupby(["session", "pose"])["outside_range"].any().to_numpy()[errors.pose]
    return replace(errors, outside=outside)


def _errors(rows: pd.DataFrame) -> Errors:
    """Errors before and after of the mean of what was repeated, from rows of residuals; poses by their number."""
    means = rows.groupby([*STATE, "target"])[[f"{state}_d{axis}" for state in ("before", "after") for axis in "xyz"]].mean()
    values = means.to_numpy()
    return Errors(distances([values[:, :3], values[:, 3:]]), means.groupby(["session", "pose"]).ngroup().to_numpy())


def summary(run: Audited, file: str) -> list[Finding]:
    """All campaigns on one page, from their verdicts and residuals.

    Returns of campaigns that are pooled, as folds of one, nothing.
    """
    # Without any campaign a table without columns.
    table = run.table(file) if (run.folder / file).read_text("utf-8").strip() else pd.DataFrame({"campaign": []})
    found = []
    if file.endswith("campaigns.csv"):
        asked = run.configuration["loop"]["campaigns"]
        right = sorted(table["campaign"]) == sorted(asked)
        found.append(held(file, "every campaign once", "config.yaml", right, f"{list(table['campaign'])}", len(asked)))
    for row in table.to_dict("records"):
        name = row["campaign"]
        if not run.there(f"reports/loop/{name}/verdict.json"):
            continue
        stated = run.document(f"reports/loop/{name}/verdict.json")
        named = [
            f"{effect['name']} (joint {', '.join(map(str, effect['joints']))})" if effect["joints"] else effect["name"]
            for effect in stated["effects"]
        ]
        words = [row["verdict"], row["effects"]] == [stated["verdict"], " + ".join(named) or "none"]
        found.append(held(file, f"verdict of {name}", "verdict.json", words, str(row["effects"])))
        frame = run.table(f"reports/loop/{name}/residuals.parquet")
        errors = _errors(frame[frame["held_out"] & ~frame["gross_error"] & (frame["session"] == row["session"])])
        counts = drawn(numbers(run.seed, name, "summary", row["session"]), errors.poses)
        expected, stored = [float(errors.poses)], [row["poses"]]
        for model, state in enumerate(("before", "after")):
            figures = metrics(errors.distances[model])
            expected += [1e3 * figures[key] for key in _METRICS]
            stored += [row[f"{state}_{key}_mm"] for key in _METRICS]
            expected += [1e3 * each for each in limits(errors, counts, model)["rms"]]
            stored += [row[f"{state}_rms_{end}_mm"] for end in ("low", "high")]
        expected += reduction(errors, counts, 0, 1)[:2]
        stored += [row[f"rms_reduction_{end}"] for end in ("low", "high")]
        found.append(
            compared(
                file, f"errors of {name} and their intervals", _BY, stored, expected, scale=np.abs(expected), relative=1e-7
            )
        )
    return found


def _stream(run: Audited, campaign: str, purpose: str) -> np.random.Generator:
    described = run.document(f"results/loop/{campaign}/campaign.json")
    return numbers(run.seed, described["campaign"]["campaign"], purpose, 0)


CHECKS = (
    (re.compile(r"reports/loop/([^/]+)/before_after\.csv"), before_after),
    (re.compile(r"reports/loop/([^/]+)/verdict\.json"), verdict),
    (re.compile(r"reports/loop/([^/]+)/splits\.csv"), splits),
    (re.compile(r"reports/loop/(?:campaigns|measured)\.csv"), summary),
)
