"""The audit as a page: what was checked by what, and what does not hold."""

from __future__ import annotations

import re
from importlib import resources
from typing import TYPE_CHECKING

from jinja2 import Environment

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

# Of what does not hold a page shows so many rows; all are in audit.csv.
_SHOWN = 200


def kind_of(file: str) -> str:
    """Files that are made alike, by the folder and what they are.

    Parameters
    ----------
    file : str

    Returns
    -------
    str
    """
    parts = file.split("/")
    if parts[0] == "data" and len(parts) > 3:
        return f"data/{parts[1]}/*/{parts[-1]}"
    if parts[1] == "loop":
        return f"{parts[0]}/loop/*/{parts[-1]}"
    return f"{parts[0]}/{parts[1]}/*{re.sub(r'.*(?=[.])', '', parts[-1])}" if len(parts) > 2 else file


def page(table: pd.DataFrame, facts: Mapping[str, str]) -> str:
    """audit.html, which asks nothing of the network.

    Parameters
    ----------
    table : DataFrame
        From `whole.as_table`.
    facts : mapping of str to str
        What heads the page, such as the seed.

    Returns
    -------
    str
    """
    labelled = table.assign(kind=table["file"].map(kind_of))
    kinds = (
        labelled.groupby("kind", sort=True)
        .agg(
            files=("file", "nunique"),
            checks=("checked", "size"),
            values=("compared", "sum"),
            worst=("worst", "max"),
            failed=("holds", lambda holds: int((~holds).sum())),
            by=("by", lambda names: ", ".join(dict.fromkeys(name for name in names if name))),
        )
        .reset_index()
    )
    wrong = table[~table["holds"]]
    template = resources.files("elastocal.audit").joinpath("audit.html").read_text("utf-8")
    return (
        Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
        .from_string(template)
        .render(
            facts=facts,
            kinds=kinds.to_dict("records"),
            wrong=wrong.head(_SHOWN).to_dict("records"),
            hidden=max(len(wrong) - _SHOWN, 0),
            files=table["file"].nunique(),
            checks=len(table),
            values=int(table["compared"].sum()),
            failed=len(wrong),
        )
    )
