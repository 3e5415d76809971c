"""The shared library exports the functions of the headers and nothing else. It is never unloaded, as a servo's thread
may run in it.

symbols.py INCLUDE_FOLDER LIBRARY NM READELF
"""
import subprocess
import sys

from public_headers import functions

include, library, nm, readelf = sys.argv[1:5]
declared = functions(include)
output = subprocess.run([nm, "-D", "--defined-only", library], check=True, text=True, capture_output=True).stdout
shown = {line.split()[-1].split("@")[0] for line in output.splitlines()}
for name in sorted(shown - declared):
    print(f"{name} is shown, but in no header")
for name in sorted(declared - shown):
    print(f"{name} is declared, but not shown")
print(f"{len(shown)} symbols")
dynamic = subprocess.run([readelf, "-d", library], check=True, text=True, capture_output=True).stdout
stays = "NODELETE" in dynamic
if not stays:
    print("the library can be unloaded")
sys.exit(shown != declared or not declared or not stays)
