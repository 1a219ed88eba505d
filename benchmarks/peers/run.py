"""The same job in other packages: errors, CPU time and lines of code, as a table.

Usage: ELASTOCAL_DATA=FOLDER python benchmarks/peers/run.py [--output PAGE]. FOLDER has
the 1,000 poses of the UR5 that config/public_data.yaml names. Each package is installed
in an environment of its own, with the version that a dependency group of pyproject.toml
pins, because two of them need numpy 1.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

import elastocal as ec
from elastocal.campaigns.holdout import split_poses

from measured_job import FOLDER, VARIABLE

ROOT = FOLDER.parents[1]
GRID = "jacobi_ur5/3D_UR5_uncalibrated_grid_cleaned.csv"
PEERS = ("robotkinecal", "pybotics", "figaroh")
_UV = Path(sys.executable).with_name("uv")


@dataclass(frozen=True)
class Errors:
    """Position errors at the held-out poses, mm.

    Attributes
    ----------
    rms_mm, max_mm : float
    interval_mm : (2,) or None
        Interval of the RMS error, 95 %.
    """

    rms_mm: float
    max_mm: float
    interval_mm: tuple[float, float] | None

    def format_rms(self) -> str:
        """Format the RMS error with its interval."""
        if self.interval_mm is None:
            return f"{self.rms_mm:.4f}"
        low_mm, high_mm = self.interval_mm
        return f"{self.rms_mm:.4f} ({low_mm:.4f}–{high_mm:.4f})"


def write_job(path: Path, data: Path) -> None:
    """Write the arrays of the job: 30 % of the poses are held out, as in the campaign
    ur5_grid."""
    table = np.loadtxt(data / GRID, delimiter=",", skiprows=1)
    campaign = ec.Campaign(
        ec.read_robot(ROOT / "config" / "robots" / "ur5.yaml"),
        joint_angles=np.radians(table[:, 7:13]),
        positions=1e-3 * (table[:, 1:4] + table[:, 4:7]),
    )
    measurements = campaign.checked.measurements
    _, held_out = split_poses(campaign.checked)
    np.savez(
        path,
        all_q=measurements.joint_angles,
        all_x=measurements.position,
        is_held_out=np.isin(measurements.pose, held_out.pose),
    )


def install(package: str, folder: Path) -> Path:
    """Install a package in an environment of its own; return its interpreter."""
    environment = folder / package
    python = environment / "bin" / "python"
    quiet = [str(_UV), "-q"]
    subprocess.run([*quiet, "venv", "--python", "3.11", environment], check=True)
    group = f"peer-{package}"
    command = [*quiet, "pip", "install", "--system-certs", "--python", python]
    subprocess.run([*command, "--group", group], check=True, cwd=ROOT)
    return python


def run_script(package: str, python: str | Path, job: Path) -> dict[str, Any]:
    """Run the script of a package; return what its last line says."""
    environment = os.environ | {VARIABLE: str(job), "OMP_NUM_THREADS": "1"}
    finished = subprocess.run(
        [python, FOLDER / f"{package}_ur5.py"],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    result: dict[str, Any] = json.loads(finished.stdout.splitlines()[-1])
    return result


def count_lines(package: str) -> int:
    """Count the lines of `predict` without its docstring."""
    source = (FOLDER / f"{package}_ur5.py").read_text(encoding="utf-8")
    (function,) = (
        node
        for node in ast.parse(source).body
        if isinstance(node, ast.FunctionDef) and node.name == "predict"
    )
    first, *_, last = function.body[1:]
    lines = source.splitlines()[first.lineno - 1 : last.end_lineno]
    return sum(bool(line.strip()) for line in lines)


def summarize(errors_m: npt.ArrayLike, replicates: int = 2000) -> Errors:
    """Summarize errors (poses,), with a bootstrap over poses."""
    errors_mm = 1e3 * np.array(errors_m)
    draws = np.random.default_rng(1).choice(errors_mm, (replicates, len(errors_mm)))
    low, high = np.quantile(np.sqrt((draws**2).mean(axis=1)), [0.025, 0.975])
    rms = float(np.sqrt((errors_mm**2).mean()))
    return Errors(rms, float(errors_mm.max()), (float(low), float(high)))


def read_pin(package: str) -> str:
    """Read the version of a package that pyproject.toml pins."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (pin,) = project["dependency-groups"][f"peer-{package}"]
    return str(pin.partition("==")[2])


def read_errors(row: dict[str, float]) -> Errors:
    """Read the errors of a model from a row of before_after.csv."""
    interval_mm = None
    if "heldout_rms_m_low" in row:
        interval_mm = (1e3 * row["heldout_rms_m_low"], 1e3 * row["heldout_rms_m_high"])
    return Errors(1e3 * row["heldout_rms_m"], 1e3 * row["heldout_max_m"], interval_mm)


def format_row(
    package: str, model: str, errors: Errors, cpu_s: float
) -> dict[str, str]:
    """Format a row of the table."""
    return {
        "package": package.partition(" ")[0],
        "version": package.partition(" ")[2],
        "model": model,
        "lines": str(count_lines(package.partition(" ")[0])),
        "RMS, mm (95 %)": errors.format_rms(),
        "largest, mm": f"{errors.max_mm:.2f}",
        "CPU, s": f"{cpu_s:.0f}",
    }


def list_rows(folder: Path, data: Path) -> list[dict[str, str]]:
    """Run the job in each package; return the rows of the table."""
    job = folder / "job.npz"
    write_job(job, data)
    rows = []
    for package in PEERS:
        result = run_script(package, install(package, folder), job)
        errors = summarize(result["errors_m"])
        name = f"{package} {read_pin(package)}"
        rows.append(format_row(name, "geometry", errors, result["cpu_s"]))
    ours = run_script("elastocal", sys.executable, job)
    models = {
        "geometry": "geometry",
        "geometry and effects": "effects",
        "as delivered": "delivered",
    }
    for model, step in models.items():
        name = f"elastocal {ec.__version__}"
        rows.append(format_row(name, model, read_errors(ours[step]), ours["cpu_s"]))
    return rows


def main() -> None:
    """Write the table of docs/other_packages.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    default = ROOT / "docs" / "other_packages_tables.md"
    parser.add_argument("--output", type=Path, default=default)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = list_rows(Path(folder), Path(os.environ["ELASTOCAL_DATA"]))
    table = pd.DataFrame(rows).to_markdown(index=False, disable_numparse=True)
    head = "# The same job in other packages: table\n\n`benchmarks/peers/run.py` writes it.\n"
    arguments.output.write_text(f"{head}\n## UR5\n\n{table}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
