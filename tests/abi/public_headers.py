"""What the tests of this folder read from the public headers."""
import pathlib
import re


def headers(include):
    """The files of include/forceserver, in alphabetical order."""
    found = sorted(pathlib.Path(include, "forceserver").glob("*.h"))
    assert found, f"no headers in {include}/forceserver"
    return found


def without_comments(text):
    """Comments become blanks of the same number of lines."""
    return re.sub(r"/\*.*?\*/", lambda m: re.sub(r"[^\n]", " ", m.group()), text, flags=re.S)


def functions(include):
    """The names that are declared FS_API."""
    names = set()
    for header in headers(include):
        names |= set(re.findall(r"\bFS_API\b[^;(]*?\b(fs_\w+)\s*\(", without_comments(header.read_text())))
    return names
