"""Collects the pages of the folders (*.md), with what they show and link to, as the source of the site.

collect.py ROOT SOURCE

A page keeps its place, but .github is called project; README.md becomes index.md. A link to a page leads to that page of the
site, one to another file lets the reader download it, and one to a folder without a page leads to a list of its files. navigation.md has the order of
the pages.
"""
import os
import pathlib
import re
import shutil
import sys

here = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(here.parent))
from pages import pages

root, source = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
CODE = (r"(?ms)^ {0,3}(?P<fence>`{3,}|~{3,}).*?^ {0,3}(?P=fence)[`~]*$"  # within fences, indented, or within a paragraph
        r"|^ {4}.*?$|(?P<ticks>`+)(?!`)(?:(?!\n\s*\n).)+?(?<!`)(?P=ticks)(?!`)")
JAVA = """# The Java classes

<a href="../java/index.html">The Javadoc of the package <code>org.forceserver</code></a> describes every class. [forceserver for
Java](../bindings/java/index.md) shows how it is used.
"""
listed = set()


def in_site(path):
    """Where a file or folder of the project is in the source of the site."""
    if path.is_dir():
        path /= "README.md"
    name = path.relative_to(root)
    if name.parts[0] == ".github":  # many tools take a folder that begins with a dot for hidden
        name = pathlib.Path("project", *name.parts[1:])
    return source / (name.with_name("index.md") if name.name == "README.md" else name)


def list_files(folder):
    """A page for a folder that has none."""
    listed.add(folder)
    name = folder.relative_to(root)
    files = [path for path in sorted(folder.rglob("*")) if path.is_file() and "__pycache__" not in path.parts]
    links = [f"- [`{path.relative_to(folder)}`]({copied(path, in_site(folder))})" for path in files]
    in_site(folder).write_text(f"---\norphan: true\n---\n\n# The files of {name}\n\n" + "\n".join(links) + "\n")


def copied(path, page):
    """Copies a file into the source of the site, and gives its path relative to a page."""
    there = in_site(path)
    if there.suffix != ".md" and not there.exists():
        there.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, there)
    return os.path.relpath(there, page.parent)


def rewritten(page):
    """The text of a page with its links as they are in the site."""
    def target(match):
        path, hash_, anchor = match[2].partition("#")
        if not path or re.match(r"[a-z][a-z0-9+.-]*:", path):
            return match[0]
        there = (page.parent / path).resolve()
        if there.is_dir() and not (there / "README.md").exists() and there not in listed:
            in_site(there).parent.mkdir(parents=True, exist_ok=True)
            list_files(there)
        return f"{match[1]}{copied(there, in_site(page))}{hash_}{anchor}{match[3]}"

    text, at, written = page.read_text(), 0, ""
    for code in [*re.finditer(CODE, text), None]:
        prose = text[at:code.start()] if code else text[at:]
        written += re.sub(r"(\]\()([^)\s]+)(\))", target, prose) + (code[0] if code else "")
        at = code.end() if code else at
    return written


collected = []
for page in pages(root):
    if page.parent == here:
        continue
    there = in_site(page)
    there.parent.mkdir(parents=True, exist_ok=True)
    there.write_text(rewritten(page))
    collected.append(str(there.relative_to(source).with_suffix("")))
(source / "reference").mkdir(exist_ok=True)
(source / "reference" / "java.md").write_text(JAVA)
navigation = (here / "navigation.md").read_text()
named = set(re.findall(r"<(\S+)>", navigation)) | {"index"}
others = [name for name in collected if name not in named]  # pages that navigation.md does not have yet: at its end
navigation = navigation.rstrip().removesuffix("```") + "".join(f"{name}\n" for name in others) + "```\n"
with (source / "index.md").open("a") as front:
    front.write("\n" + navigation)
print(f"{len(collected)} pages collected")
