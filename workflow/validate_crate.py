"""Whether the crate of a run keeps to its profile, Provenance Run Crate 0.5, by the shapes of roc-validator, offline.

Usage: .venv-crate/bin/python workflow/validate_crate.py [FOLDER]; `make crate` does it.
"""

import io
import sys
import tempfile
from importlib import resources
from pathlib import Path

import requests
from requests.adapters import BaseAdapter
from requests_cache import CachedSession
from rocrate_validator import services
from rocrate_validator.models import Severity, ValidationSettings
from urllib3 import HTTPResponse

PROFILE = "provenance-run-crate-0.5"
CONTEXT = "https://w3id.org/ro/crate/1.1/context"


class _Bundled(BaseAdapter):
    """Answers with the context that rocrate brings along, in the place of a server.

    Versions of rocrate after 0.13 bring that of RO-Crate 1.3, in which a workflow is of another type than the profile's.
    """

    def send(self, request, **_):
        text = resources.files("rocrate").joinpath("data/ro-crate.jsonld").read_bytes()
        raw = HTTPResponse(io.BytesIO(text), {"Content-Type": "application/ld+json"}, status=200, preload_content=False)
        response = requests.Response()
        response.status_code, response.url, response.request, response.raw = 200, request.url, request, raw
        response.headers["Content-Type"] = "application/ld+json"
        return response

    def close(self):
        pass


def profile_issues(folder: Path) -> list[str]:
    """Where the crate in a folder departs from the profile, a line each."""
    with tempfile.TemporaryDirectory() as scratch:
        cache = Path(scratch) / "answers"
        with CachedSession(str(cache), backend="sqlite", allowable_methods=("GET",)) as session:
            session.mount(CONTEXT, _Bundled())
            session.get(CONTEXT)
        settings = ValidationSettings(
            rocrate_uri=str(folder),
            profile_identifier=PROFILE,
            requirement_severity=Severity.REQUIRED,
            offline=True,
            cache_path=cache,
        )
        result = services.validate(settings)
    return [f"{issue.check.identifier}: {issue.message}" for issue in result.get_issues()]


if __name__ == "__main__":
    found = profile_issues(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
    print("\n".join(found) or f"the crate keeps to its profile, {PROFILE}")
    sys.exit(bool(found))
