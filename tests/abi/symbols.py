"""The shared library shows the functions of the headers, all of them and nothing else.

symbols.py INCLUDE_FOLDER LIBRARY NM
"""
import subprocess
import sys

from public_headers import functions

include, library, nm = sys.argv[1:4]
declared = functions(include)
output = subprocess.run([nm, "-D", "--defined-only", library], check=True, text=True, capture_output=True).stdout
shown = {line.split()[-1].split("@")[0] for line in output.splitlines()}
for name in sorted(shown - declared):
    print(f"{name} is shown, but in no header")
for name in sorted(declared - shown):
    print(f"{name} is declared, but not shown")
print(f"{len(shown)} symbols")
sys.exit(shown != declared or not declared)
