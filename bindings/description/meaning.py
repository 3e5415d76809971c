"""What the declarations of the public headers do not tell, and no comment has to: which enums are bits, which fields and
parameters hold them, the units of the fields, and which fields the parts of an object are. describe.py checks it and puts it into
the description; a comment can be said anew without changing a binding.
"""

# Enums whose values are bits; an enum without a name is called by what its values begin with.
BITS = {"fs_part", "FS_STATE_", "FS_RESPONSE_", "fs_fault", "FS_OFF_"}

# Fields and parameters that hold such bits.
FLAGS = {
    "fs_state.flags": "FS_STATE_",
    "fs_response.flags": "FS_RESPONSE_",
    "fs_servo_stats.faults": "fs_fault",
    "fs_servo_stats.protections_off": "FS_OFF_",
    "fs_tick.faults": "fs_fault",
    "fs_object_change.parts": "fs_part",
}

# The fields of each struct by their unit; "": numbers without one, or of one that depends on another field.
UNITS = {
    "fs_vec3": {"": "x y z"},
    "fs_quat": {"": "w x y z"},
    "fs_pose": {"m": "position", "": "orientation"},
    "fs_twist": {"m/s": "linear", "rad/s": "angular"},
    "fs_wrench": {"N": "force", "N m": "torque"},
    "fs_mat3": {"": "xx xy xz yx yy yz zx zy zz"},
    "fs_profile": {"N": "limit", "m": "reach", "": "gain offset width"},
    "fs_contact": {"N/m": "stiffness", "N": "limit", "N s/m": "damping", "": "friction"},
    "fs_object": {"s": "time start lifetime", "N s/m": "damping"},
    "fs_shape_info": {"m": "lower upper"},
    "fs_surface_settings": {
        "m": "slip_distance column_width row_width first_column first_row",
        "": "static_friction dynamic_friction",
        "N s/m": "impact_gain",
        "Hz": "impact_frequency",
        "1/s": "impact_decay",
    },
    "fs_frame": {"": "scale force_scale"},
    "fs_view": {"": "points", "m": "point_radius"},
    "fs_report": {"N/m": "stiffness_wanted stiffness_applied", "m": "distance", "": "weight point texture_lost impact_lost"},
    "fs_motion": {"s": "time horizon"},
    "fs_event": {"s": "time", "": "value"},
    "fs_state": {"s": "time", "": "grip"},
    "fs_response": {"N": "error_bound", "": "stiffness"},
    "fs_device_info": {
        "m": "workspace_radius workspace_height resolution",
        "rad": "workspace_angle",
        "N": "force_max",
        "N m": "torque_max",
        "Hz": "rate link_rate controller_rate",
        "s": "delay controller_delay watchdog",
        "N s/m": "damping controller_damping",
        "kg": "mass",
    },
    "fs_servo_options": {
        "Hz": "rate",
        "N": "force_limit",
        "N m": "torque_limit",
        "N/s": "slew_limit",
        "m/s": "speed_limit",
        "s": "ramp fade blend delay",
        "N s/m": "damping",
        "N/m": "max_stiffness",
    },
    "fs_servo_stats": {
        "Hz": "rate link_rate",
        "N/m": "max_stiffness",
        "N s/m": "damping",
        "J": "energy",
        "s": "late_p50 late_p99 late_max compute_p50 compute_p99 compute_max delay link_delay_p50 link_delay_p99",
        "": "link_loss",
    },
    "fs_tick": {"s": "late compute"},
    "fs_server_options": {"s": "lease", "N": "force_limit"},
    "fs_client": {"s": "connected", "N": "force_limit"},
}

# The fields of an object that each part of it has (fs_part).
PARTS = {
    "FS_PART_POSE": "pose twist time",
    "FS_PART_PROFILES": "front back damping start",
    "FS_PART_CONTACT": "contact surface",
    "FS_PART_SHAPE": "primitive shape",
    "FS_PART_OTHER": "lifetime tool_points enabled",
}


def common(names):
    """What all of these names begin with, up to a '_'."""
    prefix = names[0]
    while not all(name.startswith(prefix) for name in names) or not prefix.endswith("_"):
        prefix = prefix[:-1]
    return prefix


def require(good, what):
    if not good:
        raise SystemExit(f"meaning.py: {what}")


def add(item, key, value):
    if value:
        item[key] = value


def add_to(description):
    """Adds what the tables say: `bits` of enums, fields and parameters, `unit` of fields, `fields` of parts."""
    enums = {enum["name"] or common([value["name"] for value in enum["values"]]): enum for enum in description["enums"]}
    require(enums.keys() >= BITS, f"the headers have no enum {BITS - enums.keys()}")
    for name, enum in enums.items():
        add(enum, "bits", name in BITS)
        for value in enum["values"]:
            number = value["value"]
            require(name not in BITS or number & (number - 1) == 0, f"{value['name']} of {name} is no bit")
    structs = {struct["name"]: struct for struct in description["structs"] if not struct["for_c"]}
    left = dict(FLAGS)
    for struct in structs.values():
        units = {field: unit for unit, fields in UNITS.get(struct["name"], {}).items() for field in fields.split()}
        for field in struct["fields"]:
            name = f"{struct['name']}.{field['name']}"
            is_number = field["type"] in ("double", "fs_vec3", "fs_quat", "fs_mat3") and not field["name"].startswith("reserved")
            require(is_number == (field["name"] in units), f"UNITS has {'no' if is_number else 'a needless'} {name}")
            add(field, "unit", units.pop(field["name"], ""))
            add(field, "bits", left.pop(name, ""))
        require(not units, f"{struct['name']} has no {', '.join(units)}")
    require(structs.keys() >= UNITS.keys(), f"the headers have no {UNITS.keys() - structs.keys()}")
    for function in description["functions"]:
        for parameter in function["parameters"]:
            add(parameter, "bits", left.pop(f"{function['name']}.{parameter['name']}", ""))
    require(not left, f"the headers have no {', '.join(left)}")
    require(set(FLAGS.values()) <= BITS, f"{set(FLAGS.values()) - BITS} are no bits")
    for value in enums["fs_part"]["values"]:
        add(value, "fields", PARTS.get(value["name"], "").split())
    fields = {field["name"] for field in structs["fs_object"]["fields"]
              if field["type"] != "void *" and not field["name"].startswith(("struct_size", "reserved"))}
    parted = [field for value in enums["fs_part"]["values"] for field in value.get("fields", [])]
    require(sorted(parted) == sorted(fields - {"name"}), f"PARTS and fs_object differ in {fields ^ {'name', *parted}}")
