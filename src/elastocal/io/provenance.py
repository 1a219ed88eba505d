"""Where a table comes from: package version, settings and a digest of them."""

import hashlib
import json
from collections.abc import Iterable
from typing import Any, Protocol

from elastocal import __version__

# Parameters of rules that tell Snakemake of edited sources, and a job what to call: nothing of what was configured.
SOURCES_DIGEST, STEP = "sources_sha256", "step"


class Settings(Protocol):
    """A mapping, or a parameter list of Snakemake."""

    def items(self) -> Iterable[tuple[str, Any]]: ...


def provenance(settings: Settings, **more: Any) -> dict[str, Any]:
    """Provenance of an output as JSON has it: the configuration leaves that made it, the seed among them, and further facts."""
    kept = {name: value for name, value in settings.items() if name not in (SOURCES_DIGEST, STEP)}
    leaves = json.loads(json.dumps(kept, sort_keys=True, default=list))
    digest = hashlib.sha256(json.dumps(leaves, sort_keys=True).encode()).hexdigest()[:16]
    return {"elastocal_version": __version__, "configuration": leaves, "configuration_sha256": digest, **more}
