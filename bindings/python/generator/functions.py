"""Functions: what each argument becomes, and what is given back."""

import re
import sys

from .names import DOUBLES, PYTHON, bare, camel, indented, raw
from .structs import Structs

# What no rule gives.
ONE_THREAD_AT_A_TIME = {"fs_tool"}  # only the comment of fs_tool_create says so
IN_THREAD = {"fs_scene_connect", "fs_device_open", "fs_shape_load"}  # may take seconds that cannot be cut into slices
BY_HAND = {  # those that may take seconds and make no handle: core/waits.h has them
    "fs_servo_step": "step(self, ticks_);\nreturn py::none();",
    "fs_shape_build": "return build(self);",
}
LEFT = "Ctrl-C ends the wait; the call then ends in a thread of its own, which gives back what it has made."
OUT = "out"  # what an array that results are written to is called; its name in C is still taken
ENTRY = {"fs_vec3": ("double", 3), "double": ("double", 1), "uint32_t": ("uint32_t", 1)}


class Functions(Structs):
    def python_name(self, function):
        """A method's name does not repeat its class's."""
        name = function["name"][len("fs_") :]
        handle = self.self_of(function)
        return re.sub(f"^{handle[3:]}_", "", name) if handle else name

    def self_of(self, function):
        first = function["parameters"][:1]
        return bare(first[0]["type"]) if first and first[0]["kind"] == "handle" else None

    def many_of(self, function):
        """[rt], from a struct to a struct: takes arrays of structs as well. The parameters that go in and come out."""
        ins = [p for p in function["parameters"] if p["kind"] == "struct"]
        outs = [p for p in function["parameters"] if p["kind"].startswith("out")]
        return (ins[-1], outs[0]) if function["rt"] and ins and [p["kind"] for p in outs] == ["out struct"] else None

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
        bits = self.bits(p)
        if kind == "number" and bits:
            return (
                self.enum_type(bits),
                None,
                [f'const auto {name}_ = static_cast<{type_}>(enum_of<{bits["name"]}>.from_python({name}, "{name}"));'],
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
                is_grid = any(q["kind"] == "out array" and q["count"] == p["count"] for q in function["parameters"])
                grid = ", true" if is_grid else ""
                lines = [f'const py::array {name}_ = entries<{entry}>({name}, {width}, "{name}"{grid});']
            lines.append(
                f"const size_t {p['count']} = {'' if not null else f'{name}.is_none() ? 0 : '}{name}_.size() / {width};"
            )
            data = f"static_cast<const {base}*>({name}_.data())"
            return "ArrayLike" + none, default, lines, [], f"({name}.is_none() ? nullptr : {data})" if null else data
        if kind == "out array":
            entry, width = ENTRY[base]
            (read,) = (q["name"] for q in function["parameters"] if q["kind"] == "array" and q["count"] == p["count"])
            return (
                "Array | None",
                "None",
                [
                    f'py::array {name}_ = results<{entry}>({name}, result_shape({read}_, {width}), "{name}");',
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
        list_of, many = None, self.many_of(function)
        for p in parameters:
            kind, base = p["kind"], bare(p["type"])
            if many and p in many:
                call.append("{" + ("out" if p is many[1] else "one") + "}")
                if p is many[0]:
                    arguments.append((p["name"], camel(base), None))
                else:
                    types.append(camel(base))
            elif kind == "count":
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
            elif kind == "inout struct":
                arguments.append((p["name"], camel(base), None))
                before.append(f'Changed<{base}> {p["name"]}_({p["name"]}, "{p["name"]}");')
                call.append(f"{p['name']}_.get()")
                after.append(f"{p['name']}_.take();")
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
                if kind == "out array":
                    p = p | {"name": OUT}
                type_, default, lines, late, expression = self.convert(p, function)
                if kind == "struct" and keeps_gil and not p["null"] and not many:
                    lines, expression = (
                        [f'const {base}* const {p["name"]}_ = as_struct<{base}>({p["name"]}, "{p["name"]}");'],
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
        if many := self.many_of(function):
            return self.many(*many, called, before, uses)
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
                    f"wait_in_slices<{self_}>(self, timeout_, [&]({self_}* handle, double part) {{ return {called}; }},",
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

    def many(self, one, out, called, before, uses):
        a, b = bare(one["type"]), bare(out["type"])
        name, result = one["name"], out["name"]
        return [
            *before,
            f"if (const {a}* single = if_struct<{a}>({name})) {{",
            f"  py::object made = {result}.is_none() ? new_struct({b}{{}}) : py::reinterpret_borrow<py::object>({result});",
            f'  {b}* response = as_struct<{b}>(made, "{result}");',
            *("  " + use for use in uses),
            f"  check({called.format(one='single', out='response')});",
            "  return made;",
            "}",
            f'const py::array many = structs({name}, class_of<{a}>, "{name}");',
            "const size_t count = static_cast<size_t>(many.size());",
            f'py::array made = struct_results({result}, class_of<{b}>, count, "{result}");',
            f'keep_apart(many, "{name}", made, "{result}");',
            f"const auto* const from = static_cast<const {a}*>(many.data());",
            f"auto* const to = static_cast<{b}*>(made.mutable_data());",
            *uses,
            "size_t i = 0;",
            "const fs_status status = without_gil([&] {",
            "  fs_status last = FS_OK;",
            f"  for (; i < count && last >= 0; ++i) last = {called.format(one='from + i', out='to + i')};",
            "  return last;",
            "});",
            f'if (status < 0) raise(status, "{name}[" + std::to_string(i - 1) + "]: " + fs_last_error());',
            "return made;",
        ]

    def emit(self, function, self_, arguments, body, types):
        name, python = function["name"], self.python_name(function)
        comment = self.in_python(function["comment"])
        before = [p["name"] for p in function["parameters"] if p["kind"] == "out array"]
        for was in before:
            comment = re.sub(rf"\b{was}\b", OUT, comment)
        many = self.many_of(function)
        if many:
            arguments.append(("out", "object", "None"))
        # Only what is followed by no argument without a default has one.
        required = max((i for i, (_, _, default) in enumerate(arguments) if not default), default=-1)
        arguments = [(a, t, default if i > required else None) for i, (a, t, default) in enumerate(arguments)]
        shown = ", ".join(a + (f"={default}" if default else "") for a, _, default in arguments)
        listed = ", ".join((["self"] if self_ else []) + ([shown] if shown else []))
        left = LEFT + "\n\n" if function["name"] in IN_THREAD | {"fs_shape_build"} else ""
        doc = (
            f"{python}({listed})\n--\n\n" + f"{comment}\n\n{left}In C: {function['name']}.".strip()
        )  # read by inspect.signature
        given = [f"[[maybe_unused]] const py::handle {a} = given[{i}];" for i, (a, _, _) in enumerate(arguments, bool(self_))]
        if self_:
            given.append(f'Handle& self = as_handle<{self_}>(given[0], "self");')
        unused = "" if given else "[[maybe_unused]] "
        self.bodies[self_].append(
            f"static py::object {name[3:]}({unused}const py::handle* given) {{\n"
            + indented("\n".join(given + body), "  ")
            + "\n}"
        )
        target = f"python_class<{self_}>()" if self_ else "module"
        renamed = f', "{before[0]}"' if before else ""
        self.added[self_].append(f"Function::add<{name[3:]}>({target}, {raw(doc)}{renamed});")
        returned = "None" if not types else types[0] if len(types) == 1 else f"tuple[{', '.join(types)}]"
        listed = ", ".join(
            (["self"] if self_ else []) + [f"{a}: {t}" + (" = None" if default else "") for a, t, default in arguments]
        )
        if many:
            one, out = (camel(bare(p["type"])) for p in many)
            indent = "    " if self_ else ""
            before_, after_ = listed.split(f"{many[0]['name']}: {one}")
            after_ = after_.removesuffix("out: object = None")
            text = "\n".join(
                f"{indent}@overload\n{indent}def {python}({before_}{many[0]['name']}: {i}{after_}out: {o} | None = None) -> {o}: ..."
                for i, o in ((one, out), ("Structs", "Structs"))
            )
        else:
            text = f"{'    ' if self_ else ''}def {python}({listed}) -> {returned}: ..."
        self.stubs_of[self_].append(text)
