"""Writes contract.h beside this file from the description of the public headers: how their structs are sent.

make_contract.py          writes contract.h
make_contract.py --check  only says whether it would be the same
"""
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "bindings/description"))
import description

# What no rule gives: the structs that have a record of another form, as they have handles and enums that the other end
# may have set to anything; and those that are sent as they are.
TRANSLATED = {"fs_profile": "Profile", "fs_contact": "Contact", "fs_object": "Object"}
AS_THEY_ARE = ["fs_frame", "fs_state", "fs_response", "fs_event", "fs_report", "fs_view", "fs_motion", "fs_client",
               "fs_client_view", "fs_servo_stats", "fs_device_info", "fs_tick", "fs_recorded_tick"]

target = pathlib.Path(__file__).with_name("contract.h")
described = description.load()
structs = {struct["name"]: struct for struct in described["structs"]}
handles = {handle["name"] + " *" for handle in described["handles"]}
enums = {enum["name"] for enum in described["enums"]}


def sent_fields(struct):
    """What is reserved in a frozen struct is sent, too: a later version may give it a meaning."""
    hidden = ("struct_size", "reserved") if struct["growing"] else "struct_size"
    return [field for field in struct["fields"] if field["type"] != "void *" and not field["name"].startswith(hidden)]


def kind(field):
    type_ = field["type"]
    if type_ in TRANSLATED:
        return "record"
    if type_ in handles:
        return "handle"
    if type_ in enums:
        return "enum"
    if type_ == "char" and field["count"] % 8 == 0 or type_ == "double" and field["count"] > 1:
        return "array"
    if type_ in ("bool", "uint32_t") and field["count"] == 1:
        return type_
    if type_ == "double" or type_ in structs:
        return "as it is"
    sys.exit(f"{field['name']}: no rule tells how a {type_} is sent")


def declaration(field):
    types = {"record": TRANSLATED.get(field["type"]), "enum": "int64_t", "array": field["type"],
             "as it is": field["type"]}
    array = f"[{field['count']}]" if field["count"] > 1 else ""
    return f"  {types.get(kind(field), 'uint64_t')} {field['name']}{array};"


def to_record(field):
    name = field["name"]
    return {"record": f"  out.{name} = to_record(from.{name});", "enum": f"  out.{name} = raw_value(from.{name});",
            "array": f"  std::memcpy(out.{name}, from.{name}, sizeof out.{name});", "handle": ""}.get(
                kind(field), f"  out.{name} = from.{name};")


def from_record(field):
    name = field["name"]
    return {"record": f"  out.{name} = from_record(from.{name});", "handle": "",
            "enum": f"  set_raw_value(out.{name}, static_cast<int32_t>(from.{name}));",
            "array": f"  std::memcpy(out.{name}, from.{name}, sizeof out.{name});",
            "bool": f"  out.{name} = from.{name} != 0;",
            "uint32_t": f"  out.{name} = static_cast<uint32_t>(from.{name});"}.get(kind(field), f"  out.{name} = from.{name};")


def size(field):
    return {"record": sizes.get(field["type"]), "array": field["size"], "as it is": field["size"]}.get(kind(field), 8)


def record(name):
    fields, growing = sent_fields(structs[name]), structs[name]["growing"]
    sizes[name] = sum(map(size, fields)) + 8 * growing
    me = TRANSLATED[name]
    head = ["  uint64_t known;  // bytes of the record of which its sender knows the meaning; the rest is 0"] if growing else []
    return "\n".join([
        f"struct {me} {{", *head, *map(declaration, fields), "};", f"static_assert(sizeof({me}) == {sizes[name]});", "",
        *(ends(name, fields) if growing else []),
        f"inline {me} to_record(const {name}& from) {{", f"  {me} out{{}};",
        *["  out.known = record_bytes(from.struct_size);"] * growing, *filter(None, map(to_record, fields)),
        "  return out;", "}", "",
        f"inline {name} from_record(const {me}& from) {{", f"  {name} out{{}};",
        *["  out.struct_size = struct_bytes(from.known);"] * growing, *filter(None, map(from_record, fields)),
        "  return out;", "}", ""])


def ends(name, fields):
    """Where each field ends, and what follows from that."""
    at, lines = 8, []
    for field in fields:
        at += size(field)
        lines.append(f"    {{{field['offset'] + field['size']}, {at}}},  // {field['name']}")
    return [
        "// How much of the record is known to who knows so much of the struct, and the other way round: whole fields.",
        "struct KnownEnd {", "  uint32_t of_struct, of_record;", "};", "inline constexpr KnownEnd known_ends[] = {", *lines, "};",
        f"static_assert(known_ends[{len(fields) - 1}].of_record == sizeof({TRANSLATED[name]}));", "",
        "inline uint32_t record_bytes(uint64_t struct_bytes) {", "  uint32_t out = 0;",
        "  for (const KnownEnd& end : known_ends) {", "    if (end.of_struct <= struct_bytes) out = end.of_record;", "  }",
        "  return out;", "}", "", "inline uint32_t struct_bytes(uint64_t record_bytes) {", "  uint32_t out = 0;",
        "  for (const KnownEnd& end : known_ends) {", "    if (end.of_record <= record_bytes) out = end.of_struct;", "  }",
        "  return out;", "}", ""]


sizes = {}

text = """// Written by make_contract.py from the description of the public headers: how their structs are sent.
#pragma once

#include <cstring>

#include <forceserver/server.h>

#include "base/enum.h"

namespace fs::wire {

// The record of a struct has its fields without those that mean something in one process only. A handle is a number (wire.h);
// it is 0 in what to_record gives, and null in what from_record gives. Whole numbers have 64 bits, so no record has padding.
// An enum may come as any number: it is checked where it is used.

"""
text += "\n".join(map(record, TRANSLATED))
text += "\n// The structs that are sent as they are.\n"
text += "".join(f"static_assert(sizeof({name}) == {structs[name]['size']});\n" for name in AS_THEY_ARE)
text += "\n}  // namespace fs::wire\n"

if sys.argv[1:] == ["--check"]:
    if not target.exists() or target.read_text() != text:
        sys.exit("lib/transfer/contract.h is not what the headers say: run bindings/description/make")
else:
    target.write_text(text)
