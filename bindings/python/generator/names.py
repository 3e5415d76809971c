"""What everything of the description is called in Python, and the comments in Python's words."""

import re

DOUBLES = {"fs_vec3": (3,), "fs_quat": (4,), "fs_mat3": (3, 3)}
HIDDEN = ("struct_size", "reserved")
PYTHON = {"double": "float", "bool": "bool"}  # others: int
FOR_C = re.compile(r"struct_size|_init made|_release\b|until they are destroyed")  # sentences that say nothing in Python


def camel(name):
    return "".join(part.capitalize() for part in re.sub("^fs_", "", name).split("_") if part)


def bare(type_):
    return re.sub(r"\bconst\b|\*", "", type_).strip()


def raw(text):
    return f'R"doc({text})doc"'


def indented(text, by):
    return "\n".join(by + line if line else "" for line in text.splitlines())


class Names:
    def __init__(self, description):
        self.d = description
        self.handles = {item["name"]: item for item in self.d["handles"]}
        self.structs = {
            item["name"]: item for item in self.d["structs"] if not item["for_c"]
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

    @staticmethod
    def name_enum(item):
        names = [value["name"] for value in item["values"]]
        prefix = names[0]
        while not all(name.startswith(prefix) for name in names) or not prefix.endswith("_"):
            prefix = prefix[:-1]
        item["prefix"] = prefix
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
        """The path and the handle of all pointers to handles in a struct."""
        for field in self.structs[struct]["fields"]:
            if field["type"] in self.structs and field["type"] not in DOUBLES:
                for path, handle in self.handle_fields(field["type"]):
                    yield field["name"] + "." + path, handle
            elif field["type"].endswith("*") and bare(field["type"]) in self.handles:
                yield field["name"], bare(field["type"])

    def bits(self, item):
        """The enum of a field or parameter that holds bits; None: it holds none."""
        return self.flags[item["bits"]] if "bits" in item else None

    def shown_fields(self, struct):
        return [f for f in struct["fields"] if not f["name"].startswith(HIDDEN) and f["type"] != "void *"]

    def parts(self):
        """The fs_part bit of each field of an object."""
        return {field: value["value"] for value in self.enums["fs_part"]["values"] for field in value["fields"]}
