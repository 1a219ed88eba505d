"""Where a table comes from: package version, settings and a digest of them."""

import hashlib
import json

from elastocal import __version__


def provenance(settings, **more):
    """Provenance of an output.

    Parameters
    ----------
    settings : object with ``items()``
        The configuration leaves that made the table, the seed among them.
    **more
        Further facts, such as the noise level.

    Returns
    -------
    dict
        JSON-serialisable and the same for the same settings.
    """
    leaves = json.loads(json.dumps(dict(settings.items()), sort_keys=True, default=list))
    digest = hashlib.sha256(json.dumps(leaves, sort_keys=True).encode()).hexdigest()[:16]
    return {"elastocal_version": __version__, "configuration": leaves, "configuration_sha256": digest, **more}
