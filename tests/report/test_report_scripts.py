"""From a campaign's folder to its report by the scripts of the rules: with data that are right, and with a decisive fault."""

from types import SimpleNamespace

import pytest
from loop_scripts import run_script
from made_folders import made_folder, made_table

from elastocal.io.json_files import read_json

FIGURES = ("before_after", "arrows", "residuals", "candidates", "confounding")
SUFFIXES = dict.fromkeys(("descriptions", "diagnosis", "verdict"), ".json")
SUFFIXES |= dict.fromkeys(("before_after", "splits", "experiment"), ".csv") | {"report": ".pdf", "page": ".html"}


class Files:
    """Files of a folder by the names that the rules give them."""

    def __init__(self, folder, **more):
        self.folder, self.__dict__ = folder, {"folder": folder} | more

    def __iter__(self):
        # Files elsewhere than in a study's folders have no checksums.
        return iter(())

    def __getattr__(self, name):
        return (self.folder / f"{name}{SUFFIXES.get(name, '.parquet')}").as_posix()


class Params(dict):
    __getattr__ = dict.__getitem__


@pytest.mark.parametrize("turned", [1, -1], ids=["as it is", "joint 3 with the wrong sense"])
def test_a_campaign_ends_in_a_report(turned, kuka, config_folder, tmp_path):
    table = made_table(kuka, "made")
    folder = made_folder(tmp_path / "made", kuka, table=table | {"q3": turned * table["q3"]})
    params = Params(seed=1, states=4, folder=folder.as_posix(), robots=(config_folder / "robots").as_posix())

    def run(script, output, **more):
        job = {"input": Files(tmp_path, **more), "output": output, "params": params, "wildcards": Params(campaign="made")}
        run_script(script, SimpleNamespace(**job, log=[(tmp_path / f"{script}.log").as_posix()]))

    for script in ("read_campaign", "diagnose_campaign", "judge_campaign"):
        run(script, Files(tmp_path))
    pictures = [(tmp_path / f"{figure}.pdf").as_posix() for figure in FIGURES]
    for figure, pdf in zip(FIGURES, pictures, strict=True):
        run(f"draw_{figure}", Params(pdf=pdf, png=pdf.replace(".pdf", ".png")))
    run("compile_loop_report", Files(tmp_path), figures=pictures)
    verdict = read_json((tmp_path / "verdict.json").as_posix())
    assert (verdict["probabilities"] is None) == (turned < 0) == any(e["family"] == "data" for e in verdict["effects"])
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")
    assert "<title>Calibration report: made</title>" in (tmp_path / "page.html").read_text(encoding="utf-8")
