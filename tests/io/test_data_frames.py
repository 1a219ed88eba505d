"""Tables as data frames, and data frames as tables for people."""

import numpy as np
import pandas as pd

from elastocal.io.data_frames import write_csv, write_latex, write_markdown


def test_tables_for_people_escape_what_latex_would_take_for_commands(tmp_path):
    frame = pd.DataFrame({"k_sigma_percent": ["1.0 ± 0.1"], "µm": ["5 %"]})
    write_latex(tmp_path / "t.tex", frame)
    write_markdown(tmp_path / "t.md", frame)
    write_csv(tmp_path / "t.csv", pd.DataFrame({"x": [0.1, np.inf]}))
    text = (tmp_path / "t.tex").read_text(encoding="utf-8")
    assert r"k\_sigma\_percent" in text and r"$\pm$" in text and r"5 \%" in text and r"\textmu{}m" in text
    assert "| 1.0 ± 0.1" in (tmp_path / "t.md").read_text(encoding="utf-8")
    assert (tmp_path / "t.csv").read_text(encoding="utf-8") == "x\n0.1\ninf\n"
    assert not list(tmp_path.glob("*.partial"))
