"""The forms for issues (.github/ISSUE_TEMPLATE) are such as the hosting page takes, and ask for the page of forceserver doctor.
Ends with 77 where Python has no yaml (Debian: python3-yaml).

issue_forms.py ROOT
"""
import pathlib
import re
import sys

try:
    import yaml
except ImportError:
    print("Python has no yaml; not tried")
    sys.exit(77)

folder = pathlib.Path(sys.argv[1]) / ".github/ISSUE_TEMPLATE"
NEEDED = {"markdown": {"value"}, "textarea": {"label"}, "input": {"label"}, "dropdown": {"label", "options"}, "checkboxes": {"label", "options"}}
MAY = {"textarea": {"description", "placeholder", "value", "render"}, "input": {"description", "placeholder", "value"},
       "dropdown": {"description", "multiple", "default"}, "checkboxes": {"description"}}
failures, name = 0, folder.name  # of what is looked at


class Loader(yaml.SafeLoader):
    """Refuses a key that is given twice, of which yaml silently takes the last."""

    def construct_mapping(self, node, deep=False):
        keys = [self.construct_object(key) for key, _ in node.value]
        for key in keys:
            expect(keys.count(key) == 1, f"{key} is given twice")
        return super().construct_mapping(node, deep)


def expect(holds, sentence):
    global failures
    if not holds:
        failures += 1
        print(f"FAILED: {name}: {sentence}")


def check(element, ids):
    kind, attributes = element.get("type"), element.get("attributes") or {}
    expect(kind in NEEDED, f"its element has the type {kind}")
    missing = NEEDED.get(kind, set()) - set(attributes)
    expect(not missing, f"{element.get('id', kind)} lacks {missing}")
    unknown = set(attributes) - NEEDED.get(kind, set()) - MAY.get(kind, set())
    expect(not unknown, f"{element.get('id', kind)} has {unknown}")
    expect(set(element) <= {"type", "id", "attributes", "validations"}, f"its element has the keys {set(element)}")
    if kind == "markdown":
        return
    expect(re.fullmatch(r"[A-Za-z0-9_-]+", str(element.get("id"))), f"an id is {element.get('id')}")
    expect(element.get("id") not in ids, f"{element.get('id')} is there twice")
    ids.add(element.get("id"))
    expect(isinstance(attributes.get("label"), str), f"{element.get('id')} has a label that is no text")
    options = attributes.get("options", ["a"])
    expect(options and all(isinstance(option, str) for option in options) and len(set(options)) == len(options),
           f"{element.get('id')} has the options {options}")


files = sorted(folder.glob("*.y*ml"))
forms = [path for path in files if path.stem != "config"]
expect(len(forms) >= 2, f"there are {len(forms)} forms")
for path in files:
    name = path.name
    try:
        form = yaml.load(path.read_text(), Loader)
    except yaml.YAMLError as error:
        expect(False, f"it is no YAML: {error}")
        continue
    if path not in forms:
        expect(isinstance(form.get("blank_issues_enabled"), bool), "it does not say whether there are issues without a form")
        continue
    for key in ["name", "description"]:
        expect(isinstance(form.get(key), str) and form[key], f"it lacks {key}")
    expect(set(form) <= {"name", "description", "title", "labels", "assignees", "body"}, f"it has the keys {set(form)}")
    ids = set()
    for element in form.get("body") or []:
        check(element, ids)
    expect(ids, "it asks for nothing")
    doctor = [element for element in form.get("body") or [] if element.get("id") == "doctor"]
    expect(doctor and "`forceserver doctor`" in doctor[0]["attributes"].get("label", ""), "it does not ask for forceserver doctor")
print(f"{len(forms)} forms, {failures} failures")
sys.exit(failures > 0)
