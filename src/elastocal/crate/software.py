"""The software of an environment: every installed package with its version and licence."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import distributions
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from importlib.metadata import PackageMetadata

# Classifiers say the licence where packages do not use the field of its own.
_CLASSIFIER = "License :: OSI Approved :: "


@dataclass(frozen=True)
class Package:
    """An installed package, with its licence as it states it, empty where it does not."""

    name: str
    version: str
    licence: str

    @property
    def url(self) -> str:
        """Its package URL, which names a package and a version without an index."""
        return f"pkg:pypi/{self.name}@{self.version}"


def installed_packages() -> list[Package]:
    """All packages of the environment that this runs in, by name, each once."""
    found: dict[str, Package] = {}
    for distribution in distributions():
        metadata = distribution.metadata
        name = metadata["Name"].lower().replace("_", "-")
        # Of two on the path the first is imported.
        found.setdefault(name, Package(name, distribution.version, _licence(metadata)))
    return [found[name] for name in sorted(found)]


def _licence(metadata: PackageMetadata) -> str:
    stated = metadata["License-Expression"]
    classified = [c.removeprefix(_CLASSIFIER) for c in metadata.get_all("Classifier", []) if c.startswith(_CLASSIFIER)]
    # Some packages have the whole text there.
    text = (metadata["License"] or "").strip()
    return stated or " or ".join(classified) or (text if "\n" not in text else text.splitlines()[0].strip())
