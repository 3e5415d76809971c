"""The description of the public headers (forceserver.json, written by `make`), for generators and tests."""
import hashlib
import json
import pathlib

HERE = pathlib.Path(__file__).resolve().parent
INCLUDE = HERE.parent.parent / "include" / "forceserver"


def load():
    return json.loads((HERE / "forceserver.json").read_text())


def stale():
    """The headers that are not as they were when they were described."""
    described = {header["name"]: header["sha256"] for header in load()["headers"]}
    present = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in INCLUDE.glob("*.h")}
    return sorted(name for name in described.keys() | present.keys() if described.get(name) != present.get(name))
