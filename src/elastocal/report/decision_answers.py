"""Numbers that the text states about many studies and about decisions, already worded."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.study.designs import TEST_POSE
from elastocal.study.tables import word_value

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

# Of the joint test: the paper, then the studies.
_ENDS = ("", "_studies_median", "_studies_largest", "_p")
# Designs as people call them, in the order of the tables.
DESIGN_NAMES = {"random": "random", "D": "D", "A": "A", "I": "I", TEST_POSE: "test pose"}


def measured_rows(table: pd.DataFrame, titles: Mapping[str, str]) -> list[dict[str, str]]:
    """Table 4 over studies, a row for each estimator on each robot.

    `table`: from `study_tables.measured_table`. Returns robot, strategy and, for each kind of measurement and average, as
    "pose stiffness 0" to "pose stiffness 3", the figures of Table 4; "fixed 0" and "fixed 1": k_sigma over the fixed joints.
    """
    rows = []
    for robot, title in titles.items():
        seen: set[float] = set()
        mine = table[table.robot == robot]
        usual = mine[(mine.measured == "pose") & (mine.average == "stiffness")].set_index("strategy")
        for strategy in usual.index:
            names = _figure_columns(usual)
            # One estimator under another name; the fixed joints of its last stage are fewer, perhaps.
            key = float(f"{usual[names[2]][strategy]:.6g}")
            if key in seen and usual[_fixed(names[0])][strategy] == usual[names[0]][strategy]:
                continue
            seen.add(key)
            row = {"robot": title, "strategy": strategy}
            for (measured, average), cell in mine[mine.strategy == strategy].groupby(["measured", "average"], sort=False):
                for place, name in enumerate(names):
                    row[f"{measured} {average} {place}"] = _cell(cell.iloc[0], name)
            row |= {f"fixed {place}": _cell(usual.loc[strategy], _fixed(names[place])) for place in (0, 1)}
            rows.append(row)
    return rows


def study_facts(table: pd.DataFrame, robot: str, classical: str, best: str) -> dict[str, str]:
    """What studies say of the classical strategy and the best one on one robot.

    `table`: as in `measured_table`. Returns dev, rms and their ratio of the classical strategy; ratio: its dev over that of the
    best; compliance_dev and compliance_k: of averaged compliances; one_k and one_dev: of positions of one reflector.
    """
    mine = table[table.robot == robot]
    keys = mine[["strategy", "measured", "average"]].itertuples(index=False, name=None)
    at: dict[Any, Any] = dict(zip(keys, mine.to_dict("records"), strict=True))
    plain, other = at[classical, "pose", "stiffness"], at[best, "pose", "stiffness"]
    k, _, dev, _ = _figure_columns(table)
    rms = next(name for name in table.columns if name.startswith("rms_") and not name.endswith("_std"))
    found = {
        "dev": _cell(plain, dev),
        "rms": _cell(plain, rms),
        "hidden": f"{plain[rms] / plain[dev]:.1f}",
        "ratio": f"{plain[dev] / other[dev]:.2f}",
        "compliance_dev": _cell(at[classical, "pose", "compliance"], dev),
        "compliance_k": _cell(at[classical, "pose", "compliance"], k),
    }
    if (one := at.get((classical, "one reflector", "stiffness"))) is not None:
        found |= {"one_k": _cell(one, k), "one_dev": _cell(one, dev), "one_rms": _cell(one, rms)}
    return found


def joint_rows(table: pd.DataFrame) -> list[dict[str, str]]:
    """The joint test under both counts of joints, from `joint_test.joint_table`."""
    rows = []
    for row in table.itertuples():
        found = {"joints": str(row.joints), "cells": f"{row.cells}", "differ": f"{row.differ}", "studies": f"{row.studies}"}
        for name in ("below", "statistic"):
            value, middle, largest, p = (getattr(row, name + end) for end in _ENDS)
            found |= {name: f"{value:.0f}", f"{name}_studies": f"{middle:.0f} (to {largest:.0f})", f"{name}_p": f"{p:.2f}"}
        rows.append(found)
    return rows


def claim_rows(table: pd.DataFrame, titles: Mapping[str, str]) -> list[dict[str, str]]:
    """The claims table with p in words; what is found is given once where both counts of joints are the same."""
    named = re.compile(rf"\b({'|'.join(map(re.escape, titles))})\b")
    rows = []
    for row in table.itertuples():
        literal, ours = str(row.literal), str(row.ours)
        found = literal if literal == ours else f"all joints: {literal}; fixed joints: {ours}"
        found = named.sub(lambda match: titles[match[0]], found)
        p = "" if np.isnan(float(str(row.p))) else f"{row.p:.2g}"
        words = {"number": f"{row.number}", "place": str(row.place), "claim": str(row.claim), "found": found, "p": p}
        rows.append(words | {"verdict": str(row.verdict)})
    return rows


def break_even_rows(table: pd.DataFrame, accuracy_um: float, titles: Mapping[str, str]) -> list[dict[str, str]]:
    """From which cost of a configuration each set of points pays, from `costs.break_even_table`."""
    rows = []
    for row in table[(table.accuracy_um == accuracy_um) & table.robot.isin([*titles])].itertuples():
        even = f"{_cost(row.break_even)} ({_cost(row.break_even_low)} to {_cost(row.break_even_high)})"
        needed = {"configurations": f"{row.configurations:.1f}", "against": f"{row.configurations_against:.1f}"}
        rows.append({"robot": titles[str(row.robot)], "points": str(row.points), **needed, "break_even": even})
    return rows


def cost_facts(table: pd.DataFrame, titles: Mapping[str, str]) -> list[dict[str, str]]:
    """Which set of points is the cheapest where, from `costs.cost_table`: a sentence for each robot."""
    facts = []
    for robot, title in titles.items():
        mine = table[(table.robot == robot) & table.cheapest].sort_values("configuration_cost")
        changes = mine[mine.points != mine.points.shift()]
        spans = zip(changes.points, changes.configuration_cost, strict=True)
        words = [f"{name} from {start:.2g} on" if start else f"{name}" for name, start in spans]
        facts.append({"title": title, "cheapest": ", ".join(words)})
    return facts


def simulated_design_rows(table: pd.DataFrame, length: int, titles: Mapping[str, str]) -> list[dict[str, str]]:
    """Simulated errors at one size by load and design: a row for each robot and load, from the simulated_designs table."""
    rows = []
    for robot, title in titles.items():
        mine = table[(table.robot == robot) & (table.configurations == length)]
        for load, cell in mine.groupby("load", sort=False):
            by = cell.set_index("design")
            row = {"robot": title, "load": str(load), "gain": f"{by.gain['I']:.2f}"}
            hidden = str(by.unobservable.iloc[0])
            row["unobservable"] = "none" if hidden in ("", "nan") else f"joint {hidden}"
            row |= {name: word_value(by.rms_um[name], by.rms_um_std_error[name]) for name in DESIGN_NAMES}
            row |= {"there": f"{by.at_test_pose_um['I']:.0f}; {by.at_test_pose_um[TEST_POSE]:.0f}"}
            rows.append(row)
    return rows


def smallest_designs(table: pd.DataFrame, accuracy_um: float, titles: Mapping[str, str]) -> list[dict[str, str]]:
    """The smallest simulated design within an accuracy, random loads, I-optimal."""
    found = []
    for robot, title in titles.items():
        mine = table[(table.robot == robot) & (table.load == "random") & (table.design == "I")].sort_values("configurations")
        within = mine[mine.rms_um <= accuracy_um]
        first = within.iloc[0] if len(within) else None
        number = "more than all" if first is None else f"{first.configurations}"
        rms = "" if first is None else word_value(first.rms_um, first.rms_um_std_error)
        found.append({"title": title, "configurations": number, "rms": rms})
    return found


def few_rows(
    table: pd.DataFrame, titles: Mapping[str, str], lengths: tuple[int, ...] = (2, 3, 4, 6, 8, 10)
) -> list[dict[str, str]]:
    """RMS error from few configurations: a row for each robot, strategy and error of the nominal values.

    Strategies without a prior do not depend on the nominal values and have one row.
    """
    rows = []
    for robot, title in titles.items():
        mine = table[table.robot == robot]
        seen: set[tuple[str, str]] = set()
        for (strategy, error), cell in mine.groupby(["strategy", "nominal_error_percent"], sort=False):
            by = cell.set_index("configurations").rms_um
            values = {f"{length}": f"{by[length]:.0f}" for length in lengths if length in by.index}
            if (key := (str(strategy), " ".join(values.values()))) not in seen:
                seen.add(key)
                rows.append({"robot": title, "strategy": str(strategy), "error": f"{error:g}", **values})
    for row in rows:
        if sum(other["robot"] == row["robot"] and other["strategy"] == row["strategy"] for other in rows) == 1:
            row["error"] = "any"
    return rows


def kind_rows(table: pd.DataFrame, length: int, titles: Mapping[str, str]) -> list[dict[str, str]]:
    """Error by what is measured: in as many configurations and with as many scalars, from `measurement_kinds.kinds_table`."""
    rows = []
    for kind in dict.fromkeys(table.kind):
        row: dict[str, str] = {"kind": str(kind)}
        for robot in titles:
            cell = table[(table.kind == kind) & (table.robot == robot)]
            same = cell[cell.configurations == length].iloc[0]
            equal = cell.iloc[int(np.argmin(np.abs(cell.scalars - 6 * length)))]
            row |= {"scalars": f"{same.scalars_per_configuration}", "equal": f"{equal.configurations}"}
            row[f"{robot} same"] = word_value(same.rms_um, same.rms_um_std_error)
            row[f"{robot} equal"] = word_value(equal.rms_um, equal.rms_um_std_error)
        rows.append(row)
    return rows


def stiffness_rows(table: pd.DataFrame, titles: Mapping[str, str]) -> list[dict[str, str]]:
    """What K_c changes, from `stiffness.stiffness_table`."""
    names = ("first_order_percent", "by_k_c_percent", "loaded_percent", "bias_percent", "k_sigma_percent")
    rows: list[dict[Any, Any]] = table[table.robot.isin([*titles])].to_dict("records")
    return [
        {"robot": titles[row["robot"]], "force": f"{row['force_N'] / 1000:g}", "softest": f"{row['softest_N_per_um']:.2f}"}
        | {name.removesuffix("_percent"): f"{row[name]:.2g}" for name in names}
        for row in rows
    ]


def _figure_columns(table: pd.DataFrame) -> list[str]:
    """The four figures of Table 4 by their columns, whatever length and limits they have."""
    names = [name for name in table.columns if not name.endswith("_std") and "fixed_joints" not in name]
    return [next(name for name in names if name.startswith(start)) for start in ("k_sigma_", "n_k_sigma_", "dev_", "n_dev_")]


def _fixed(name: str) -> str:
    return name.replace("k_sigma_", "k_sigma_fixed_joints_")


def _cell(row: Any, name: str) -> str:
    value, std = row[name], row[f"{name}_std"]
    if name.startswith("n_"):
        return f"{value:.0f} ± {std:.0f}" if value < 1000 else "over 1000"
    return word_value(value, std)


def _cost(value: Any) -> str:
    return "never" if np.isinf(value) else f"{value:.2f}"
