"""The page of errors has every status of the headers, and its sentences are those of the library: it has each that the program
`sentences` makes the library say, under its status, and no other.

errors_page.py ROOT SENTENCES
"""
import pathlib
import re
import subprocess
import sys
import tempfile

root, program = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
sys.path.insert(0, str(root / "bindings/description"))
import description

failures = 0


def fail(sentence):
    global failures
    failures += 1
    print(f"FAILED: {sentence}")


page = (root / "include/forceserver/errors.md").read_text()
parts = re.split(r"(?m)^## (FS_\w+)$", page)
told = dict(zip(parts[1::2], parts[2::2]))
statuses = next(enum for enum in description.load()["enums"] if enum["name"] == "fs_status")
for value in statuses["values"]:
    if value["name"] not in told:
        fail(f"the page has no {value['name']}")
for name in told.keys() - {value["name"] for value in statuses["values"]}:
    fail(f"{name} is no status")

with tempfile.TemporaryDirectory() as folder:
    done = subprocess.run([program], cwd=folder, text=True, capture_output=True)
if done.returncode:
    fail(f"sentences ended with {done.returncode}: {done.stdout}{done.stderr}")
said = [line.partition(": ") for line in done.stdout.splitlines()]

# A sentence of the page as a pattern: "…" stands for what differs from machine to machine.
patterns = [(status, re.compile(".*".join(map(re.escape, sentence.split("…")))))
            for status, text in told.items() for sentence in re.findall(r"(?m)^\| `([^`]+)` \|", text)]
for status, _, sentence in said:
    if not any(of == status and pattern.fullmatch(sentence) for of, pattern in patterns):
        fail(f"under {status} the page has no: {sentence}")
for status, pattern in patterns:
    if not any(of == status and pattern.fullmatch(sentence) for of, _, sentence in said):
        fail(f"under {status} the page has a sentence that the library does not say: {pattern.pattern}")
if len(patterns) < 20:
    fail("the test does not see the sentences of the page")
print(f"{len(told)} statuses, {len(patterns)} sentences, {failures} failures")
sys.exit(failures > 0)
