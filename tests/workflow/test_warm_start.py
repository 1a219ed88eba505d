"""Jobs begin as copies of one process that has the libraries, and how each ends is
told."""

import os
import subprocess
from types import SimpleNamespace

import psutil
import pytest
import warm_start
from snakemake.benchmark import BenchmarkRecord
from snakemake.script import PythonScript


@pytest.mark.parametrize(
    ("end", "code"),
    [("pass", 0), ("os.kill(os.getpid(), 15)", -15), ("os.kill(os.getppid(), 9)", -9)],
)
def test_a_script_is_a_process_of_its_own_and_fails_its_job_where_it_or_what_it_began_in_is_killed(
    end, code, tmp_path, monkeypatch
):
    ends = []
    script = SimpleNamespace(bench_record=BenchmarkRecord())
    monkeypatch.setattr(PythonScript, "execute_script", None)
    monkeypatch.setattr(warm_start.atexit, "register", ends.append)
    warm_start.start_warm()
    said = tmp_path / "said"
    place = tmp_path / "script.py"
    write = f"with open({str(said)!r}, 'w') as file: file.write(f'{{os.getppid()}} {{__name__}}')"
    place.write_text(f"import os, time\ntime.sleep(0.1)\n{write}\n{end}\n")
    try:
        PythonScript.execute_script(script, str(place))
    except subprocess.CalledProcessError as error:
        assert error.returncode == code != 0
    else:
        assert code == 0
    parent, name = said.read_text().split()
    assert name == "__main__" and script.bench_record.running_time > 0.1
    assert psutil.Process(int(parent)).ppid() == os.getpid()
    for each in reversed(ends):
        each()
