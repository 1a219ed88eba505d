"""Pages of the blind proof."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.report.typesetting import compile_document
from elastocal_proof.league.pages import markdown
from elastocal_proof.report.blind_facts import reached_words, target_rows

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path
    from typing import Any

    import pandas as pd

    from elastocal.io.origin import Origin


def write_blind_report(
    path: str | Path, facts: Mapping[str, Any], figures: Iterable[str], origin: Origin | None = None
) -> None:
    """Compile the report of the blind proof; the file appears whole or not at all.

    `path`: the PDF. `facts`: from `blind_facts.blind_facts`. `figures`: PDF files, named targets, reliability, power,
    confusion, errors, coverage and sweep. `origin`: named in the foot of each page.
    """
    compile_document(path, "blind.typ", {"facts": facts}, figures, origin, __package__)


def targets_page(summary: pd.DataFrame, of_each: Mapping[str, pd.DataFrame], size: str, seed: int) -> str:
    """Every quantity beside its target, as a page of the documentation in Markdown; arguments as of `blind_facts`."""
    return f"""# Targets of the blind proof

Written by `snakemake -j2 blind_pictures --config blind={size} seed={seed}`; [what it means](blind_proof.md). "At 50" is at a
non-centrality of 50. Brackets hold 95 % intervals: of shares Clopper–Pearson, of the others a bootstrap over cases.

{reached_words(summary)}

{markdown(target_rows(summary, of_each))}
"""
