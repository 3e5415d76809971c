"""generate.py FOLDER: writes into FOLDER what follows from the description of the headers: forceserver.i, the interface
for SWIG, and in java/org/forceserver the records, structs, enums and constants. The build calls it."""
import html
import pathlib
import re
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "description"))
import description  # noqa: E402

D = description.load()
STRUCTS = {s["name"]: s for s in D["structs"] if not s["for_c"]}
ENUMS = {e["name"]: e for e in D["enums"] if e["name"]}
HANDLES = {h["name"] for h in D["handles"]}
# The types of numbers: in Java, the bytes of one, how a ByteBuffer gets it, and what Java calls a buffer of them.
NUMBERS = {"double": ("double", 8, "Double", "DoubleBuffer"), "uint32_t": ("int", 4, "Int", "IntBuffer"),
           "int32_t": ("int", 4, "Int", "IntBuffer"), "uint64_t": ("long", 8, "Long", "LongBuffer")}
NAMES = {"fs_object": "ForceObject"}  # Object is java.lang's


# ------------------------------------------------------------------------------------------------------- names and kinds

def camel(name):
    first, *rest = name.split("_")
    return first + "".join(part[:1].upper() + part[1:] for part in rest)


def class_of(name):
    return NAMES.get(name) or camel("_" + name.removeprefix("fs_"))


def base(type_):
    return re.sub(r"\b(const|struct|enum)\b|\*", "", type_).strip()


def is_record(struct):
    """Plain values: nothing but doubles. Such a struct is a record; any other is a view of memory."""
    return all(f["type"] == "double" and (f["count"] == 1 or hidden(f)) or f["count"] == 1 and f["type"] in STRUCTS
               and is_record(STRUCTS[f["type"]]) for f in struct["fields"])


def doc(comment, indent=""):
    if not comment:
        return ""
    text = html.escape(comment, quote=False).replace("*/", "*&#47;").replace("@", "&#64;").replace("\\u", "&#92;u")
    lines = text.splitlines()
    if len(lines) == 1:
        return f"{indent}/** {lines[0]} */\n"
    return f"{indent}/**\n" + "".join(f"{indent} * {line}".rstrip() + "\n" for line in lines) + f"{indent} */\n"


def write(folder, name, text):
    path = folder / "java/org/forceserver" / f"{name}.java"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("package org.forceserver;\n\n" + text)


# --------------------------------------------------------------------------------------------------------------- records

def record(struct):
    name = class_of(struct["name"])
    parts, reads, writes = [], [], []
    for f in struct["fields"]:
        at = f"at + {f['offset']}"
        if hidden(f):
            writes.append(f"memory.put({at}, new byte[{f['size']}]);")
        elif f["type"] == "double":
            parts.append(f"double {camel(f['name'])}")
            reads.append(f"memory.getDouble({at})")
            writes.append(f"memory.putDouble({at}, {camel(f['name'])});")
        else:
            inner = class_of(f["type"])
            parts.append(f"{inner} {camel(f['name'])}")
            reads.append(f"{inner}.read(memory, {at})")
            writes.append(f"{camel(f['name'])}.write(memory, {at});")
    parameters = "".join(f" * @param {camel(f['name'])} {html.escape(f['comment'], quote=False) or 'its part'}\n" for f in struct["fields"]
                         if not hidden(f))
    head = doc(struct["comment"])
    head = (head[:-len(" */\n")].rstrip() + "\n" if head else "/**\n").replace("/** ", "/**\n * ", 1)
    body = "\n    ".join(writes)
    return f"""import java.nio.ByteBuffer;

{head}{" *" + chr(10)}{parameters} */
public record {name}({", ".join(parts)}) {{
  /** The bytes of one. */
  static final int SIZE = {struct["size"]};

  static {name} read(ByteBuffer memory, int at) {{
    return new {name}({", ".join(reads)});
  }}

  void write(ByteBuffer memory, int at) {{
    {body}
  }}
}}
"""


# --------------------------------------------------------------------------------------------------------------- structs

def hidden(field):
    return field["name"] in ("struct_size", "owner") or field["name"].startswith("reserved")


def accessors(struct, field):
    me, name, type_, at = class_of(struct["name"]), camel(field["name"]), field["type"], f"at + {field['offset']}"
    comment = doc(field["comment"] or "See the struct.", "  ")

    def both(java, get, put):
        if java[0].isupper() and base(type_) not in HANDLES:
            put = f'java.util.Objects.requireNonNull(value, "{name}");\n    {put}'
        return (f"{comment}  public {java} {name}() {{\n    {get}\n  }}\n\n"
                f"{comment}  public {me} {name}({java} value) {{\n    {put}\n    return this;\n  }}\n")

    if type_ == "char":
        return both("String", f"return text({at}, {field['count']});", f'text("{name}", {at}, {field["count"]}, value);')
    if field["count"] > 1 and type_ in NUMBERS:
        java, size, how, _ = NUMBERS[type_]
        return f"""{comment}  public {java} {name}(int index) {{
    java.util.Objects.checkIndex(index, {field['count']});
    return memory.bytes.get{how}({at} + index * {size});
  }}
"""
    if field["count"] > 1:
        inner = class_of(type_)
        return f"""{comment}  public {inner} {name}(int index) {{
    java.util.Objects.checkIndex(index, {field['count']});
    return {inner}.read(memory.bytes, {at} + index * {inner}.SIZE);
  }}
"""
    if type_ in NUMBERS:
        java, _, how, _ = NUMBERS[type_]
        return both(java, f"return memory.bytes.get{how}({at});", f"memory.bytes.put{how}({at}, value);")
    if type_ == "bool":
        return both("boolean", f"return memory.bytes.get({at}) != 0;", f"memory.bytes.put({at}, (byte) (value ? 1 : 0));")
    if type_ in ENUMS:
        inner = class_of(type_)
        return both(inner, f"return {inner}.of(memory.bytes.getInt({at}));", f"memory.bytes.putInt({at}, value.value());")
    if type_ in STRUCTS and is_record(STRUCTS[type_]):
        inner = class_of(type_)
        return both(inner, f"return {inner}.read(memory.bytes, {at});", f"value.write(memory.bytes, {at});")
    if type_ in STRUCTS:
        inner = class_of(type_)
        return both(inner, f"return new {inner}(memory, {at});", f"new {inner}(memory, {at}).copy(value);")
    if base(type_) in HANDLES:
        inner = class_of(base(type_))
        return both(inner, f"return ({inner}) memory.held({at});", f"memory.hold({at}, value);")
    sys.exit(f"{struct['name']}.{field['name']}: no rule tells what '{type_}' is in Java")


def makers(struct):
    """A constructor by the struct's own init, and a factory for each init that takes values."""
    me, out, has_init = class_of(struct["name"]), [], False
    for f in D["functions"]:
        if not f["inline"] or f["for_c"] or f["result"]["type"] != struct["name"]:
            continue
        if not f["parameters"]:
            has_init = True
            out.append(f"""  /** All as by default. */
  public {me}() {{
    this(new Memory(SIZE), 0);
    Native.{f["name"]}(this);
  }}
""")
            continue
        name = f["name"].removesuffix("_init").removeprefix(struct["name"]).removeprefix("fs_")
        parameters, arguments, written = [], [], []
        for p in f["parameters"]:
            if p["kind"] == "enum":
                parameters.append(f"{class_of(p['type'])} {camel(p['name'])}")
                arguments.append(f"{camel(p['name'])}.value()")
            elif p["kind"] == "value":
                parameters.append(f"{class_of(p['type'])} {camel(p['name'])}")
                arguments.append(f"Value.of({camel(p['name'])}::write)")
            else:
                given = camel(p["name"])
                parameters.append(f"{'String' if p['kind'] == 'string' else p['type']} {given}")
                arguments.append(f'java.util.Objects.requireNonNull({given}, "{given}")' if p["kind"] == "string" else given)
        out.append(f"""{doc(f["comment"], "  ")}  public static {me} {camel(name) or "of"}({", ".join(parameters)}) {{
    {me} made = new {me}(new Memory(SIZE), 0);
    Native.{f["name"]}({", ".join(arguments + ["made"])});
    return made;
  }}
""")
    if not has_init and not struct["growing"]:
        out.insert(0, f"""  /** All zeros. */
  public {me}() {{
    this(new Memory(SIZE), 0);
  }}
""")
    return out


def changes(struct_):
    """A method for each function that changes the struct: fs_surface_set_impact is SurfaceSettings.impact."""
    me = class_of(struct_["name"])
    for f in D["functions"]:
        first, *rest = f["parameters"] or [{"kind": ""}]
        if first["kind"] != "inout struct" or base(first["type"]) != struct_["name"] or "_set_" not in f["name"]:
            continue
        if any(p["kind"] != "enum" for p in rest):
            sys.exit(f"{f['name']}: only enums can follow the struct that it changes")
        parameters = ", ".join(f"{class_of(p['type'])} {camel(p['name'])}" for p in rest)
        arguments = ", ".join(["this", *(f"{camel(p['name'])}.value()" for p in rest)])
        yield f"""{doc(f["comment"], "  ")}  public {me} {camel(f["name"].partition("_set_")[2])}({parameters}) {{
    ForceServerException.check(Native.{f["name"]}({arguments}));
    return this;
  }}
"""


def handle_places(struct_, at=0):
    """Where pointers to handles stand, and to which."""
    for f in struct_["fields"]:
        if base(f["type"]) in HANDLES:
            yield at + f["offset"], base(f["type"])
        elif f["type"] in STRUCTS:
            yield from handle_places(STRUCTS[f["type"]], at + f["offset"])


def take_handles(struct_):
    """For a struct that the library fills, and whose handles it wants back."""
    if not any(f["name"] == struct_["name"] + "_release" for f in D["functions"]):
        return ""
    lines = "".join(f"    memory.take(at + {at}, pointer -> new {class_of(h)}(Native.{h}_retain(pointer)));\n"
                    for at, h in handle_places(struct_))
    return f"""  /** The shapes, curves and surface that the library gave become this object's own. */
  void takeHandles() {{
{lines}  }}

"""


def as_text(struct_):
    me = class_of(struct_["name"])
    fields = [camel(f["name"]) for f in struct_["fields"] if not hidden(f) and (f["count"] == 1 or f["type"] == "char")]
    parts = ' + ", '.join(f'{name}=" + {name}()' for name in fields)
    return f"""  /** Its fields. */
  @Override public String toString() {{
    return "{me}[{parts} + "]";
  }}
"""


def struct(struct_):
    me = class_of(struct_["name"])
    parts = makers(struct_) + [accessors(struct_, f) for f in struct_["fields"] if not hidden(f)]
    parts += [*changes(struct_), as_text(struct_)]
    handles = take_handles(struct_)
    return f"""{doc(struct_["comment"])}public final class {me} extends Struct {{
  /** The bytes of one. */
  static final int SIZE = {struct_["size"]};
{handles}
  {me}(Memory memory, int at) {{
    super(memory, at, SIZE);
  }}

{chr(10).join(parts)}}}
"""


# --------------------------------------------------------------------------------------------------- enums and constants

def prefix(names):
    """What all of these names begin with, up to a '_'."""
    shortest = min(names, key=len)
    length = next((i for i, c in enumerate(shortest) if any(n[i] != c for n in names)), len(shortest))
    return shortest[:shortest.rfind("_", 0, length) + 1]


def enum(enum_):
    name = class_of(enum_["name"])
    begin = "FS_" if enum_["name"] == "fs_status" else prefix([v["name"] for v in enum_["values"]])
    values = ",\n".join(f"{doc(v['comment'], '  ')}  {v['name'].removeprefix(begin)}({v['value']})" for v in enum_["values"])
    bits = "bits" in enum_
    from_bits = f"""
  /** Those of which the bit is set. */
  public static java.util.EnumSet<{name}> ofBits(int bits) {{
    java.util.EnumSet<{name}> set = java.util.EnumSet.noneOf({name}.class);
    for ({name} each : VALUES) {{
      if ((bits & each.value) != 0) set.add(each);
    }}
    return set;
  }}
""" if bits else ""
    return f"""{doc(enum_["comment"])}public enum {name} {{
{values};

  private static final {name}[] VALUES = values();
  private final int value;

  {name}(int value) {{
    this.value = value;
  }}

  /** The number that C has for it. */
  public int value() {{
    return value;
  }}

  static {name} of(int value) {{
    {name} found = find(value);
    if (found != null) return found;
    throw new IllegalArgumentException("{name} has no value " + value);
  }}

  /** The same; of a number that this version does not know null. */
  static {name} find(int value) {{
    for ({name} each : VALUES) {{
      if (each.value == value) return each;
    }}
    return null;
  }}
{from_bits}}}
"""


def constants():
    out = []
    for c in D["constants"]:
        out.append((c["name"], "double" if isinstance(c["value"], float) else "int", c["value"], c["comment"]))
    for e in D["enums"]:
        if not e["name"]:
            out += [(v["name"], "int", v["value"], v["comment"]) for v in e["values"]]
    lines = [f"{doc(comment, '  ')}  public static final {type_} {name.removeprefix('FS_')} = {value};\n"
             for name, type_, value, comment in out]
    return f"""/** The constants of the contract; bits of flags begin with what they are flags of. */
public final class Constants {{
{chr(10).join(lines)}
  private Constants() {{}}
}}
"""


# ------------------------------------------------------------------------------------------------------------ exceptions

def exceptions(folder):
    """A class for each status that is an error, so that it can be caught."""
    cases = ""
    for value in ENUMS["fs_status"]["values"]:
        if value["value"] >= 0:
            continue
        name = class_of(value["name"].removeprefix("FS_ERROR_").lower()) + "Exception"
        cases += f"      case {value['value']} -> new {name}(message);\n"
        write(folder, name, f"""{doc("A call ended with " + value["name"][3:] + ": " + value["comment"])}public final class {name} extends ForceServerException {{
  private static final long serialVersionUID = 1;

  {name}(String message) {{
    super(Status.{value["name"].removeprefix("FS_")}, message);
  }}
}}
""")
    write(folder, "Failures", f"""/** The exception of each status. */
final class Failures {{
  static ForceServerException of(int status, String message) {{
    return switch (status) {{
{cases}      default -> new ForceServerException(null, message);  // of a newer library
    }};
  }}

  private Failures() {{}}
}}
""")


# ------------------------------------------------------------------------------------------------------------------ SWIG

def size(type_):
    return NUMBERS[type_][1] if type_ in NUMBERS else STRUCTS[type_]["size"]


def swig_name(parameter):
    """Typemaps go by type and name, so a list must not have the name of a single struct."""
    return "list" if parameter["kind"] == "list" else parameter["name"]


def array_maps(function):
    """What is peculiar to one function: which argument counts the entries of which array."""
    names = [p["name"] for p in function["parameters"]]
    for p in function["parameters"]:
        if p["kind"] not in ("array", "out array", "list"):
            continue
        count = "capacity" if p["kind"] == "list" else p["count"]
        inner = base(p["type"])
        plain = inner in NUMBERS or is_record(STRUCTS[inner]) and p["kind"] != "list"
        buffer, unit = NUMBERS.get(inner, NUMBERS["double"])[3:0:-2] if plain else ("ByteBuffer", 1)
        pointer = p["type"].replace(" *", "") + " *"
        yield (f"ARRAY({pointer}, {swig_name(p)}, {buffer}, {unit}, arg{names.index(count) + 1}, "
               f"{size(inner) * p.get('width', 1)})")


def declaration(function):
    parameters = ", ".join(f"{p['type']}{'' if p['type'].endswith('*') else ' '}{swig_name(p)}" for p in function["parameters"])
    return f"{function['result']['type']} {function['name']}({parameters});"


def swig():
    out = ["/* Written by generate.py. */", '%include "typemaps.i"', ""]
    out += [f"NUMBER({name}, jint, int)" for name in ENUMS if name != "fs_status"]
    out += [f"STRUCT({name}, {s['size']})" for name, s in STRUCTS.items()]
    out += ["%{", *(f"static_assert(sizeof({name}) == {s['size']});" for name, s in STRUCTS.items()), "%}"]
    out += [f"HANDLE({name})" for name in sorted(HANDLES)]
    returned = sorted({base(f["result"]["type"]) for f in D["functions"] if f["result"].get("kind") == "array"})
    late = []
    for f in D["functions"]:
        if f["for_c"]:
            continue
        if f["result"]["kind"] == "array":
            late.append(declaration(f))
        elif f["result"]["kind"] == "value":
            given = ", ".join(f"{p['type']}{'' if p['type'].endswith('*') else ' '}{p['name']}" for p in f["parameters"])
            head = f"void java_{f['name']}({given}{', ' if given else ''}{f['result']['type']} *out)"
            out += [f"%{{ static {head} {{ *out = {f['name']}({', '.join(p['name'] for p in f['parameters'])}); }} %}}",
                    f"%rename({f['name']}) java_{f['name']};", head + ";"]
        else:
            out += [*array_maps(f), declaration(f)]
    out += [f"MEMORY_OF_HANDLE({type_})" for type_ in returned]
    return "\n".join(out + late) + "\n"


def main():
    folder = pathlib.Path(sys.argv[1])
    if description.stale():
        sys.exit(f"forceserver.json is older than {', '.join(description.stale())}: run bindings/description/make")
    for s in STRUCTS.values():
        write(folder, class_of(s["name"]), record(s) if is_record(s) else struct(s))
    for e in ENUMS.values():
        write(folder, class_of(e["name"]), enum(e))
    write(folder, "Constants", constants())
    exceptions(folder)
    (folder / "forceserver.i").write_text(swig())


main()
