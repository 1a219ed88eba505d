"""What a campaign says of its held-out poses: errors of each model by pinocchio, and where they are reported again.

Intervals over poses are held against each other and against what they are of; how they are drawn is a matter of tests.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal_proof.audit.elastic import STATE, Averages, averages, far_off, good_rows
from elastocal_proof.audit.findings import Finding, compare, require
from elastocal_proof.audit.fits import Campaign, Step, campaign_of, unsettled

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal_proof.audit.audited import Audited

_METRICS = ("mean", "rms", "p95", "max")
# Nine digits of a table.
_DIGITS = 1e-8
_STATES = ("before", "after")


def measure(distance: np.ndarray, unit: float = 1.0) -> list[float]:
    """Mean, RMS, 95th percentile and maximum of errors (M,)."""
    size = unit * distance
    return [size.mean(), np.sqrt((size**2).mean()), np.percentile(size, 95), size.max()]


def before_after(run: Audited, file: str, campaign: str) -> Iterator[Finding]:
    """Errors of every model on fitted and held-out poses by pinocchio, and what is counted and divided.

    Where some model is not written down here, nothing is found.
    """
    known = campaign_of(run, campaign)
    if known is None or any(step is None for step in known.steps):
        return
    steps, table = [step for step in known.steps if step is not None], run.table(file)
    expected = [int(step.free.sum()) for step in steps]
    yield compare("parameters of each model", "counting", table["parameters"], expected, 0.0)
    unseen = averages(good_rows(run, campaign, "held_out"), known.poses)
    for place, row in enumerate(table.to_dict("records")):
        for part, seen in (("train", known.seen), ("heldout", unseen)):
            loaded = known.robot.all_loaded(steps[place].springs, seen)
            found = measure(np.linalg.norm(known.robot.residuals(loaded, seen)[:, :3], axis=1))
            stored = [row[f"{part}_{name}_m"] for name in _METRICS]
            allowed = unsettled(steps[place], known)
            yield compare(f"{part} errors of step {place}", "pinocchio", stored, found, _DIGITS, allowed)
    for name in _METRICS:
        value, low, high = (table[f"heldout_{name}_m{end}"] for end in ("", "_low", "_high"))
        inside = ((low.isna() | (low <= value)) & (high.isna() | (value <= high))).all()
        yield require(f"intervals hold the {name}", "pandas", inside, "one does not", len(table))
    over_floor = table[[f"heldout_{name}_over_floor" for name in _METRICS]]
    ratio = table[[f"heldout_{name}_m" for name in _METRICS]] / _floor(known, steps[-1], unseen)
    yield compare("errors over what the noise leaves", "pinocchio", over_floor, ratio, 1e-7)


def _floor(known: Campaign, step: Step, seen: Averages) -> float:
    """RMS error that the noise leaves: of the sensor in three directions, and of the joints as the target sees them."""
    noise, robot = step.noise, known.robot
    jacobian = robot.jacobians(robot.all_loaded(step.springs, seen), seen)[:, :3, : robot.joints]
    variance = 3 * noise["position_m"] ** 2 + ((jacobian * noise["joint_rad"]) ** 2).sum(axis=(1, 2))
    return float(np.sqrt((variance / seen.repeats).mean()))


def verdict(run: Audited, file: str, campaign: str) -> Iterator[Finding]:
    """The verdict says what the diagnosis reported, and of held-out poses what the residuals say."""
    stated, diagnosed = run.document(file), run.document(f"results/loop/{campaign}/diagnosis.json")["document"]
    own = ("effects", "heldout", "remainder", "warnings")
    off = [name for name in diagnosed if name not in own and stated.get(name) != diagnosed[name]]
    off += ["warnings"] * (stated["warnings"][: len(diagnosed["warnings"])] != diagnosed["warnings"])
    judged = dict.fromkeys(("heldout_gain", "cost_m"))
    pairs = zip(stated["effects"], diagnosed["effects"], strict=True)
    off += [reported["name"] for reported, found in pairs if reported | judged != found | judged]
    yield require("what the diagnosis reported", "diagnosis.json", not off, ", ".join(off), len(diagnosed))
    springs = run.table(f"results/loop/{campaign}/steps.parquet").query("owner == 'joint_compliance'")
    if len(springs):
        declared = 1e6 * springs[springs["step"] == springs["step"].min()]["value"]
        yield compare("compliances of the declared model", "pandas", stated["compliance_urad_per_Nm"]["before"], declared)
    errors, reported = _of_residuals(run, campaign), stated["heldout"]
    if errors is None or reported is None:
        return
    outside = errors["outside"].to_numpy()
    for state in _STATES:
        stored = {"": (reported[state], np.full(len(errors), True))}
        for name, chosen in (("inside", ~outside), ("outside", outside)):
            if chosen.any():
                stored[f" {name} the range of the fitted poses"] = reported["outside_range"][name][state], chosen
        for words, (figures, chosen) in stored.items():
            expected = measure(errors[state].to_numpy()[chosen])
            yield compare(f"errors {state}{words}", "pandas", [figures[f"{name}_m"] for name in _METRICS], expected, _DIGITS)
    poses = errors.groupby(["session", "pose"])
    figures = [reported["poses"], reported["share_below_max"], reported["outside_range"]["poses"]]
    numbered = [poses.ngroups, 0.05 ** (1 / poses.ngroups), poses["outside"].any().sum()]
    yield compare("poses, share below the largest error", "Wilks' limit", figures, numbered)
    # Of as many poses a standard error is the same by whatever draws the ends of intervals are found.
    yield compare("standard error of the reduction", "jackknife", reported["reduction_std_error"], _jackknife(errors), _DIGITS)
    table = run.table(f"reports/loop/{campaign}/before_after.csv")
    floor = (table["heldout_rms_m"] / table["heldout_rms_over_floor"]).iloc[-1]
    left = np.nan if reported["noise_floor_rms_m"] is None else reported["noise_floor_rms_m"]
    yield compare("what the noise leaves", "pandas", left, floor, 2 * _DIGITS)
    # Share by which each effect lowers the RMS, from the rows of the table of models.
    fall = dict(zip(table["step"], -table["heldout_rms_m"].pct_change(), strict=True))
    gains = {each["name"]: each["heldout_gain"] for each in stated["effects"] if each["heldout_gain"] is not None}
    yield compare(
        "gain of each effect", "pandas", [*gains.values()], [fall[f"with {name}"] for name in gains], absolute=_DIGITS
    )


def splits(run: Audited, file: str, campaign: str) -> Iterator[Finding]:
    """Errors on the held-out poses; what rows say of each other."""
    table = run.table(file)
    ratio = 1 - table["after_rms_m"] / table["before_rms_m"]
    yield compare("reductions", "pandas", table["reduction"], ratio, absolute=_DIGITS)
    for value in ("before_rms_m", "after_rms_m", "reduction"):
        inside = (table[f"{value}_low"] <= table[value]) & (table[value] <= table[f"{value}_high"])
        yield require(f"intervals hold their {value}", "pandas", inside.all(), "one does not", len(table))
    for split, rows in table[table["split"] != "held out"].groupby("split"):
        whole = rows["block"] == "all"
        yield compare(f"poses of {split}", "counting", rows["poses"][whole], [rows["poses"][~whole].sum()], 0.0)
    if (errors := _of_residuals(run, campaign)) is not None:
        expected = [*np.sqrt((errors[[*_STATES]] ** 2).mean()), _jackknife(errors)]
        stored = table[table["split"] == "held out"][["before_rms_m", "after_rms_m", "reduction_std_error"]]
        yield compare(
            "held-out errors, standard error of the reduction", "jackknife", stored, expected, _DIGITS, scale=expected
        )


def _of_residuals(run: Audited, campaign: str) -> pd.DataFrame | None:
    """Held-out errors before and after from the residuals of a campaign whose test is part of it."""
    unseen = good_rows(run, campaign, "held_out")
    another = run.document(f"results/loop/{campaign}/campaign.json").get("held_out") is not None
    # Of approaches the residuals do not say which they were.
    if another or unseen["approach1"].notna().any():
        return None
    frame = run.table(f"reports/loop/{campaign}/residuals.parquet")
    rows = frame[frame["held_out"] & ~frame["gross_error"] & ~frame["row"].isin(unseen.loc[far_off(unseen), "row"])]
    outside = rows.groupby(["session", "pose"])["outside_range"].any().rename("outside")
    return _errors(rows).join(outside, on=["session", "pose"])


def _errors(rows: pd.DataFrame) -> pd.DataFrame:
    """Errors before and after of the mean of what was repeated, from rows of residuals."""
    means = rows.groupby([*STATE, "target"])[[f"{state}_d{axis}" for state in _STATES for axis in "xyz"]].mean()
    sizes = np.linalg.norm(means.to_numpy().reshape(-1, 2, 3), axis=2)
    return pd.DataFrame(sizes, means.index, [*_STATES])


def _jackknife(errors: pd.DataFrame) -> float:
    """Standard error of the share by which the RMS falls, by leaving out each pose (Efron and Tibshirani)."""
    squares = (errors[[*_STATES]] ** 2).groupby(["session", "pose"]).sum()
    left = squares.sum() - squares
    ratio = np.sqrt(squares["after"].sum() / squares["before"].sum())
    return float(ratio / 2 * np.sqrt((len(squares) - 1) * np.log(left["after"] / left["before"]).var(ddof=0)))


def summary(run: Audited, file: str) -> Iterator[Finding]:
    """All campaigns on one page, from their verdicts and residuals; of campaigns that are pooled, as folds of one, nothing."""
    # Without any campaign a table without columns.
    table = run.table(file) if (run.folder / file).read_text("utf-8").strip() else pd.DataFrame({"campaign": []})
    if file.endswith("campaigns.csv"):
        asked = run.configuration["loop"]["campaigns"]
        right = sorted(table["campaign"]) == sorted(asked)
        yield require("every campaign once", "config.yaml", right, f"{list(table['campaign'])}", len(asked))
    for row in table.to_dict("records"):
        name = row["campaign"]
        if not run.has(f"reports/loop/{name}/verdict.json"):
            continue
        stated = run.document(f"reports/loop/{name}/verdict.json")
        effects = [
            each["name"] + f" (joint {', '.join(map(str, each['joints']))})" * bool(each["joints"])
            for each in stated["effects"]
        ]
        words = [row["verdict"], row["effects"]] == [stated["verdict"], " + ".join(effects) or "none"]
        yield require(f"verdict of {name}", "verdict.json", words, str(row["effects"]))
        frame = run.table(f"reports/loop/{name}/residuals.parquet")
        errors = _errors(frame[frame["held_out"] & ~frame["gross_error"] & (frame["session"] == row["session"])])
        expected: dict[str, Any] = {"poses": errors.groupby(["session", "pose"]).ngroups}
        for state in _STATES:
            figures = measure(errors[state].to_numpy(), 1e3)
            expected |= {f"{state}_{metric}_mm": value for metric, value in zip(_METRICS, figures, strict=True)}
        scale = [*expected.values()]
        yield compare(f"errors of {name}", "pandas", [row[key] for key in expected], scale, 1e-7, scale=scale)
        inside = all(row[f"{state}_rms_low_mm"] <= row[f"{state}_rms_mm"] <= row[f"{state}_rms_high_mm"] for state in _STATES)
        yield require(f"intervals of {name} hold their errors", "pandas", inside, "one does not", 2)


CHECKS = {
    "reports/loop/{campaign}/before_after.csv": before_after,
    "reports/loop/{campaign}/verdict.json": verdict,
    "reports/loop/{campaign}/splits.csv": splits,
    "reports/loop/campaigns.csv": summary,
    "reports/loop/measured.csv": summary,
}
