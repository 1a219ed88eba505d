"""Pages of the blind proof."""

from elastocal.report.typesetting import compile_document


def write_blind_report(path, facts, figures):
    """Compile the report of the blind proof; the file appears whole or not at all.

    Parameters
    ----------
    path : str
        The PDF.
    facts : dict
        From `blind_facts.blind_facts`.
    figures : sequence of str
        PDF files, named targets, reliability, power, confusion, errors, coverage and sweep.
    """
    compile_document(path, "blind.typ", {"facts": facts}, figures)
