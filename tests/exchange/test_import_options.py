"""Options of an import as a file."""

import pytest
from support import refused

from elastocal.exchange.import_options import import_options_text, read_import_options
from elastocal.exchange.measurement_table import ImportOptions


def test_options_read_back_as_they_were(tmp_path):
    (tmp_path / "t.csv").write_text("x")
    options = ImportOptions("tab", "comma", 3, {"q1": "Achse 1 [°]"}, {"q1": "°"}, "euler:ZYX", "smr", "by-robot", True)
    (tmp_path / "import.yaml").write_text(import_options_text(options, tmp_path / "t.csv"), encoding="utf-8")
    assert read_import_options(tmp_path / "import.yaml") == options


def test_an_unknown_key_is_refused(tmp_path):
    (tmp_path / "import.yaml").write_text("seperator: tab\n")
    with refused((tmp_path / "import.yaml").as_posix(), "seperator", "'separator'?"):
        read_import_options(tmp_path / "import.yaml")


@pytest.mark.parametrize("text", ["columns: {null: J1}\n", "units: {1: mm}\n", "columns: {q1: 2}\n"])
def test_names_and_headers_are_texts(tmp_path, text):
    (tmp_path / "import.yaml").write_text(text)
    with refused((tmp_path / "import.yaml").as_posix(), text.partition(":")[0]):
        read_import_options(tmp_path / "import.yaml")
