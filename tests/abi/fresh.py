"""The description of the public headers is of these headers, every function in it has a comment, and the schema of scene
files has the fields of the structs."""
import json
import pathlib
import sys

root = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(root / "bindings/description"))
import description

stale = description.stale()
if stale:
    print(f"{', '.join(stale)} changed since bindings/description/make was run")
described = description.load()
bare = [f["name"] for f in described["functions"] if not f["comment"] and not f["name"].endswith("_init")]
if bare:
    print(f"no comment: {', '.join(bare)}")

schema = json.loads((root / "lib/file/scene.schema.json").read_text())["$defs"]
differ = set()
for name in ["pose", "twist", "frame", "profile", "contact", "object"]:
    (struct,) = (s for s in described["structs"] if s["name"] == "fs_" + name)
    fields = {f["name"] for f in struct["fields"] if not f["name"].startswith(("struct_size", "owner", "reserved"))}
    if name == "object":
        fields = fields - {"time"} | {"pose_age", "age"}  # a file has the ages of time and start
    differ |= {f"{name}.{field}" for field in fields ^ schema[name]["properties"].keys()}
if differ:
    print(f"only in the headers, or only in lib/file/scene.schema.json: {', '.join(sorted(differ))}")
sys.exit(bool(stale or bare or differ))
