"""Handles, structs and enums."""

from .names import DOUBLES, PYTHON, Names, bare, camel, raw

END_BEFORE_EXIT = {"fs_servo"}  # stopped before the interpreter ends, so that the force is 0
DESCRIBED = {"fs_shape": "described_shape", "fs_curve": "described_curve"}  # core/handle.h
NUMPY = {"double": "<f8", "uint8_t": "|u1", "int32_t": "<i4", "uint32_t": "<u4", "uint64_t": "<u8", "bool": "|b1"}


class Structs(Names):
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

    def add_handles(self):
        self.cpp.append("const py::object handle_base = make_handle_base(module);")
        for name, handle in self.handles.items():
            kind = [
                f'"{camel(name)}"',
                str(name in END_BEFORE_EXIT).lower(),
                f"[](void* handle) {{ {self.given_back_by(name)}(static_cast<{name}*>(handle)); }}",
            ]
            if retain := self.retained_by(name):
                kind.append(f"[](void* handle) -> void* {{ return {retain}(static_cast<{name}*>(handle)); }}")
            else:
                kind.append("nullptr")
            kind.append(DESCRIBED.get(name, "nullptr"))
            self.cpp.append(
                f"kind_of<{name}> = {{{', '.join(kind)}}};\n"
                f"add_handle(module, handle_base, kind_of<{name}>, {raw(self.in_python(handle['comment']))});"
            )

    def defaults_of(self, name, struct):
        """C++ that fills a struct at `at` with its defaults."""
        if init := self.by_name.get(name + "_init"):
            zeros = ["nullptr" if p["kind"] == "string" else f"{p['type']}{{}}" for p in init["parameters"]]
            return f"*static_cast<{name}*>(at) = {name}_init({', '.join(zeros)});"
        sized = f" static_cast<{name}*>(at)->struct_size = sizeof({name});" if struct["growing"] else ""
        return f"*static_cast<{name}*>(at) = {{}};{sized}"

    def add_enums(self):
        for item in self.d["enums"]:
            values = ", ".join(f'{{"{name}", {value}}}' for name, value, _ in item["members"])
            doc = (
                item["comment"]
                + "\n\n"
                + "\n".join(f"{name}: {' '.join(comment.split())}" for name, _, comment in item["members"])
            )
            variable = f"enum_of<{item['name']}>" if item["name"] else f"[[maybe_unused]] static Enum {item['python']}"
            self.cpp.append(
                f'{variable} = make_enum(module, "{item["python"]}", {raw(doc.strip())}, '
                f"{str('bits' in item).lower()}, {{{values}}});"
            )
            base = "IntFlag" if "bits" in item else "IntEnum"
            self.stub.append(
                f"class {item['python']}({base}):\n"
                + "".join(f"    {name} = {value}\n" for name, value, _ in item["members"])
            )

    def add_structs(self):
        self.cpp.append("const py::object struct_base_class = make_struct_base(module);")
        self.cpp.append('py::dict dtypes = py::dict(py::module_::import("numpy").attr("__dict__"));')
        for name, struct in self.structs.items():
            if name in DOUBLES:
                continue
            python = camel(name)
            fields_in_cpp = []
            stub = [f"class {python}:", "    dtype: ClassVar[np.dtype[np.void]]"]
            keywords = []
            for f in self.shown_fields(struct):
                unit, comment = f.get("unit", ""), self.in_python(f["comment"])
                if f["type"] == "fs_quat":
                    comment += "; " if comment else ""
                    comment += "(w, x, y, z), or scipy's Rotation; the order of its as_quat() is x, y, z, w"
                bits = self.bits(f)
                field = (
                    f'{{"{f["name"]}", "{"" if bits else unit}", {raw(comment)}, offsetof({name}, {f["name"]}), '
                    f"field_type<decltype({name}::{f['name']})>"
                )
                if bits:
                    field += ", &" + (f"enum_of<{bits['name']}>" if bits["name"] else bits["python"])
                fields_in_cpp.append(field + "},")
                get, set_ = self.field_types(f, bits)
                stub += [
                    "    @property",
                    f"    def {f['name']}(self) -> {get}: ...",
                    f"    @{f['name']}.setter",
                    f"    def {f['name']}(self, value: {set_}) -> None: ...",
                ]
                keywords.append(f"{f['name']}: {set_}")
            handles = [
                f"{{offsetof({name}, {path}), kind_of<{handle}>}}" for path, handle in self.handle_fields(name)
            ]
            dtype = ", ".join(f"('{f['name']}', {self.numpy_field(f)})" for f in struct["fields"])
            keyword = ", ".join(f["name"] + "=..." for f in self.shown_fields(struct))
            self.cpp += [
                "{",
                "  static Field fields[] = {",
                *("    " + field for field in fields_in_cpp),
                "  };",
                *([f"  static const HandleField handles[] = {{{', '.join(handles)}}};"] if handles else []),
                f'  class_of<{name}> = {{"{python}", sizeof({name}), [](void* at) {{ {self.defaults_of(name, struct)} }}, '
                f"{'handles' if handles else '{}'}, fields}};",
                f'  add_struct(module, struct_base_class, class_of<{name}>, dtypes, "dtype([{dtype}])",',
                f"    {raw(self.in_python(struct['comment']))},",
                f'    "__init__(self, *, {keyword})\\n--\\n\\n");',
                "}",
            ]
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
        if "bits" in item or not item["name"]:
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
        if field["count"] > 1:
            return f"tuple[{python}, ...]", f"Sequence[{python}]"
        return python, python
