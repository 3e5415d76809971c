"""The version of the project is the same wherever it is written.

version_numbers.py ROOT
"""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
PLACES = {
    "CMakeLists.txt": r"project\(forceserver\s+VERSION ([\d.]+)",
    "bindings/python/pyproject.toml": r'(?m)^version = "([\d.]+)"',
    "bindings/java/pom.xml": r"<artifactId>forceserver</artifactId>\s*<version>([\d.]+)</version>",
    "examples/editor/pyproject.toml": r'(?m)^version = "([\d.]+)"',
    ".github/CHANGELOG.md": r"(?m)^## ([\d.]+)",  # the newest
}
found = {}
for place, pattern in PLACES.items():
    match = re.search(pattern, (root / place).read_text())
    found[place] = match[1] if match else "none"
numbers = [re.search(rf"#define FS_VERSION_{part} (\d+)", (root / "include/forceserver/base.h").read_text())[1]
           for part in ("MAJOR", "MINOR", "PATCH")]
found["include/forceserver/base.h"] = ".".join(numbers)
for place, version in found.items():
    print(f"{version} in {place}")
newest_fixed = re.search(r"the newest release, now ([\d.]+)", (root / ".github/SECURITY.md").read_text())
print(f"{newest_fixed[1]} in .github/SECURITY.md")
sys.exit(len(set(found.values())) != 1 or newest_fixed[1] != ".".join(numbers[:2]))
