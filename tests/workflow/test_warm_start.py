"""Jobs begin as copies of one process that has the libraries; how each ends is told as of any process."""

import os
import subprocess
from types import SimpleNamespace

import psutil
import pytest
import warm_start
from snakemake.benchmark import BenchmarkRecord
from snakemake.script import PythonScript


@pytest.fixture
def executed(monkeypatch, tmp_path):
    """What runs a script as Snakemake does, and returns its time."""
    ends, record = [], BenchmarkRecord()
    monkeypatch.setattr(PythonScript, "execute_script", None)
    monkeypatch.setattr(warm_start.atexit, "register", ends.append)
    warm_start.start_warm()

    def execute(text):
        (tmp_path / "script.py").write_text(text)
        PythonScript.execute_script(SimpleNamespace(bench_record=record), str(tmp_path / "script.py"))
        return record.running_time

    yield execute
    ends[0]()


def test_a_script_is_a_process_of_its_own_with_its_time(executed, tmp_path):
    said = tmp_path / "said"
    text = f"import os, time; time.sleep(0.1); open({str(said)!r}, 'w').write(f'{{os.getppid()}} {{__name__}}')"
    assert executed(text) > 0.1
    parent, name = said.read_text().split()
    assert psutil.Process(int(parent)).ppid() == os.getpid() and name == "__main__"


ENDS = {
    "raise SystemExit(3)": 3,
    "1 / 0": 1,
    "import os; os.kill(os.getpid(), 15)": -15,
    "import os; os.kill(os.getppid(), 9)": -9,
}


@pytest.mark.parametrize("text", ENDS)
def test_a_script_that_ends_otherwise_fails_its_job_as_does_the_end_of_what_it_began_in(executed, text):
    with pytest.raises(subprocess.CalledProcessError) as ended:
        executed(text)
    assert ended.value.returncode == ENDS[text]
