"""State from which commit, configuration, seed and environment a file was made."""

import hashlib
import json
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from elastocal import __version__
from elastocal.io.plugins import list_plugin_versions

# Parameters of rules that are no configuration: the script of a job with the modules
# that it imports, a digest by which Snakemake notices edits of them, and the function
# that a job calls.
SOURCE_FILES = "sources"
SOURCES_DIGEST = "sources_sha256"
STEP = "step"
PARAMETERS_OF_EVERY_RULE = (SOURCE_FILES, SOURCES_DIGEST, STEP)
# Pins of the packages that a run installs; a wheel has none.
_LOCK = "requirements/run.lock"
# Libraries on which numbers may depend; their versions are recorded also without pins.
_LIBRARIES = ("numpy", "pandas", "pyarrow", "scipy")


@dataclass(frozen=True)
class Origin:
    """Commit, configuration and seed behind a file.

    Attributes
    ----------
    commit : commit of the repository, followed by ``-dirty`` if sources were edited;
        ``unknown`` outside a checkout.
    configuration_sha256 : digest of the configuration.
    seed : seed of the configuration.
    """

    commit: str
    configuration_sha256: str
    seed: int

    @property
    def words(self) -> str:
        """One line that people and programs can read."""
        return (
            f"commit {self.commit}, configuration SHA-256 {self.configuration_sha256}, "
            f"seed {self.seed}"
        )


def format_canonical_json(value: Any) -> str:
    """Return the JSON text of a value with sorted keys and no spaces, so that equal
    values have equal digests."""
    return json.dumps(
        value,
        sort_keys=True,
        separators=(",", ":"),
        ensure_ascii=False,
        allow_nan=False,
    )


def digest_configuration(configuration: Any) -> str:
    """Return the SHA-256 of the canonical JSON of a configuration, which must include
    everything that it refers to, such as the documents of robots."""
    return hashlib.sha256(format_canonical_json(configuration).encode()).hexdigest()


def list_versions(folder: str | Path) -> dict[str, str]:
    """Return the versions of the installed libraries and of packages with plug-ins, and
    the SHA-256 of the pins in the folder of the Snakefile if it has some."""
    lock = Path(folder, _LOCK)
    versions = {name: version(name) for name in _LIBRARIES} | list_plugin_versions()
    if lock.is_file():
        versions[_LOCK] = hashlib.sha256(lock.read_bytes()).hexdigest()
    return versions


def describe_provenance(settings: Any, **facts: Any) -> dict[str, Any]:
    """Return the provenance of a table, JSON-serialisable.

    Parameters
    ----------
    settings : configuration, a mapping or the parameters of a rule.
    facts : further entries.
    """
    named = {
        name: value
        for name, value in settings.items()
        if name not in PARAMETERS_OF_EVERY_RULE
    }
    configuration = json.loads(json.dumps(named, sort_keys=True, default=list))
    text = json.dumps(configuration, sort_keys=True)
    return {
        "elastocal_version": __version__,
        "configuration": configuration,
        "configuration_sha256": hashlib.sha256(text.encode()).hexdigest()[:16],
        **facts,
    }
