"""Which commit, configuration, seed and environment a file comes from, as it stands in
the file or beside it."""

import hashlib
import json
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from elastocal import __version__
from elastocal.io.plugins import plugin_versions

# Parameters of rules that tell Snakemake of edited sources, and a job what to call:
# nothing of what was configured.
SOURCES_DIGEST = "sources_sha256"
STEP = "step"
# Of what a run on one machine has installed; a wheel comes without.
_LOCK = "requirements/run.lock"
# What numbers may depend on wherever there is no such list.
_LIBRARIES = ("numpy", "pandas", "pyarrow", "scipy")


@dataclass(frozen=True)
class Origin:
    """What a file was made from.

    `commit`: of the repository, with ``-dirty`` behind it where sources were edited
    since; ``unknown`` outside of a checkout.
    """

    commit: str
    configuration_sha256: str
    seed: int

    @property
    def words(self) -> str:
        """One line that people and programs can read."""
        return f"commit {self.commit}, configuration SHA-256 {self.configuration_sha256}, seed {self.seed}"


def format_canonical_json(value: Any) -> str:
    """The one JSON text of a value: keys sorted, no spaces, so that equal values have
    equal digests."""
    return json.dumps(
        value,
        sort_keys=True,
        separators=(",", ":"),
        ensure_ascii=False,
        allow_nan=False,
    )


def configuration_sha256(configuration: Any) -> str:
    """SHA-256 of the canonical JSON of a configuration with everything that it refers
    to, such as the documents of robots."""
    return hashlib.sha256(format_canonical_json(configuration).encode()).hexdigest()


def environment(folder: str | Path) -> dict[str, str]:
    """Versions of the installed libraries and of packages with plug-ins, and the
    SHA-256 of the pins in the folder of the Snakefile if it has some."""
    lock = Path(folder, _LOCK)
    pinned = (
        {_LOCK: hashlib.sha256(lock.read_bytes()).hexdigest()} if lock.is_file() else {}
    )
    return {name: version(name) for name in _LIBRARIES} | plugin_versions() | pinned


def describe_provenance(settings: Any, **more: Any) -> dict[str, Any]:
    """What a table was made from, as JSON has it: `settings`, a mapping or parameters
    of a rule, and further facts."""
    kept = {
        name: value
        for name, value in settings.items()
        if name not in (SOURCES_DIGEST, STEP)
    }
    leaves = json.loads(json.dumps(kept, sort_keys=True, default=list))
    digest = hashlib.sha256(json.dumps(leaves, sort_keys=True).encode()).hexdigest()[
        :16
    ]
    return {
        "elastocal_version": __version__,
        "configuration": leaves,
        "configuration_sha256": digest,
        **more,
    }
