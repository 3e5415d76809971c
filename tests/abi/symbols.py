"""The shared library exports the functions of the headers and nothing else, each in one of the version nodes of
lib/libforceserver.map. It is never unloaded, as a servo's thread may run in it.

symbols.py LIBRARY NM READELF
"""
import pathlib
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "bindings/description"))
import description

library, nm, readelf = sys.argv[1:4]
declared = {function["name"] for function in description.load()["functions"] if not function["inline"]}
output = subprocess.run([nm, "-D", "--defined-only", library], check=True, text=True, capture_output=True).stdout
lines = [line.split() for line in output.splitlines()]
nodes = {words[-1].split("@")[0] for words in lines if words[-2] == "A"}
shown = {words[-1].split("@")[0] for words in lines if words[-2] != "A"}
for words in lines:
    if words[-2] != "A" and words[-1].split("@@")[1:2] not in [[node] for node in nodes]:
        print(f"{words[-1]} is in no version node")
        shown.add("no node: " + words[-1])
for name in sorted(shown - declared):
    print(f"{name} is shown, but in no header")
for name in sorted(declared - shown):
    print(f"{name} is declared, but not shown: name it in lib/libforceserver.map, in the node of the next release")
print(f"{len(shown)} symbols in {len(nodes)} nodes")
dynamic = subprocess.run([readelf, "-d", library], check=True, text=True, capture_output=True).stdout
stays = "NODELETE" in dynamic
if not stays:
    print("the library can be unloaded")
sys.exit(shown != declared or not declared or not stays)
