"""Reads the public headers with libclang and says what they declare, as data: forceserver.json beside this file.

describe.py CC          writes forceserver.json
describe.py CC --check  only says whether it would be the same

CC: the C compiler whose own headers (stddef.h) are read. `make` in this folder runs it in an environment of its own.
The rules below tell what a parameter is for from its type, its name and its place. What no rule can tell stands in TABLE, and in meaning.py.
A declaration that neither explains ends the run, so that no binding guesses.
"""
import hashlib
import json
import pathlib
import re
import subprocess
import sys

from clang.cindex import CursorKind, Index, TokenKind, TypeKind

import meaning

HERE = pathlib.Path(__file__).resolve().parent
INCLUDE = HERE.parent.parent / "include"

# function.parameter: what no rule gives.
#   null       it may be null
#   width N    an array has N entries for each of its count
#   inout      the struct is read and written
TABLE = {
    "fs_evaluate_field.name": "null",
    "fs_fail.message": "null",
    "fs_object_move.twist": "null",
    "fs_object_release.object": "null inout",
    "fs_scene_get_hand.state": "null",
    "fs_scene_get_hand.response": "null",
    "fs_scene_get_hand.sent": "null",
    "fs_shape_create_mesh.triangles": "width 3",
    "fs_shape_get_triangles": "width 3",
    "fs_surface_set_impact.settings": "inout",
    "fs_tool_create.points": "null",
}
# The last field of each growing struct in the first version that is taken: for some that was before 0.9, the first that was
# released. What is appended later is not there for programs that were built before.
FIRST_VERSION = {
    "fs_object": "lifetime",
    "fs_shape_info": "reserved",
    "fs_surface_settings": "slip_distance",
    "fs_device_info": "controller_damping",
    "fs_servo_options": "cpu",
    "fs_servo_stats": "link_loss",
    "fs_server_options": "reserved",
    "fs_model": "hold",
    "fs_link": "loss",
    "fs_driver": "get_link",
}
NUMBERS = {"double": 8, "uint8_t": 1, "int32_t": 4, "uint32_t": 4, "uint64_t": 8, "size_t": 8, "bool": 1, "char": 1}
GIVE_BACK = ("_destroy", "_close", "_stop")  # take the reference of a handle, and accept null


def fail(where, what):
    sys.exit(f"{where.location.file}:{where.location.line}: {where.spelling}: {what}")


def compiler_folder(compiler):
    """Where a compiler keeps stddef.h. Without it clang goes on and takes size_t for an int."""
    result = subprocess.run([compiler, "-print-file-name=include"], text=True, capture_output=True, check=True)
    return result.stdout.strip()


def parse(compiler, header, *options):
    arguments = ["-std=c11", f"-I{INCLUDE}", "-isystem", compiler_folder(compiler), *options]
    unit = Index.create().parse(str(header), arguments)
    for diagnostic in unit.diagnostics:
        sys.exit(f"{diagnostic.location.file}:{diagnostic.location.line}: {diagnostic.spelling}")
    return unit


class Comments:
    """The comments of one header, by place."""

    def __init__(self, unit, header):
        self.lines = header.read_text().splitlines()
        size = len(header.read_bytes())
        extent = unit.get_extent(str(header), (0, size))
        self.all = [(token.extent.start.offset, token.extent.end.offset, token.extent.start.line, token.extent.end.line,
                     self.text(token.spelling))
                    for token in unit.get_tokens(extent=extent) if token.kind == TokenKind.COMMENT]

    @staticmethod
    def text(raw):
        """The text of a comment, its lines as they are but for stars and the indent that all have in common."""
        lines = raw[2:-2].splitlines()
        rest = [re.sub(r"^ \* ?", "", line) if re.match(r"^ \*( |$)", line) else line for line in lines[1:]]
        indent = min((len(line) - len(line.lstrip()) for line in rest if line.strip()), default=0)
        return "\n".join([lines[0].strip()] + [line[indent:].rstrip() for line in rest]).strip()

    def before(self, line):
        """The comment that ends on the line before, or the one that begins the paragraph of this line."""
        first = line
        while first > 1 and self.lines[first - 2].strip():
            first -= 1
        for start in (line, None):
            for _, _, begin, end, text in self.all:
                if end == line - 1 if start else begin == first:
                    return text
        return ""

    def between(self, begin, end):
        """The first comment that begins between two offsets."""
        for at, _, _, _, text in self.all:
            if begin <= at < end:
                return text
        return ""


def bare(spelling):
    return re.sub(r"\b(const|struct|enum)\b", "", spelling).replace("*", "").strip()


def plain(spelling):
    """A type as the headers spell it: libclang says _Bool for bool."""
    return spelling.replace("_Bool", "bool")


class Describer:
    def __init__(self, compiler):
        self.compiler = compiler
        self.used = set()
        self.out = {"headers": [], "constants": [], "handles": [], "enums": [], "structs": [], "functions": []}

    def table(self, name):
        if name not in TABLE:
            return []
        self.used.add(name)
        return TABLE[name].split()

    # ---------------------------------------------------------------------------------------------------- what is named

    def names(self, key):
        return {item["name"] for item in self.out[key]}

    def fields(self, struct, comments):
        cursors = [c for c in struct.get_children() if c.kind == CursorKind.FIELD_DECL]
        ends = [c.location.offset for c in cursors[1:]] + [struct.extent.end.offset + 200]
        for cursor, end in zip(cursors, ends):
            kind, count, type_ = cursor.type, 1, plain(cursor.type.spelling)
            if kind.kind == TypeKind.CONSTANTARRAY:
                count, type_ = kind.element_count, plain(kind.element_type.spelling)
            if kind.kind == TypeKind.POINTER and "(" in kind.spelling:
                type_ = "function"
            closing = struct.extent.end.offset
            text = comments.between(cursor.location.offset, end if end < closing or cursor is not cursors[-1] else closing)
            yield {"name": cursor.spelling, "type": type_, "count": count, "offset": struct.type.get_offset(cursor.spelling) // 8,
                   "size": kind.get_size(), "comment": text}

    def add_struct(self, cursor, comments, swig):
        struct = next((c for c in cursor.get_children() if c.kind == CursorKind.STRUCT_DECL), None)
        struct = struct.get_definition() if struct else None
        if struct is None:
            self.out["handles"].append({"name": cursor.spelling, "comment": comments.before(cursor.location.line)})
            return
        fields = list(self.fields(struct, comments))
        for field, after in reversed(list(zip(fields, fields[1:]))):  # "double lower, upper; /* both */"
            if field["type"] == after["type"]:
                field["comment"] = field["comment"] or after["comment"]
        if sum(field["size"] for field in fields) != struct.type.get_size():
            fail(cursor, "has padding")
        growing = fields[0]["name"] == "struct_size"
        if growing and cursor.spelling not in FIRST_VERSION:
            fail(cursor, "FIRST_VERSION does not say which fields it began with")
        first = [field["offset"] + field["size"] for field in fields if field["name"] == FIRST_VERSION.get(cursor.spelling)]
        self.out["structs"].append({
            "name": cursor.spelling, "size": struct.type.get_size(), "for_c": cursor.spelling not in swig, "growing": growing,
            **({"first_size": first[0]} if growing else {}), "comment": comments.before(struct.location.line), "fields": fields})

    def add_enum(self, cursor, name, comments):
        constants = [c for c in cursor.get_children() if c.kind == CursorKind.ENUM_CONSTANT_DECL]
        ends = [c.location.offset for c in constants[1:]] + [cursor.extent.end.offset]
        values = [{"name": c.spelling, "value": c.enum_value, "comment": comments.between(c.location.offset, end)}
                  for c, end in zip(constants, ends) if not c.spelling.endswith("_FORCE_32")]
        self.out["enums"].append({"name": name, "comment": comments.before(cursor.extent.start.line), "values": values})

    def add_constant(self, cursor, comments):
        tokens = [token.spelling for token in cursor.get_tokens()]
        if len(tokens) < 2 or not re.fullmatch(r"-?[0-9.]+", tokens[1]):
            return
        value = float(tokens[1]) if "." in tokens[1] else int(tokens[1])
        line = comments.lines[cursor.location.line - 1]
        trailing = re.search(r"/\*(.*?)\*/", line)
        comment = trailing[1].strip() if trailing else comments.before(cursor.location.line)
        self.out["constants"].append({"name": cursor.spelling, "value": value, "comment": comment})

    # ------------------------------------------------------------------------------------------ what a parameter is for

    def parameters(self, function):
        """The rules."""
        handles, structs, enums = self.names("handles"), self.names("structs"), self.names("enums")
        given = [(p.spelling, plain(p.type.spelling)) for p in function.get_arguments()]
        out = []
        for place, (name, type_) in enumerate(given):
            after = given[place + 1:] + [("", ""), ("", "")]
            stars, base, is_const = type_.count("*"), bare(type_), type_.startswith("const ")
            table = self.table(f"{function.spelling}.{name}")
            is_count = re.fullmatch(r"(\w+_)?count", name) is not None
            kind, extra = None, {}
            if stars == 2 and base in handles and name == "out":
                kind = "new handle"
            elif stars == 1 and base in handles:
                kind = "handle"
                table = table + ["null"] * (function.spelling.endswith(GIVE_BACK) or function.spelling.endswith("_retain"))
            elif stars == 1 and [a[0] for a in after[:2]] == ["capacity", "count"] and not is_const:
                kind = "list"
            elif (name, type_) == ("capacity", "size_t"):
                kind = "capacity"
            elif is_count and type_ == "size_t":
                kind = "count"
            elif is_count and type_ == "size_t *" and (given[place - 1][0] == "capacity" or "*" in function.result_type.spelling):
                kind = "out count"
            elif stars == 1 and base == "char" and is_const:
                kind = "string"
                table = table + ["null"] * (name == "client")
            elif stars == 1 and is_const and (base in structs or base in NUMBERS) and after[0][1] == "size_t":
                kind, extra = "array", {"count": after[0][0]}
            elif stars == 1 and not is_const and (base in structs or base in NUMBERS) and place and given[place - 1][1] == "size_t":
                kind, extra = "out array", {"count": given[place - 1][0]}
            elif stars == 1 and base in structs:
                kind = "struct" if is_const else "inout struct" if "inout" in table else "out struct"
                table = table + ["null"] * (name == "options")
            elif stars == 1 and base in NUMBERS and not is_const:
                kind = "out number"
            elif stars == 0 and base in enums:
                kind = "enum"
            elif stars == 0 and (base in NUMBERS or base in structs):
                kind = "number" if base in NUMBERS else "value"
            if kind is None:
                fail(function, f"no rule tells what '{type_} {name}' is for")
            if "width" in table:
                extra["width"] = int(table[table.index("width") + 1])
            out.append({"name": name, "type": type_, "kind": kind, **extra, "null": "null" in table})
        return out

    def result(self, function):
        """What is returned: its kind, and who owns it."""
        type_ = function.result_type.spelling
        stars, base = type_.count("*"), bare(type_)
        arguments = [p.type.spelling for p in function.get_arguments()]
        of_handle = bool(arguments) and bare(arguments[0]) in self.names("handles")
        table = self.table(function.spelling)
        width = {"width": int(table[1])} if "width" in table else {}
        if type_ in ("fs_status", "void"):
            return {"type": type_, "kind": "status" if type_ != "void" else "nothing"}
        if stars == 1 and base in self.names("handles"):
            return {"type": type_, "kind": "new handle"}
        if stars == 1 and base == "char":
            return {"type": type_, "kind": "string", "lives": "with the handle" if of_handle else
                    "until the thread's next failure" if function.spelling == "fs_last_error" else "for ever"}
        if stars == 1 and type_.startswith("const ") and of_handle and any(a == "size_t *" for a in arguments):
            return {"type": type_, "kind": "array", **width, "lives": "with the handle"}
        if stars == 0 and base in self.names("structs"):
            return {"type": type_, "kind": "value"}
        fail(function, f"no rule tells what '{type_}' is")

    def add_function(self, cursor, comments, swig):
        name = cursor.spelling
        is_inline = cursor.is_definition()
        comment = comments.before(cursor.extent.start.line)
        if not comment and not is_inline:
            fail(cursor, "has no comment")
        for_c = not is_inline and name not in swig
        entry = {"name": name, "header": pathlib.Path(cursor.location.file.name).name, "comment": comment, "inline": is_inline,
                 "for_c": for_c, "rt": "[rt]" in comment}
        if for_c:  # a runtime cannot call it, so it needs no more
            entry |= {"result": {"type": cursor.result_type.spelling}, "parameters": []}
        else:
            entry |= {"result": self.result(cursor), "parameters": self.parameters(cursor)}
        self.out["functions"].append(entry)

    # ------------------------------------------------------------------------------------------------------------- all

    def run(self):
        order = ["base.h", "object.h", "scene.h", "evaluate.h", "device.h", "servo.h", "server.h", "driver.h"]
        files = sorted(path.name for path in (INCLUDE / "forceserver").glob("*.h"))
        if sorted(order + ["forceserver.h"]) != files:
            sys.exit(f"headers are {files}: the reading order in describe.py names others")
        for name in order + ["forceserver.h"]:
            text = (INCLUDE / "forceserver" / name).read_bytes()
            self.out["headers"].append({"name": name, "sha256": hashlib.sha256(text).hexdigest()})
        for name in order:
            header = INCLUDE / "forceserver" / name
            unit = parse(self.compiler, header, "-fparse-all-comments")
            seen = parse(self.compiler, header, "-DSWIG")
            swig = {c.spelling for c in seen.cursor.get_children()}
            self.add_header(unit, header, Comments(unit, header), swig)
        for name in TABLE:
            if name not in self.used:
                sys.exit(f"describe.py: TABLE has {name}, which the headers do not")
        for name in FIRST_VERSION.keys() - {struct["name"] for struct in self.out["structs"]}:
            sys.exit(f"describe.py: FIRST_VERSION has {name}, which the headers do not")
        meaning.add_to(self.out)
        return self.out

    def add_header(self, unit, header, comments, swig):
        macros = parse_macros(self.compiler, header)
        for cursor in macros:
            self.add_constant(cursor, comments)
        for cursor in unit.cursor.get_children():
            if not cursor.location.file or cursor.location.file.name != str(header):
                continue
            if cursor.kind == CursorKind.TYPEDEF_DECL:
                kind = cursor.underlying_typedef_type.get_canonical().kind
                if kind == TypeKind.RECORD:
                    self.add_struct(cursor, comments, swig)
                elif kind == TypeKind.ENUM:
                    self.add_enum(cursor.underlying_typedef_type.get_declaration(), cursor.spelling, comments)
            elif cursor.kind == CursorKind.ENUM_DECL and cursor.is_anonymous():
                self.add_enum(cursor, "", comments)
            elif cursor.kind == CursorKind.FUNCTION_DECL:
                self.add_function(cursor, comments, swig)


def parse_macros(compiler, header):
    unit = Index.create().parse(str(header), ["-std=c11", f"-I{INCLUDE}", "-isystem", compiler_folder(compiler)], options=1)
    return [c for c in unit.cursor.get_children() if c.kind == CursorKind.MACRO_DEFINITION and c.location.file
            and c.location.file.name == str(header) and c.spelling.startswith("FS_")]


def main():
    target = HERE / "forceserver.json"
    text = json.dumps(Describer(sys.argv[1]).run(), indent=1, ensure_ascii=False) + "\n"
    if sys.argv[2:] == ["--check"]:
        if not target.exists() or target.read_text() != text:
            sys.exit("forceserver.json is not what the headers say: run bindings/description/make")
        return
    target.write_text(text)
    print(f"{target.name}: " + ", ".join(f"{len(Describer_items)} {key}" for key, Describer_items in json.loads(text).items()))


main()
