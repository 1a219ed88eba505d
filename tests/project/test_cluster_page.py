"""The examples of docs/cluster.md for Dask and Ray, with stand-ins for both: they call what
there is and print a line for each campaign."""

import re
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from elastocal.loop import whole

PAGE = Path(__file__).resolve().parents[2] / "docs" / "cluster.md"
EXAMPLES = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)


def dask_stand_in():
    module = ModuleType("dask.distributed")
    module.Client = lambda threads_per_worker: SimpleNamespace(
        map=lambda function, items, **options: [
            function(item, **options) for item in items
        ],
        gather=list,
    )
    return {"dask": ModuleType("dask"), "dask.distributed": module}


def ray_stand_in():
    module = ModuleType("ray")
    module.init = lambda: None
    module.remote = lambda num_cpus: lambda function: SimpleNamespace(remote=function)
    module.get = list
    return {"ray": module}


@pytest.mark.parametrize(
    ("example", "modules"),
    [(EXAMPLES[0], dask_stand_in()), (EXAMPLES[1], ray_stand_in())],
    ids=["dask", "ray"],
)
def test_an_example_diagnoses_every_campaign(
    example, modules, tmp_path, monkeypatch, capsys
):
    def diagnose_folder(folder, robots_folder, seed, settings=None):
        assert (robots_folder, seed) == ("config/robots", 1)
        return {"verdict": "named", "heldout": {"after": {"rms_m": 1e-4}}}

    monkeypatch.setattr(whole, "diagnose_folder", diagnose_folder)
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    for name in ("first", "second"):
        (tmp_path / "campaigns" / name).mkdir(parents=True)
        (tmp_path / "campaigns" / name / "campaign.yaml").touch()
    monkeypatch.chdir(tmp_path)
    exec(example, {"__name__": "__main__"})
    assert capsys.readouterr().out == "first named 0.0001\nsecond named 0.0001\n"
    assert len(list(filter(None, example.splitlines()))) <= 12


def test_both_examples_stand_on_the_page():
    assert "import ray" in EXAMPLES[1] and "dask" in EXAMPLES[0]
    assert len(EXAMPLES) == 2
