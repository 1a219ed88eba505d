"""Pages of the study's report: a typst document over its tables, figures and answers."""

from elastocal.report.typesetting import compile_document


def write_report(path, facts, tables, figures):
    """Compile the report; the file appears whole or not at all.

    Parameters
    ----------
    path : str
        The PDF.
    facts : dict
        From `answers.answers`.
    tables : dict of str to list of list of str
        Rows of each table, the header first.
    figures : iterable of str
        PDF files; the document finds them by their names.
    """
    compile_document(path, "study.typ", {"facts": facts, "tables": tables}, figures)
