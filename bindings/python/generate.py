"""Writes the layer forceserver._core and its type stub from the description of the public headers.

generate.py DESCRIPTION OUTPUT_FOLDER: writes core.cpp and _core.pyi there. CMake runs it whenever the description
changes.
The headers in core/ have what the generated code is made of. What no rule gives stands in the tables below.
"""

import json
import pathlib
import re
import sys

HERE = pathlib.Path(__file__).resolve().parent

# What no rule gives.
ONE_THREAD_AT_A_TIME = {"fs_tool"}  # only the comment of fs_tool_create says so
END_BEFORE_EXIT = {"fs_servo"}  # stopped before the interpreter ends, so that the force is 0
IN_THREAD = {"fs_scene_connect", "fs_device_open", "fs_shape_load"}  # may take seconds that cannot be cut into slices
BY_HAND = {  # those that may take seconds and make no handle, and those of groups: core/waits.h and core/group.h have them
    "fs_servo_step": "step(self, ticks_);\nreturn py::none();",
    "fs_shape_build": "return build(self);",
    "fs_scene_begin": "return begin_group(self);",
    "fs_scene_commit": "return end_group(self, fs_scene_commit);",
    "fs_scene_cancel": "return end_group(self, fs_scene_cancel);",
}
LEFT = "Ctrl-C ends the wait; the call then ends in a thread of its own, which gives back what it has made."
CHANGES = {"set", "change", "move", "remove", "clear", "load"}  # verbs of what joins an open group
NO_CHANGES = {"get", "begin", "commit", "cancel", "sync", "save", "stop", "next", "create", "start", "field"}  # of what does not
BASES = {
    "INVALID": "ValueError",
    "PARSE": "ValueError",
    "NOT_FOUND": "KeyError",
    "UNSUPPORTED": "NotImplementedError",
    "MEMORY": "MemoryError",
    "TIMEOUT": "TimeoutError",
    "IO": "OSError",
    "DISCONNECTED": "ConnectionError",
    "DENIED": "PermissionError",
}
IN_PACKAGE = {"fs_scene_connect": "fs.connect", "fs_evaluate": "Tool.evaluate", "fs_evaluate_field": "Scene.evaluate"}
FOR_C = re.compile(r"struct_size|_init made|_release\b|until they are destroyed")  # sentences that say nothing in Python

DOUBLES = {"fs_vec3": (3,), "fs_quat": (4,), "fs_mat3": (3, 3)}
NUMPY = {"double": "<f8", "uint8_t": "|u1", "int32_t": "<i4", "uint32_t": "<u4", "uint64_t": "<u8", "bool": "|b1"}
PYTHON = {"double": "float", "bool": "bool"}  # others: int
ENTRY = {"fs_vec3": ("double", 3), "double": ("double", 1), "uint32_t": ("uint32_t", 1)}
UNIT = r"(?:N/m\^2|N/m|N/s|N s/m|N m|N|m/s|rad/s|rad|m|s|Hz|kg|J)"
HIDDEN = ("struct_size", "reserved")


def camel(name):
    return "".join(part.capitalize() for part in re.sub("^fs_", "", name).split("_") if part)


def bare(type_):
    return re.sub(r"\bconst\b|\*", "", type_).strip()


def raw(text):
    return f'R"doc({text})doc"'


def indented(text, by):
    return "\n".join(by + line if line else "" for line in text.splitlines())


class Generator:
    def __init__(self, description):
        self.d = description
        self.handles = {item["name"]: item for item in self.d["handles"]}
        self.structs = {
            item["name"]: item for item in self.d["structs"] if not any(f["type"] == "function" for f in item["fields"])
        }
        self.functions = [f for f in self.d["functions"] if not f["for_c"]]
        self.by_name = {f["name"]: f for f in self.functions}
        for item in self.d["enums"]:
            self.name_enum(item)
        self.enums = {item["name"]: item for item in self.d["enums"] if item["name"]}
        self.flags = {item["prefix"]: item for item in self.d["enums"]} | self.enums
        self.values = {
            value["name"]: f"{item['python']}.{member}"
            for item in self.d["enums"]
            for value, (member, _, _) in zip(item["values"], item["members"])
        } | {c["name"]: c["name"][3:] for c in self.d["constants"]}
        self.cpp, self.stub = [], []

    # -------------------------------------------------------------------------------------------------------- names

    @staticmethod
    def name_enum(item):
        names = [value["name"] for value in item["values"]]
        prefix = names[0]
        while not all(name.startswith(prefix) for name in names) or not prefix.endswith("_"):
            prefix = prefix[:-1]
        item["prefix"] = prefix
        item["is_flags"] = re.search(r"\bbits\b", item["comment"], re.I) is not None
        item["python"] = camel(item["name"]) if item["name"] else camel(prefix.lower()) + "Flags"
        item["members"] = [
            (re.sub("^ERROR_", "", value["name"][len(prefix) :]), value["value"], value["comment"])
            for value in item["values"]
        ]

    def in_python(self, comment):
        """A comment of the headers in Python's words."""

        def named(match):
            name = match[0]
            if handle := next((h for h in self.handles if name == self.given_back_by(h)), None):
                return f"{camel(handle)}.close"
            if function := self.by_name.get(name):
                owner = self.self_of(function)
                return (f"{camel(owner)}." if owner else "") + self.python_name(function)
            if name in self.values:
                return self.values[name]
            if name in self.flags:
                return self.flags[name]["python"]
            return camel(name) if name in self.structs or name in self.handles else name

        comment = re.sub(r"\bGrowing; made by \w+[;.] ?|\bFrozen\.", "", comment)
        sentences = re.split(r"((?<=[.])\s(?=[A-Z]))", comment) + [""]
        kept = [s + gap for s, gap in zip(sentences[::2], sentences[1::2]) if not FOR_C.search(s)]
        words = re.sub(r"\b(?:fs|FS)_\w+", named, "".join(kept))
        words = re.sub(r"\bnull\b", "None", words)
        return re.sub(r"\bNull\b", "None", words).strip()

    def exceptions(self):
        return [
            (camel(name.lower()) + "Error", name, comment)
            for name, value, comment in self.enums["fs_status"]["members"]
            if value < 0
        ]

    def given_back_by(self, handle):
        (name,) = (
            f["name"]
            for f in self.functions
            if f["result"]["kind"] == "nothing" and f["parameters"][0]["type"] == handle + " *"
        )
        return name

    def retained_by(self, handle):
        name = handle + "_retain"
        return name if name in self.by_name else None

    def release_of(self, struct):
        name = struct + "_release"
        return name if name in self.by_name else None

    def is_for_binding(self, function):
        """Whether the binding itself calls it: what gives back and retains."""
        name = function["name"]
        return function["result"]["kind"] == "nothing" or name.endswith("_retain")

    def handle_fields(self, struct):
        """The paths of all pointers to handles in a struct."""
        for field in self.structs[struct]["fields"]:
            if field["type"] in self.structs and field["type"] not in DOUBLES:
                for path in self.handle_fields(field["type"]):
                    yield field["name"] + "." + path
            elif field["type"].endswith("*") and bare(field["type"]) in self.handles:
                yield field["name"]

    def unit(self, struct, field):
        """The unit at the beginning of a field's comment, or of the struct's where that has one for each field."""

        def several(text):
            return (
                re.split(r"[,;] ", match[0])
                if (match := re.match(rf"{UNIT}(?:[,;] {UNIT})*(?=$|[\s,;:])", text))
                else []
            )

        fields = struct["fields"]
        if field["type"] in self.structs and field["type"] not in DOUBLES:
            return ""  # its own fields have units
        if field["comment"]:
            together = [f["name"] for f in fields if f["comment"] == field["comment"]]
            units = several(field["comment"])
            if len(units) > 1:
                return units[together.index(field["name"])] if len(units) == len(together) else units[0]
            return units[0] if units else ""
        comment = struct["comment"]
        if named := re.search(rf"\b{field['name']} \(({UNIT})\)", comment):
            return named[1]
        units = re.findall(rf"(?<![\w/']){UNIT}(?![\w/])", comment)
        return units[fields.index(field)] if len(units) == len(fields) else ""

    def bits(self, field):
        """The enum of a field that holds bits: 'fs_fault bits', 'FS_STATE_ bits'."""
        found = re.search(r"\b(fs_\w+|FS_\w+_) bits", field["comment"])
        return self.flags.get(found[1]) if found and field["type"] == "uint32_t" else None

    def shown_fields(self, struct):
        return [f for f in struct["fields"] if not f["name"].startswith(HIDDEN) and f["type"] != "void *"]

    def parts(self):
        """The fs_part bit of each field of an object, as the comments of the bits list them."""
        parts = {field: value for _, value, comment in self.enums["fs_part"]["members"] for field in comment.split(", ")}
        shown = {field["name"] for field in self.shown_fields(self.structs["fs_object"])}
        if parts.keys() != shown - {"name"}:
            sys.exit(f"the comments of fs_part and the fields of fs_object differ in {parts.keys() ^ (shown - {'name'})}")
        return parts

    # ------------------------------------------------------------------------------------------------------- structs

    def numpy_field(self, field):
        type_, count = field["type"], field["count"]
        if type_ == "char":
            return f"'S{count}'"
        if type_ in DOUBLES:
            shape = ((count,) if count > 1 else ()) + DOUBLES[type_]
            return f"'<f8', {shape}"
        form = (
            camel(type_)
            if type_ in self.structs
            else "'<i4'"
            if type_ in self.enums
            else "'<u8'"
            if type_.endswith("*")
            else f"'{NUMPY[type_]}'"
        )
        return form + (f", ({count},)" if count > 1 else "")

    def add_traits(self):
        """What core.h wants to know of each handle and struct."""
        for handle in self.handles:
            retain = self.retained_by(handle)
            self.cpp.append(
                f"template <>\nstruct Kind<{handle}> {{\n"
                f'  static constexpr const char* name = "{camel(handle)}";\n'
                f"  static constexpr bool ends_at_exit = {str(handle in END_BEFORE_EXIT).lower()};\n"
                f"  static void give_back({handle}* handle) {{ {self.given_back_by(handle)}(handle); }}\n"
                + (f"  static {handle}* retain({handle}* handle) {{ return {retain}(handle); }}\n" if retain else "")
                + "};"
            )
        for name, struct in self.structs.items():
            if paths := list(self.handle_fields(name)):
                self.cpp.append(
                    f"template <>\nstruct HandlesOf<{name}> {{\n  template <class F>\n"
                    f"  static void each({name}& value, F&& call) {{\n"
                    + "".join(f"    call(value.{path});\n" for path in paths)
                    + "  }\n};"
                )
            init = self.by_name.get(name + "_init")
            value = f"{name} value{{}};" + (" value.struct_size = sizeof value;" if struct["growing"] else "")
            if init:
                zeros = ["nullptr" if p["kind"] == "string" else f"{p['type']}{{}}" for p in init["parameters"]]
                value = f"{name} value = {name}_init({', '.join(zeros)});"
            self.cpp.append(f"template <>\n{name} default_of<{name}>() {{\n  {value}\n  return value;\n}}")

    def add_enums(self):
        for item in self.d["enums"]:
            values = ", ".join(f'{{"{name}", {value}}}' for name, value, _ in item["members"])
            doc = (
                item["comment"]
                + "\n\n"
                + "\n".join(f"{name}: {' '.join(comment.split())}" for name, _, comment in item["members"])
            )
            variable = f"enum_of<{item['name']}>" if item["name"] else f"static Enum {item['python']}"
            self.cpp.append(
                f'{variable} = make_enum(module, "{item["python"]}", {raw(doc.strip())}, '
                f"{str(item['is_flags']).lower()}, {{{values}}});"
            )
            base = "IntFlag" if item["is_flags"] else "IntEnum"
            self.stub.append(
                f"class {item['python']}({base}):\n"
                + "".join(f"    {name} = {value}\n" for name, value, _ in item["members"])
            )

    def add_structs(self):
        self.cpp.append('py::dict dtypes = py::dict(py::module_::import("numpy").attr("__dict__"));')
        for name, struct in self.structs.items():
            if name in DOUBLES:
                continue
            python = camel(name)
            fields = ", ".join(f"('{f['name']}', {self.numpy_field(f)})" for f in struct["fields"])
            self.cpp.append(
                f'{{\n  dtypes["{python}"] = py::eval("dtype([{fields}])", dtypes);\n'
                f'  Class<{name}> made(module, "{python}", {raw(self.in_python(struct["comment"]))}, '
                f'"__init__(self, *, {", ".join(f["name"] + "=..." for f in self.shown_fields(struct))})\\n--\\n\\n", '
                f'dtypes["{python}"]);'
            )
            stub = [f"class {python}:", "    dtype: ClassVar[np.dtype[np.void]]"]
            keywords = []
            for f in self.shown_fields(struct):
                unit, comment = self.unit(struct, f), self.in_python(f["comment"])
                if f["type"] == "fs_quat":
                    comment += "; " if comment else ""
                    comment += "(w, x, y, z), or scipy's Rotation; the order of its as_quat() is x, y, z, w"
                bits = self.bits(f)
                if bits:
                    variable = f"&enum_of<{bits['name']}>" if bits["name"] else f"&{bits['python']}"
                    self.cpp.append(f'  made.flags("{f["name"]}", &{name}::{f["name"]}, {variable}, {raw(comment)});')
                else:
                    self.cpp.append(f'  made.field("{f["name"]}", &{name}::{f["name"]}, "{unit}", {raw(comment)});')
                get, set_ = self.field_types(f, bits)
                stub += [
                    "    @property",
                    f"    def {f['name']}(self) -> {get}: ...",
                    f"    @{f['name']}.setter",
                    f"    def {f['name']}(self, value: {set_}) -> None: ...",
                ]
                keywords.append(f"{f['name']}: {set_}")
            self.cpp.append("}")
            self.stub.append(
                f"class {python}Fields(TypedDict, total=False):\n" + "".join(f"    {k}\n" for k in keywords)
            )
            stub += [
                f"    def __init__(self, **fields: Unpack[{python}Fields]) -> None: ...",
                "    def copy(self) -> Self: ...",
                "    def _constant(self) -> Self: ...",
                "    @property",
                "    def __array_interface__(self) -> dict[str, Any]: ...",
            ]
            self.stub.append("\n".join(stub) + "\n")

    @staticmethod
    def enum_type(item):
        """What an enum is given as; bits may be several names in one string."""
        if item["is_flags"] or not item["name"]:
            return "int | str"
        return "int | Literal[" + ", ".join(f'"{name.lower()}"' for name, _, _ in item["members"]) + "]"

    def field_types(self, field, bits):
        type_ = field["type"]
        if bits:
            return bits["python"], self.enum_type(bits)
        if type_ == "char":
            return "str", "str"
        if type_ in DOUBLES:
            return "Array", "ArrayLike" if type_ != "fs_quat" else "ArrayLike | Rotation"
        if type_ in self.structs:
            return camel(type_), camel(type_)
        if type_ in self.enums:
            return self.enums[type_]["python"], self.enum_type(self.enums[type_])
        if type_.endswith("*"):
            return f"{camel(bare(type_))} | None", f"{camel(bare(type_))} | None"
        python = PYTHON.get(type_, "int")
        return python, python

    # ----------------------------------------------------------------------------------------------------- functions

    def python_name(self, function):
        """A method's name does not repeat its class's."""
        name = function["name"][len("fs_") :]
        handle = self.self_of(function)
        return re.sub(f"^{handle[3:]}_", "", name) if handle else name

    def self_of(self, function):
        first = function["parameters"][:1]
        return bare(first[0]["type"]) if first and first[0]["kind"] == "handle" else None

    def is_change(self, function):
        if self.self_of(function) != "fs_scene" or function["rt"]:
            return False
        verb = (function["name"].split("_") + [""])[2]
        if verb not in CHANGES | NO_CHANGES:
            sys.exit(f"{function['name']}: the tables do not say whether '{verb}' changes a scene, so that it joins a group")
        return verb in CHANGES

    def takes_many(self, function):
        """[rt], from a struct to a struct: arrays of structs as well."""
        return function["rt"] and [p["kind"] for p in function["parameters"]] == ["handle", "struct", "out struct"]

    def convert(self, p, function):
        """Of an argument: its Python type, its default, C++ lines that convert it, lines that come after all of those,
        and the expression that the call is given."""
        name, type_, kind, null = p["name"], p["type"], p["kind"], p["null"]
        base = bare(type_)
        none = " | None" if null else ""
        default = "None" if null else None
        truth = str(null).lower()
        if kind == "handle":
            return (
                camel(base),
                None,
                [],
                [f'const Use<{base}> {name}_(as_handle<{base}>({name}, "{name}"));'],
                f"{name}_",
            )
        if kind == "string":
            path = name == "path"
            return (
                ("str | PathLike[str]" if path else "str") + none,
                default,
                [f'const Text {name}_({name}, "{name}", {truth}, {str(path).lower()});'],
                [],
                f"{name}_.get()",
            )
        bits = re.search(rf"\b{name} \((fs_\w+) bits\)", function["comment"])
        if kind == "number" and bits:
            return (
                self.enum_type(self.enums[bits[1]]),
                None,
                [f'const auto {name}_ = static_cast<{type_}>(enum_of<{bits[1]}>.from_python({name}, "{name}"));'],
                [],
                f"{name}_",
            )
        if kind == "number":
            return (
                PYTHON.get(type_, "int"),
                None,
                [f'const {type_} {name}_ = number<{type_}>({name}, "{name}");'],
                [],
                f"{name}_",
            )
        if kind == "enum":
            return (
                self.enum_type(self.enums[type_]),
                None,
                [f'const auto {name}_ = static_cast<{type_}>(enum_of<{type_}>.from_python({name}, "{name}"));'],
                [],
                f"{name}_",
            )
        if kind == "value":
            return "ArrayLike", None, [f'const {base} {name}_ = value<{base}>({name}, "{name}");'], [], f"{name}_"
        if kind == "struct":
            return (
                camel(base) + none,
                default,
                [f'const Input<{base}> {name}_({name}, "{name}", {truth});'],
                [],
                f"{name}_.get()",
            )
        if kind == "array":
            entry, width = ENTRY[base]
            width = p.get("width", width)
            if null:
                lines = [
                    f"py::array {name}_;",
                    f'if (!{name}.is_none()) {name}_ = entries<{entry}>({name}, {width}, "{name}");',
                ]
            else:
                lines = [f'const py::array {name}_ = entries<{entry}>({name}, {width}, "{name}");']
            lines.append(
                f"const size_t {p['count']} = {'' if not null else f'{name}.is_none() ? 0 : '}{name}_.size() / {width};"
            )
            data = f"static_cast<const {base}*>({name}_.data())"
            return "ArrayLike" + none, default, lines, [], f"({name}.is_none() ? nullptr : {data})" if null else data
        if kind == "out array":
            entry, width = ENTRY[base]
            shape = f"{{static_cast<py::ssize_t>({p['count']})" + (f", {width}" if width > 1 else "") + "}"
            (read,) = (q["name"] for q in function["parameters"] if q["kind"] == "array" and q["count"] == p["count"])
            return (
                "Array | None",
                "None",
                [
                    f'py::array {name}_ = results<{entry}>({name}, {shape}, "{name}");',
                    f'keep_apart({read}_, "{read}", {name}_, "{name}");',
                    f"auto* const {name}_at = static_cast<{base}*>({name}_.mutable_data());",
                ],
                [],
                f"{name}_at",
            )
        sys.exit(f"no rule gives what an argument of kind {kind} ({type_} {name}) is")

    def add_function(self, function):
        name, self_ = function["name"], self.self_of(function)
        keeps_gil = function["rt"] or function["inline"] or function["result"]["kind"] == "string"
        arguments, before, uses, call, after, outputs, types = [], [], [], [], [], [], []
        parameters = function["parameters"]
        if self_:
            uses.append(f"const Use<{self_}> use(self);")
            call.append("use")
            parameters = parameters[1:]
        list_of = None
        for p in parameters:
            kind, base = p["kind"], bare(p["type"])
            if kind == "count":
                call.append(p["name"])
            elif kind == "list":
                list_of = base
                call.append("entries")
            elif kind == "capacity":
                call.append("capacity")
            elif kind == "out count":
                if not list_of:
                    before.append(f"size_t {p['name']} = 0;")
                call.append(p["name"] if list_of else f"&{p['name']}")
            elif kind == "out struct":
                before.append(
                    f"{base} {p['name']} = default_of<{base}>();" if base not in DOUBLES else f"{base} {p['name']}{{}};"
                )
                call.append(f"&{p['name']}")
                if release := self.release_of(base):
                    after += [f"Box<{base}> kept_{p['name']}({p['name']});", f"{release}(&{p['name']});"]
                    after += [
                        f"kept_{p['name']}.value.{f['name']} = nullptr;"
                        for f in self.structs[base]["fields"]
                        if f["type"] == "void *"
                    ]
                    outputs.append(f"new_struct(kept_{p['name']}.value)")
                else:
                    outputs.append(f"new_struct({p['name']})")
                types.append(camel(base))
            elif kind == "out number":
                before.append(f"{base} {p['name']} = 0;")
                call.append(f"&{p['name']}")
                outputs.append(f"py::cast({p['name']})")
                types.append(PYTHON.get(base, "int"))
            elif kind == "new handle":
                before.append(f"{base}* {p['name']} = nullptr;")
                call.append(f"&{p['name']}")
                outputs.append(f"new_handle({p['name']})")
                types.append(camel(base))
            else:
                type_, default, lines, late, expression = self.convert(p, function)
                if kind == "struct" and keeps_gil and not p["null"]:
                    lines, expression = (
                        [f'const {base}* const {p["name"]}_ = as_struct<{base}>({p["name"]}, "{p["name"]}").at;'],
                        f"{p['name']}_",
                    )
                arguments.append((p["name"], type_, default))
                before += lines
                uses += late
                call.append(expression)
                if kind == "out array":
                    outputs.append(f"{p['name']}_")
                    types.append("Array")
        if self_ in ONE_THREAD_AT_A_TIME:
            uses.append("const Serial serial(self.serial());")
        if self.is_change(function):
            uses.append("const Change change(self);")
        called = f"{name}({', '.join(call)})"
        body = self.body(function, self_, keeps_gil, called, list_of, before, uses, after, outputs, types)
        self.emit(function, self_, arguments, body, types)

    def body(self, function, self_, keeps_gil, called, list_of, before, uses, after, outputs, types):
        name, result = function["name"], function["result"]
        of_path = ", true" if any(p["name"] == "path" for p in function["parameters"]) else ""
        run = called if keeps_gil else f"without_gil([&] {{ return {called}; }})"
        if name in BY_HAND:
            return before + [BY_HAND[name]]
        if name in IN_THREAD:
            (handle,) = (bare(p["type"]) for p in function["parameters"] if p["kind"] == "new handle")
            before = [line for line in before if not line.startswith(handle)]
            return before + [
                f"return make_in_thread<{handle}>([=]({handle}** made) {{ return {called.replace('&out', 'made')}; }}{of_path});"
            ]
        if self.takes_many(function):
            return self.many(function, self_, uses)
        if list_of:
            has_text = any(f["type"] == "char" for f in self.structs[list_of]["fields"])
            types.append("Array" if list_of in DOUBLES else "Rows" if has_text else "Structs")
            return (
                before
                + uses
                + [
                    f"return list<{list_of}>([&]({list_of}* entries, size_t capacity, size_t* count) {{",
                    f"  return {called};",
                    "});",
                ]
            )
        if any(p["name"] == "timeout" for p in function["parameters"]):
            struct = next((p for p in function["parameters"] if p["kind"] == "out struct"), None)
            done = (
                f"{struct['name']}.{self.structs[bare(struct['type'])]['fields'][0]['name']} != 0"
                if struct
                else "status >= 0"
            )
            called = called.replace("use", f"handle", 1).replace("timeout_", "part")
            return (
                before
                + [
                    f"wait_in_slices(self, timeout_, [&]({self_}* handle, double part) {{ return {called}; }},",
                    f"               [&]([[maybe_unused]] fs_status status) {{ return {done}; }});",
                ]
                + self.returned(outputs)
            )
        kind = result["kind"]
        if kind == "status":
            return before + uses + [f"check({run}{of_path});"] + after + self.returned(outputs)
        if kind == "string":
            types.insert(0, "str | None" if result["lives"] == "with the handle" else "str")
            return before + uses + [f"return text_to_python({called});"]
        if kind == "value":
            types.insert(0, camel(result["type"]))
            return before + uses + [f"return new_struct({called});"]
        if kind == "array":
            base = bare(result["type"])
            types.insert(0, ("Array" if ENTRY[base][0] == "double" else "Indices") + " | None")
            handle = f"static_cast<{self_}*>(use)"
            outputs.insert(0, "entries")
            return (
                before
                + uses
                + [
                    f"const {base}* const found = {called};",
                    f"const py::object entries = kept(found, count, {result.get('width', 1)}, {handle});",
                ]
                + self.returned(outputs)
            )
        sys.exit(f"{name}: no rule gives what it returns")

    @staticmethod
    def returned(outputs):
        if not outputs:
            return ["return py::none();"]
        return [f"return {outputs[0]};" if len(outputs) == 1 else f"return py::make_tuple({', '.join(outputs)});"]

    def many(self, function, self_, uses):
        _, one, out = function["parameters"]
        a, b = bare(one["type"]), bare(out["type"])
        name, result = one["name"], out["name"]
        return [
            f"if (Struct<{a}>* single = if_struct<{a}>({name})) {{",
            f"  py::object made = {result}.is_none() ? new_struct({b}{{}}) : {result};",
            f'  Struct<{b}>& response = as_struct<{b}>(made, "{result}");',
            *("  " + use for use in uses),
            f"  check({function['name']}(use, single->at, response.at));",
            "  return made;",
            "}",
            f'const py::array many = structs<{a}>({name}, "{name}");',
            "const size_t count = static_cast<size_t>(many.size());",
            f'py::array made = struct_results<{b}>({result}, count, "{result}");',
            f'keep_apart(many, "{name}", made, "{result}");',
            f"const auto* const from = static_cast<const {a}*>(many.data());",
            f"auto* const to = static_cast<{b}*>(made.mutable_data());",
            *uses,
            "size_t i = 0;",
            "const fs_status status = without_gil([&] {",
            "  fs_status last = FS_OK;",
            f"  for (; i < count && last >= 0; ++i) last = {function['name']}(use, from + i, to + i);",
            "  return last;",
            "});",
            f'if (status < 0) raise(status, "{name}[" + std::to_string(i - 1) + "]: " + fs_last_error());',
            "return made;",
        ]

    def emit(self, function, self_, arguments, body, types):
        python = self.python_name(function)
        if self.takes_many(function):
            arguments.append(("out", "object", "None"))
        # Only what is followed by no argument without a default has one.
        required = max((i for i, (_, _, default) in enumerate(arguments) if not default), default=-1)
        arguments = [(a, t, default if i > required else None) for i, (a, t, default) in enumerate(arguments)]
        shown = ", ".join(a + (f"={default}" if default else "") for a, _, default in arguments)
        listed = ", ".join((["$self"] if self_ else []) + ([shown] if shown else []))
        left = LEFT + "\n\n" if function["name"] in IN_THREAD | {"fs_shape_build"} else ""
        doc = (
            f"{python}({listed})\n--\n\n" + f"{self.in_python(function['comment'])}\n\n{left}In C: {function['name']}.".strip()
        )  # read by inspect.signature
        parameters = (["const py::object& object_of_self"] if self_ else []) + [
            f"const py::object& {a}" for a, _, _ in arguments
        ]
        extras = [f', py::arg("{a}")' + (" = py::none()" if default else "") for a, _, default in arguments]
        if self_:
            body = [f'Handle<{self_}>& self = as_handle<{self_}>(object_of_self, "self");', *body]
        target = f"class_{self_}" if self_ else "module"
        self.cpp.append(
            f'{target}.def("{python}", []({", ".join(parameters)}) -> py::object {{\n'
            + indented("\n".join(body), "  ")
            + f"\n}}{''.join(extras)}, {raw(doc)});"
        )
        names = ", ".join(f'"{a}"' for a, _, _ in arguments)
        self.cpp.append(
            f'{target}.def("{python}", [](const py::args& args, const py::kwargs& given) -> py::object {{\n'
            f'  wrong_call("{python}", {{{names}}}, {required + 1}, args, given, {str(bool(self_)).lower()});\n}});'
        )
        returned = "None" if not types else types[0] if len(types) == 1 else f"tuple[{', '.join(types)}]"
        listed = ", ".join(
            (["self"] if self_ else []) + [f"{a}: {t}" + (" = None" if default else "") for a, t, default in arguments]
        )
        if self.takes_many(function):
            _, one, out = function["parameters"]
            a, b = camel(bare(one["type"])), camel(bare(out["type"]))
            text = (
                f"    @overload\n    def {python}(self, {one['name']}: {a}, out: {b} | None = None) -> {b}: ...\n"
                f"    @overload\n    def {python}(self, {one['name']}: Structs, out: Structs | None = None) -> Structs: ..."
            )
        else:
            text = f"{'    ' if self_ else ''}def {python}({listed}) -> {returned}: ..."
        self.stubs_of[self_].append(text)

    # ----------------------------------------------------------------------------------------------------------- all

    def run(self):
        self.stubs_of = {None: []} | {handle: [] for handle in self.handles}
        self.add_traits()
        traits, self.cpp = self.cpp, []
        self.add_enums()
        self.add_structs()
        for handle, item in self.handles.items():
            self.cpp.append(
                f'auto class_{handle} = handle_class<{handle}>(module, "{camel(handle)}", {raw(self.in_python(item["comment"]))});'
            )
        self.cpp.append("add_groups(class_fs_scene);")
        self.stubs_of["fs_scene"] += [
            "    def _group(self) -> int: ...",
            "    def _end_group(self, group: int, commit: bool) -> None: ...",
        ]
        for function in self.functions:
            if not self.is_for_binding(function):
                self.add_function(function)
        self.cpp += [f'module.attr("{c["name"][3:]}") = {c["value"]};' for c in self.d["constants"]]
        self.cpp.append("py::dict parts;")
        self.cpp += [f'parts["{field}"] = {bit};' for field, bit in self.parts().items()]
        self.cpp.append('module.attr("PARTS") = parts;')
        # What the package takes as it is: all but the handles, most of which it has classes of its own for.
        self.public = (
            ["Error", "NoFileError"]
            + [name for name, _, _ in self.exceptions()]
            + [item["python"] for item in self.d["enums"]]
            + [camel(name) for name in self.structs if name not in DOUBLES]
            + [self.python_name(f) for f in self.functions if not self.self_of(f) and not self.is_for_binding(f)]
            + [c["name"][3:] for c in self.d["constants"]]
        )
        names = ", ".join(f'"{name}"' for name in self.public)
        self.cpp.append(
            f'py::list all;\nfor (const char* name : {{{names}}}) all.append(name);\nmodule.attr("__all__") = all;'
        )
        return "\n".join(self.source(traits)) + "\n", "\n".join(self.stub_text()) + "\n"

    def names_in_errors(self):
        """What the sentences of errors call a function."""
        for function in self.functions:
            name, owner = function["name"], self.self_of(function)
            if not self.is_for_binding(function):
                shown = (camel(owner) if owner else "fs") + "." + self.python_name(function)
                yield name, IN_PACKAGE.get(name, shown)

    def error_lines(self):
        yield "static void add_names() {"
        names = ", ".join(f'{{"{name}", "{shown}"}}' for name, shown in self.names_in_errors())
        yield f"  errors.names = {{{names}}};"
        yield "}"
        yield "static void add_errors(py::module_& module) {"
        yield '  errors.base = PyErr_NewExceptionWithDoc("forceserver.Error",'
        yield '      "A call of the library failed: the sentence says why, and status is its Status.", nullptr, nullptr);'
        yield '  module.attr("Error") = py::reinterpret_borrow<py::object>(errors.base);'
        yield '  const py::object sentence = py::module_::import("builtins").attr("BaseException").attr("__str__");'
        for python, name, comment in self.exceptions():
            value = next(v for n, v, _ in self.enums["fs_status"]["members"] if n == name)
            base = f", py::handle(PyExc_{BASES[name]})" if name in BASES else ""
            yield "  {"
            yield f"    const py::tuple bases = py::make_tuple(py::handle(errors.base){base});"
            yield "    py::dict members;"
            yield f'    members["status"] = enum_of<fs_status>.to_python({value});'
            yield '    members["__str__"] = sentence;'
            doc = raw(" ".join(comment.split()))
            yield f'    PyObject* made = PyErr_NewExceptionWithDoc("forceserver.{python}", {doc}, bases.ptr(), members.ptr());'
            yield "    if (!made) throw py::error_already_set();"
            yield f"    errors.classes.push_back({{{value}, made}});"
            yield f'    module.attr("{python}") = py::reinterpret_borrow<py::object>(made);'
            yield "  }"
        yield "  const py::tuple bases = py::make_tuple(module.attr(\"NotFoundError\"), py::handle(PyExc_FileNotFoundError));"
        yield '  errors.no_file = PyErr_NewExceptionWithDoc("forceserver.NoFileError", "There is no such file.", bases.ptr(), nullptr);'
        yield "  if (!errors.no_file) throw py::error_already_set();"
        yield '  module.attr("NoFileError") = py::reinterpret_borrow<py::object>(errors.no_file);'
        yield "}"

    def source(self, traits):
        yield "// Generated from the description of the headers by generate.py."
        yield '#include "core.h"\n'
        yield "namespace forceserver_python {\n"
        yield from traits
        yield ""
        yield from self.error_lines()
        yield "\nstatic void add_all(py::module_& module) {"
        yield indented(self.cpp[0], "  ")
        yield "  add_names();"
        yield "  add_errors(module);"
        yield from (indented(line, "  ") if 'R"doc(' not in line else line for line in self.cpp[1:])
        ends = "".join(f" Handle<{handle}>::close_all();" for handle in sorted(END_BEFORE_EXIT))
        yield f'  py::module_::import("atexit").attr("register")(py::cpp_function([] {{{ends} }}));'
        yield "}"
        yield "\n}  // namespace forceserver_python\n"
        yield "PYBIND11_MODULE(_core, module) {"
        yield '  module.doc() = "The C functions of forceserver, generated from its headers.";'
        yield "  pybind11::options options;"
        yield "  options.disable_function_signatures();"
        yield "  pthread_atfork(nullptr, nullptr, [] { ++forceserver_python::forks; });"
        yield "  forceserver_python::add_all(module);"
        yield "}"

    def stub_text(self):
        yield "# Generated from the description of the headers by generate.py."
        yield "import builtins"
        yield "from enum import IntEnum, IntFlag"
        yield "from os import PathLike"
        yield "from typing import Any, ClassVar, Literal, Protocol, Self, TypedDict, Unpack, overload\n"
        yield "import numpy as np"
        yield "from numpy.typing import ArrayLike, NDArray\n"
        yield f"__all__ = {json.dumps(self.public)}\n"
        yield "Array = NDArray[np.float64]"
        yield "Indices = NDArray[np.uint32]"
        yield "Structs = NDArray[np.void]"
        yield "Rows = np.recarray[Any, np.dtype[np.record]]  # structs with names: a field is also an attribute\n"
        yield "class Rotation(Protocol):\n    def as_quat(self) -> Any: ...\n"
        yield "class Error(Exception):\n    status: ClassVar[Status]\n"
        for python, name, _ in self.exceptions():
            yield f"class {python}(Error{', builtins.' + BASES[name] if name in BASES else ''}): ...\n"
        yield "class NoFileError(NotFoundError, builtins.FileNotFoundError): ...\n"
        yield from self.stub
        for handle in self.handles:
            name = camel(handle)
            yield f"class {name}:"
            yield f"    def __init__(self, other: {name}) -> None: ..."
            yield "    def close(self) -> None: ..."
            yield "    @property\n    def closed(self) -> bool: ..."
            yield "    def __enter__(self) -> Self: ..."
            yield "    def __exit__(self, *args: object) -> None: ..."
            yield "\n".join(self.stubs_of[handle])
            yield ""
        yield from self.stubs_of[None]
        for c in self.d["constants"]:
            yield f"{c['name'][3:]}: {type(c['value']).__name__}"
        yield "PARTS: dict[str, int]  # the fs_part bit of each field of Object"


def main():
    description = json.loads((pathlib.Path(sys.argv[1])).read_text())
    source, stub = Generator(description).run()
    folder = pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in (("core.cpp", source), ("_core.pyi", stub)):
        (folder / name).write_text(text)


main()
