"""Every public function has a comment. It stands on the function's own lines, or ends on the line before them, or
begins the paragraph (the lines without a blank one between) in which the function stands, and is about the group.

comments.py INCLUDE_FOLDER
"""
import sys

from public_headers import headers, without_comments


def uncommented(text):
    lines, bare = text.splitlines(), without_comments(text).splitlines()
    number, paragraph = 0, 0
    while number < len(lines):
        if not lines[number].strip():
            paragraph = number + 1
        if not bare[number].startswith("FS_API "):
            number += 1
            continue
        first = number
        while ";" not in bare[number]:
            number += 1
        own = any("/*" in line for line in lines[first : number + 1])
        before = first > 0 and lines[first - 1].rstrip().endswith("*/") and not bare[first - 1].strip()
        group = lines[paragraph].lstrip().startswith("/*")
        if not (own or before or group):
            yield first + 1, lines[first]
        number += 1


failed = False
for header in headers(sys.argv[1]):
    for number, line in uncommented(header.read_text()):
        failed = True
        print(f"{header.name}:{number}: no comment: {line}")
# The test itself can fail.
assert not list(uncommented("/* a */\nFS_API void f(void);\n"))
assert list(uncommented("/* a */\n\nFS_API void f(void);\n"))
assert list(uncommented("int x; /* a */\nFS_API void f(int a,\n  int b);\n"))
sys.exit(failed)
