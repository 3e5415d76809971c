"""The reference has every function, struct and value of the description, and its links lead somewhere.

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
subprocess.run([sys.executable, "-B", root / "bindings/description/reference.py", folder], check=True)
pages = {path.name: path.read_text() for path in folder.glob("*.html")}
text = "".join(pages.values())
described = description.load()
names = [f["name"] for f in described["functions"]] + [s["name"] for s in described["structs"]]
names += [value["name"] for enum in described["enums"] for value in enum["values"]]
missing = [name for name in names if f">{name}<" not in text and f">{name} <" not in text]
broken = [link for page in pages.values() for link in re.findall(r'href="([^"#]+\.html)', page) if link not in pages]
broken += [f"{page}#{anchor}" for page, anchor in re.findall(r'href="([^"#]+)#([^"]+)"', text) if f'id="{anchor}"' not in pages[page]]
for page, words in (("index.html", "Coordinates lie within"), ("scene.h.html", "forceserver&quot;: &quot;scene&quot;, &quot;version&quot;: 1"),
                    ("object.h.html", "For a position x of the hand a primitive gives its closest point p")):
    if words not in pages[page]:
        missing.append(f"'{words}' in {page}")
if missing or broken:
    print(f"missing: {missing}; links to nowhere: {sorted(set(broken))}")
sys.exit(bool(missing or broken))
