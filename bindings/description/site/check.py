"""Every link of the built site that does not leave it leads to a file that is there, and to a place on it.

check.py FOLDER
"""
import html.parser
import pathlib
import sys
import urllib.parse

folder = pathlib.Path(sys.argv[1]).resolve()


class Page(html.parser.HTMLParser):
    """The links of a page, and the places on it to which links may lead."""

    def __init__(self, path):
        super().__init__()
        self.links, self.places = set(), set()
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name in ("href", "src") and value and tag != "base":
                self.links.add(value)
            elif name in ("id", "name") and value:
                self.places.add(value)


pages = {path: Page(path) for path in folder.rglob("*.html")}
links, dead = 0, []
for path, page in pages.items():
    for link in page.links:
        parts = urllib.parse.urlsplit(link)
        if parts.scheme or parts.netloc:
            continue
        links += 1
        there = (path.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else path
        place = urllib.parse.unquote(parts.fragment)
        is_there = there.is_relative_to(folder) and there.is_file()
        if not is_there or place and there in pages and place not in pages[there].places:
            dead.append(f"{path.relative_to(folder)}: {link} leads nowhere")
print("\n".join(sorted(dead)[:50] + [f"{len(pages)} pages, {links} links within the site, {len(dead)} dead"]))
sys.exit(bool(dead) or not links)
