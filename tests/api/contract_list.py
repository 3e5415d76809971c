"""Every function of the public headers stands in a table of test_contract.cpp, and nothing else does.

contract_list.py TEST
"""
import pathlib
import re
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "bindings/description"))
import description

test = pathlib.Path(sys.argv[1])
declared = {function["name"] for function in description.load()["functions"] if not function["inline"]}
text = test.read_text()
called = set(re.findall(r'\{"(fs_\w+)", \d', text))                      # the table of calls
others = re.search(r"others\[\]\{(.*?)\};", text, flags=re.S).group(1)  # those that give no status
called |= set(re.findall(r'"(fs_\w+)"', others))
called = {name for name in called if re.search(rf"[^\"\w]{name}\(", text)}  # and is called, not only named
for name in sorted(declared - called):
    print(f"{name} is not called by {test.name}")
for name in sorted(called - declared):
    print(f"{name} is in {test.name} but not in a header")
print(f"{len(declared)} functions declared, {len(called)} called")
sys.exit(1 if declared != called or not declared else 0)
