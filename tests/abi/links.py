"""Every link on every page (*.md) of the repository leads somewhere: the file or folder is there, and so is the heading. Links
to the web are not followed. Each picture is also small enough for a page.

links.py ROOT
"""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1]).resolve()
sys.path.insert(0, str(root / "bindings/description"))
from pages import pages

LARGEST = {".png": 300e3, ".gif": 2e6}  # bytes
failures = links = 0


def fail(page, sentence):
    global failures
    failures += 1
    print(f"FAILED: {page.relative_to(root)}: {sentence}")


def prose(page):
    """The lines of a page, without its code."""
    fence = None
    for line in page.read_text().splitlines():
        mark = re.match(r" {0,3}(`{3,}|~{3,})", line)
        if mark and fence is None:
            fence = mark[1]
        elif mark and mark[1].startswith(fence):
            fence = None
        elif fence is None and not line.startswith("    "):
            yield line


def anchors(page):
    """What the headings of a page are called in links, as GitHub makes it."""
    found, counts = set(), {}
    for line in prose(page):
        heading = re.fullmatch(r"#{1,6}\s+(.*?)\s*#*", line)
        if heading:
            text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", heading[1])
            anchor = re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")
            count = counts[anchor] = counts.get(anchor, -1) + 1
            found.add(f"{anchor}-{count}" if count else anchor)
    return found


looked_at = list(pages(root))
for page in looked_at:
    text = re.sub(r"(`+)(?!`).*?(?<!`)\1(?!`)", "", "\n".join(prose(page)), flags=re.S)
    targets = re.findall(r"\]\(\s*<?([^)>\s]*)>?(?:\s+\"[^\"]*\")?\s*\)", text)
    targets += re.findall(r"(?m)^ {0,3}\[[^\]]+\]:\s*<?([^>\s]+)", text) + re.findall(r"(?:href|src)=\"([^\"]+)\"", text)
    for target in targets:
        if re.match(r"[a-z][a-z0-9+.-]*:|//", target):
            continue
        links += 1
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        if not there.is_relative_to(root) or not there.exists():
            fail(page, f"there is no {target}")
            continue
        if there.stat().st_size > LARGEST.get(there.suffix, float("inf")):
            fail(page, f"{target} has {there.stat().st_size} bytes")
        if anchor and there.is_dir():
            there = there / "README.md"
        if anchor and (there.suffix != ".md" or anchor not in anchors(there)):
            fail(page, f"there is no heading for {target}")
if len(looked_at) < 2 or not links:
    fail(root / "README.md", "no links were found: the test does not see the pages")
print(f"{len(looked_at)} pages, {links} links, {failures} failures")
sys.exit(failures > 0)
