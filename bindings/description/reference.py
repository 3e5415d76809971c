"""Writes the reference of the C functions as web pages, from the description of the headers.

reference.py FOLDER     a page for each header and an index; open FOLDER/index.html
"""
import html
import pathlib
import re
import sys

import description

STYLE = """body { font: 16px/1.5 sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em; color: #222; }
pre { white-space: pre-wrap; background: #f6f6f2; padding: .6em .8em; } td, th { text-align: left; vertical-align: top; padding: .2em .8em .2em 0; }
td pre, td p { margin: 0; background: none; padding: 0; } h2 { border-top: 1px solid #ccc; padding-top: .8em; } code { background: #f6f6f2; }
.rt { background: #dfd; padding: 0 .4em; border-radius: .3em; font-size: 80%; }"""
described = description.load()


def comments(header):
    """What a header says of itself, and of its parts: each with the name of the function that follows it."""
    text = (description.INCLUDE / header).read_text()
    found = [(match.end(), re.sub(r"(?m)^ ?\* ?", "", match[1]).strip()) for match in re.finditer(r"/\*(.*?)\*/", text, re.S)]
    general = found[0][1]
    functions = [(match.start(), match[1]) for match in re.finditer(r"(?m)^FS_API [^;(]*?\b(fs_\w+)\(", text)]
    parts = {}
    for end, said in found[1:]:
        following = next((name for at, name in functions if at > end), None)
        if said.startswith("----") and following:
            parts.setdefault(following, []).append(said.lstrip("- "))
    return general, parts


# Where each name stands.
page_of = {}
for function in described["functions"]:
    page_of[function["name"]] = function["header"]


def linked(text):
    """HTML of a text in which the names of functions lead to them."""
    def link(match):
        name = match[0]
        return f'<a href="{page_of[name]}.html#{name}">{name}</a>' if name in page_of else name
    return re.sub(r"\bfs_\w+", link, html.escape(text))


def comment(text):
    return f"<pre>{linked(text)}</pre>" if text else ""


def declaration(function):
    parameters = ", ".join(spelled(p["type"], p["name"]) for p in function["parameters"]) or "void"
    return f"{spelled(function['result']['type'], function['name'])}({parameters})"


def spelled(type_, name):
    return f"{type_}{name}" if type_.endswith("*") else f"{type_} {name}"


def rows(items, cells):
    return "<table>" + "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells(item)) + "</tr>" for item in items) + "</table>"


def page(title, body):
    return (f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>{STYLE}</style></head>'
            f'<body><p><a href="index.html">forceserver</a></p><h1>{title}</h1>{body}</body></html>\n')


folder = pathlib.Path(sys.argv[1])
folder.mkdir(parents=True, exist_ok=True)
headers = [header["name"] for header in described["headers"] if header["name"] != "forceserver.h"]
for header in headers:
    functions = [function for function in described["functions"] if function["header"] == header]
    general, parts = comments(header)
    body = comment(general) + rows(functions, lambda f: [f'<a href="#{f["name"]}">{f["name"]}</a>'])
    for function in functions:
        body += "".join(comment(part) for part in parts.get(function["name"], []))
        mark = ' <span class="rt">real-time</span>' if function["rt"] else ""
        body += f'<h2 id="{function["name"]}">{function["name"]}{mark}</h2>'
        body += "" if function["for_c"] else f"<p><code>{html.escape(declaration(function))}</code></p>"
        body += comment(function["comment"])
    (folder / f"{header}.html").write_text(page(header, body))

types = ""
for struct in described["structs"]:
    kind = "growing" if struct["growing"] else "frozen"
    types += f'<h2 id="{struct["name"]}">{struct["name"]}</h2><p>{struct["size"]} bytes, {kind}</p>{comment(struct["comment"])}'
    types += rows(struct["fields"], lambda f: [f"<code>{html.escape(f['type'])}</code>", f["name"] + (f"[{f['count']}]" if f["count"] > 1 else ""),
                                              linked(f["comment"])])
for enum in described["enums"]:
    types += f'<h2>{enum["name"] or "values"}</h2>{comment(enum["comment"])}'
    types += rows(enum["values"], lambda v: [f"<code>{v['name']}</code>", v["value"], linked(v["comment"])])
types += "<h2>handles</h2>" + rows(described["handles"], lambda h: [f"<code>{h['name']}</code>", linked(h["comment"])])
types += "<h2>constants</h2>" + rows(described["constants"], lambda c: [f"<code>{c['name']}</code>", c["value"], linked(c["comment"])])
(folder / "types.html").write_text(page("types", types))

index = comment(comments("forceserver.h")[0]) + "<ul>" + "".join(f'<li><a href="{header}.html">{header}</a></li>' for header in headers)
index += '<li><a href="types.html">structs, enums, handles and constants</a></li></ul>'
(folder / "index.html").write_text(page("The C functions of forceserver", index))
print(f"{len(headers) + 2} pages in {folder}")
