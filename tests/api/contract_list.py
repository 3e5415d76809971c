"""Every function of the public headers is in a table of test_contract.cpp, and nothing else is."""
import pathlib
import re
import sys

include, test = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
declared = set()
for header in sorted(include.glob("*.h")):
    text = re.sub(r"/\*.*?\*/", "", header.read_text(), flags=re.S)
    declared |= set(re.findall(r"FS_API[^;(]*?\b(fs_\w+)\s*\(", text))
text = test.read_text()
called = set(re.findall(r'\{"(fs_\w+)", \d', text))                      # the table of calls
others = re.search(r"others\[\]\{(.*?)\};", text, flags=re.S).group(1)  # those that return no status
called |= set(re.findall(r'"(fs_\w+)"', others))
called = {name for name in called if re.search(rf"[^\"\w]{name}\(", text)}  # and is called, not only named
for name in sorted(declared - called):
    print(f"{name} is not called by {test.name}")
for name in sorted(called - declared):
    print(f"{name} is in {test.name} but not in a header")
print(f"{len(declared)} functions declared, {len(called)} called")
sys.exit(1 if declared != called or not declared else 0)
