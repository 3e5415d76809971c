"""Writes the reference of the C functions as pages in Markdown (MyST), from the headers and their description: the site has them.

reference.py FOLDER     a page for each header, in the order of the header, and index.md
"""
import pathlib
import re
import sys

import comments
import description

described = description.load()
functions = {function["name"]: function for function in described["functions"]}
structs = {struct["name"]: struct for struct in described["structs"]}
handles = {handle["name"]: handle for handle in described["handles"]}
constants = {constant["name"]: constant for constant in described["constants"]}
enums = {enum["name"] or enum["values"][0]["name"]: enum for enum in described["enums"]}

# What each name is in the C domain of Sphinx.
role = {name: "func" for name in functions} | {name: "struct" for name in structs} | {name: "type" for name in handles}
role |= {name: "enum" for name, enum in enums.items() if enum["name"]} | {name: "macro" for name in constants}
role |= {value["name"]: "enumerator" for enum in enums.values() for value in enum["values"]}
role |= {f"{name}.{field['name']}": "member" for name, struct in structs.items() for field in struct["fields"]}


def inline(text):
    """Text of a comment in Markdown; names lead to where they are described."""
    def word(name):
        for known in (name, name.partition(".")[0]):
            if known in role:
                return f"{{c:{role[known]}}}`{known}`" + escaped(name[len(known):])
        return escaped(name)

    def escaped(plain):
        return re.sub(r"([\\`*_\[\]<>{}#|~&$])", r"\\\1", plain)

    text = re.sub(r"\b(fs_\w+)\(\)", lambda match: match[1] if match[1] in functions else match[0], text)  # the role writes them
    parts = re.split(r"(`[^`]+`|\b(?:fs|FS)_\w+(?:\.[a-z]\w*)?)", text)
    said = [escaped(part) if i % 2 == 0 else part if part[0] == "`" else word(part) for i, part in enumerate(parts)]
    return re.sub(r"^([-+]|\d+(?=[.)]))", r"\\\1" if text[:1] in "-+" else r"\1\\", "".join(said))


def prose(text):
    """A comment in Markdown."""
    lines = []
    for kind, *said in comments.blocks(text):
        if kind == "code":
            lines += ["```text", said[0], "```", ""]
        elif kind == "paragraph":
            lines += [inline(said[0]), ""]
        else:
            lines += [f"- {inline(said[0])}" if kind == "item" else f"- **{inline(said[0])}** {inline(said[1])}", ""]
    return "\n".join(lines)


def fenced(directive, argument, content, fence="````"):
    if directive in ("member", "enumerator"):
        content = f":no-contents-entry:\n\n{content}"
    return f"{fence}{{c:{directive}}} {argument}\n{content}\n{fence}\n"


def spelled(type_, name):
    return f"{type_}{name}" if type_.endswith("*") else f"{type_} {name}"


def of_function(function):
    parameters = ", ".join(spelled(p["type"], p["name"]) for p in function["parameters"])
    if function["for_c"]:
        parameters = re.search(rf"\b{function['name']}\(([^)]*)\)", text)[1]
    text_ = re.sub(r"^\[rt\] ", "", function["comment"])
    mark = "*Real-time: it takes no lock and allocates nothing.*\n\n" if function["rt"] else ""
    declared = f"{spelled(function['result']['type'], function['name'])}({parameters or 'void'})"
    return fenced("function", declared, mark + prose(text_))


def of_struct(struct):
    content = prose(struct["comment"])
    for field in struct["fields"]:
        declared = spelled(field["type"], field["name"]) + (f"[{field['count']}]" if field["count"] > 1 else "")
        if field["type"] == "function":
            declared = " ".join(re.search(rf"(?m)^ *([^;/]*\(\*{field['name']}\)\([^;]*\));", text)[1].split())
        content += "\n" + fenced("member", declared, prose(field["comment"]))
    return fenced("struct", struct["name"], content, "`````")


def of_handle(handle):
    return fenced("type", f"struct {handle['name']} {handle['name']}", prose(handle["comment"]))


def of_enum(enum):
    content = prose(enum["comment"])
    for value in enum["values"]:
        content += "\n" + fenced("enumerator", f"{value['name']} = {value['value']}", prose(value["comment"]))
    return fenced("enum", enum["name"] or f"@{enum['values'][0]['name']}", content, "`````")


def of_constant(constant):
    return fenced("macro", constant["name"], f"{constant['value']}\n\n{prose(constant['comment'])}")


def declarations(header):
    """What a header declares: place and Markdown."""
    patterns = {
        r"typedef struct (\w+) \w+;": (handles, of_handle),
        r"typedef struct (\w+) \{": (structs, of_struct),
        r"typedef enum (\w+) \{": (enums, of_enum),
        r"enum \{\s*(\w+)": (enums, of_enum),
        r"#define (\w+) ": (constants, of_constant),
        r"(?:FS_API|static inline) [^;{]*?\b(fs_\w+)\(": (functions, of_function),
        r"FS_DEFINE_INIT\((fs_\w+)\)": (functions, of_function),
    }
    for pattern, (known, written) in patterns.items():
        for match in re.finditer(rf"(?m)^{pattern}", text):
            name = match[1] if match[0][:14] != "FS_DEFINE_INIT" else f"{match[1]}_init"
            if name in known:
                yield match.start(), written(known[name])


def section(comment):
    """A part of a header that begins with a comment like "---- Groups: several changes that ..."."""
    heading = re.match(r"([\w, ]+?)(: |\. | are |$)", comment, re.M)
    if not heading or len(heading[1]) > 40:
        return prose(comment)
    said = comment if heading[2] == " are " else comment[heading.end():].strip()
    return f"## {heading[1]}\n\n{prose(capital(said))}"


def capital(text):
    return text[:1].upper() + text[1:]


def same(comment):
    return " ".join(comment.split())


folder = pathlib.Path(sys.argv[1])
folder.mkdir(parents=True, exist_ok=True)
attached = {same(item["comment"]) for items in described.values() for item in items if "comment" in item}
rows = []
headers = [header["name"] for header in described["headers"] if header["name"] != "forceserver.h"]
for header in headers:
    text = (description.INCLUDE / header).read_text()
    (_, _, general), *rest = comments.of_header(description.INCLUDE / header)
    title = re.match(r"forceserver/\S+ - (.*?)(?: Conventions: forceserver\.h)?\.(?:\n|$)|forceserver/\S+ - (.*?)[.;]",
                     general + "\n", re.S)
    summary = (title[1] or title[2]).rstrip(".")
    parts = list(declarations(header))
    for start, end, comment in rest:
        if comment.startswith("----"):
            parts.append((start, section(comment.lstrip("- "))))
        elif same(comment) not in attached and not comment.startswith("Marks a function"):
            parts.append((start, prose(comment)))
    after = general[title.end():].strip() if title else ""
    (folder / f"{header}.md").write_text(f"# {header}\n\n*{inline(capital(summary))}.*\n\n{prose(after)}\n"
                                         + "\n".join(said for _, said in sorted(parts)))
    count = sum(function["header"] == header for function in functions.values())
    rows.append(f"| [`{header}`]({header}.md) | {inline(capital(summary))} | {count} |\n")

(_, _, general), *_ = comments.of_header(description.INCLUDE / "forceserver.h")
general = capital(general.removeprefix("forceserver.h - "))
(folder / "index.md").write_text(
    "# The C functions\n\n| header | | functions |\n|---|---|---|\n" + "".join(rows) + "\n" + prose(general)
    + "\n:::{toctree}\n:hidden:\n" + "".join(f"\n{header}.md" for header in headers) + "\n:::\n")
print(f"{len(headers) + 1} pages in {folder}")
