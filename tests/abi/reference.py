"""The reference has every function, struct, field and value of the description, and its links lead to what it has.

reference.py FOLDER     where the pages may be written
"""
import pathlib
import re
import subprocess
import sys

root = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(root / "bindings/description"))
import description

folder = pathlib.Path(sys.argv[1])
for old in folder.glob("*.md"):
    old.unlink()
subprocess.run([sys.executable, "-B", root / "bindings/description/reference.py", folder], check=True)
pages = {path.name: path.read_text() for path in folder.glob("*.md")}
text = "".join(pages.values())
described = description.load()

# What is described, each as a directive of Sphinx's C domain; the fields of a struct are within it.
found = [(kind, said) for kind, said in re.findall(r"(?m)^`{4,}\{c:(\w+)\} (.*)$", text)]
declared, struct = set(), ""
for kind, said in found:
    name = re.search(r"\(\*(\w+)\)\(|(\w+)(?:\(|\[\d+\]$| = -?\d+$|$)", said)
    name = name[1] or name[2]
    struct = name if kind in ("struct", "function", "enum") else struct
    declared.add(f"{struct}.{name}" if kind == "member" else name)
names = [f["name"] for f in described["functions"]] + [s["name"] for s in described["structs"]]
names += [f"{s['name']}.{field['name']}" for s in described["structs"] for field in s["fields"]]
names += [value["name"] for enum in described["enums"] for value in enum["values"]]
names += [item["name"] for kind in ("handles", "constants") for item in described[kind]]
missing = [name for name in names if name not in declared]

broken = {name for name in re.findall(r"\{c:\w+\}`([\w.]+)`", text) if name not in declared}
broken |= {link for link in re.findall(r"\]\(([^)#]+\.md)", text) if link not in pages}
for page, words in (("index.md", "Coordinates lie within"), ("scene.h.md", '{"forceserver": "scene", "version": 1'),
                    ("object.h.md", "For a position x of the hand a primitive gives its closest point p"),
                    ("object.h.md", "A curve depends only on d and t"), ("scene.h.md", "## Groups")):
    if words not in pages[page]:
        missing.append(f"'{words}' in {page}")
if missing or broken:
    print(f"missing: {missing}; links to nowhere: {sorted(broken)}")
print(f"{len(names)} names, {len(found)} described")
sys.exit(bool(missing or broken))
