"""The description of the public headers is of these headers, and every function in it has a comment."""
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "bindings/description"))
import description

stale = description.stale()
if stale:
    print(f"{', '.join(stale)} changed since bindings/description/make was run")
bare = [f["name"] for f in description.load()["functions"] if not f["comment"] and not f["name"].endswith("_init")]
if bare:
    print(f"no comment: {', '.join(bare)}")
sys.exit(bool(stale or bare))
