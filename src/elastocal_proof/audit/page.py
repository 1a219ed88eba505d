"""The audit as a page: what was worked out again by what, what was not, and what does not hold."""

from __future__ import annotations

import re
from importlib import resources
from typing import TYPE_CHECKING

from jinja2 import Environment

from elastocal_proof.audit.files import OF_EVERY_FILE
from elastocal_proof.audit.whole import checks_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import pandas as pd

# Of what does not hold a page shows so many rows; all are in audit.csv.
_SHOWN = 200
_FOLLOWED = re.compile(r"(\d+) of (\d+) cells followed(?:; not (.*))?")


def kind_of(file: str) -> str:
    """Files that are made alike, by the form of their names, or where none is worked out again by the folder and the ending."""
    form = next((form for form, _, _ in checks_of(file)), "")
    folder, _, name = file.rpartition("/")
    return re.sub(r"\{\w+\}", "*", form) or f"{folder}/*{name[name.find('.') :]}"


def page(table: pd.DataFrame, facts: Mapping[str, str]) -> str:
    """audit.html, which asks nothing of the network.

    `table`: from `whole.as_table`. `facts`: what heads the page, such as the seed.
    """
    labelled = table.assign(kind=table["file"].map(kind_of))
    of_every_file = labelled["checked"].isin(OF_EVERY_FILE)
    recomputed, alike = labelled[~of_every_file], labelled[of_every_file]
    wrong = table[~table["holds"]]
    template = resources.files("elastocal_proof.audit").joinpath("audit.html").read_text("utf-8")
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(template).render(
        facts=facts,
        recomputed=_by_kind(recomputed),
        followed=_followed(table),
        rest=_by_kind(alike[~alike["kind"].isin(recomputed["kind"])]),
        wrong=wrong.head(_SHOWN).to_dict("records"),
        hidden=max(len(wrong) - _SHOWN, 0),
        files=table["file"].nunique(),
        files_again=recomputed["file"].nunique(),
        checks=len(table),
        values=int(table["compared"].sum()),
        failed=len(wrong),
    )


def _by_kind(labelled: pd.DataFrame) -> list[dict[str, Any]]:
    """Files that are made alike as one row each."""
    rows = []
    for kind, some in labelled.groupby("kind", sort=True):
        worst, checks = some["worst"].max(), checks_of(some["file"].iloc[0])
        row = {"kind": kind, "meaning": " ".join((check.__doc__ or "").split("\n")[0] for _, check, _ in checks)}
        row |= {"files": some["file"].nunique(), "checks": len(some), "values": int(some["compared"].sum())}
        row |= {"worst": f"{worst:.2g}" if worst < 1e3 else "beyond 1000", "failed": int((~some["holds"]).sum())}
        rows.append(row | {"by": ", ".join(dict.fromkeys(name for name in some["by"] if name))})
    return rows


def _followed(table: pd.DataFrame) -> list[dict[str, Any]]:
    """How many cells of each table were followed back to files."""
    found = ((file, _FOLLOWED.fullmatch(checked)) for file, checked in zip(table["file"], table["checked"], strict=True))
    return [{"file": file, "cells": int(each[1]), "of": int(each[2]), "rest": each[3] or ""} for file, each in found if each]
