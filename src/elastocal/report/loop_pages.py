"""Pages of a campaign's report."""

from pathlib import Path

from elastocal.report.typesetting import compile_document


def write_loop_report(path, facts, figures):
    """Compile the report of a campaign; the file appears whole or not at all.

    Parameters
    ----------
    path : str
        The PDF.
    facts : dict
        From `loop_facts.loop_facts`.
    figures : sequence of str
        PDF files, named before_after, residuals, arrows, candidates and, where there are pairs, confounding.
    """
    names = [Path(figure).stem for figure in figures]
    compile_document(path, "loop.typ", {"facts": facts | {"figures": names}}, figures)
