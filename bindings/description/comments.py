"""The comments of the headers as text with paragraphs, lists and code, for pages and docstrings."""
import pathlib
import re
import textwrap


def blocks(text):
    """The parts of a comment in their order: ("paragraph", text), ("item", text), ("term", term, text) or ("code", text)."""
    found, kind, lines, term = [], None, [], ""

    def close():
        nonlocal kind, lines
        if kind == "code":
            found.append((kind, textwrap.dedent("\n".join(lines)).strip("\n")))
        elif kind == "term":
            found.append((kind, term, " ".join(lines)))
        elif kind:
            found.append((kind, " ".join(lines)))
        kind, lines = None, []

    def begin(new, line):
        nonlocal kind
        if kind != new or new in ("item", "term"):
            close()
        kind = new
        lines.append(line)

    for line in text.splitlines():
        indent = len(line) - len(line.lstrip())
        named = re.match(r"(\"?[A-Z0-9][\w.]*:?\"?) {2,}(\S.*)", line)
        if not line.strip():
            if kind == "code":
                lines.append("")
            else:
                close()
        elif line.startswith("- "):
            begin("item", line[2:].strip())
        elif named:
            begin("term", named[2])
            term = named[1]
        elif indent and kind in ("item", "term"):
            lines.append(line.strip())
        elif indent >= 4:
            begin("code", line)
        else:
            begin("paragraph", line.strip())
    close()
    return found


def of_header(path):
    """Each comment of a header that begins a line: where it begins and ends, and its text without stars."""
    for match in re.finditer(r"(?m)^/\*(.*?)\*/", pathlib.Path(path).read_text(), re.S):
        yield match.start(), match.end(), re.sub(r"(?m)^ ?\*(?: |$)", "", match[1]).strip()
