"""Whether the files of a run are those that its crate describes; whoever receives one needs nothing but Python.

Usage: python workflow/check_crate.py [FOLDER]
"""

import hashlib
import json
import sys
from pathlib import Path
from urllib.parse import unquote


def altered_files(folder: Path) -> list[str]:
    """Files that are missing or hold other bytes than the crate says, a line each."""
    graph = json.loads((folder / "ro-crate-metadata.json").read_text(encoding="utf-8"))["@graph"]
    described = {unquote(entity["@id"]): entity["sha256"] for entity in graph if "sha256" in entity}
    found = {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in described if (folder / name).is_file()}
    missing = [f"{name}: missing" for name in described if name not in found]
    return missing + [f"{name}: other bytes than the crate describes" for name in found if found[name] != described[name]]


if __name__ == "__main__":
    crate = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    altered = altered_files(crate)
    print("\n".join(altered) or "every file is the one that the crate describes")
    sys.exit(bool(altered))
