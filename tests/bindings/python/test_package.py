"""The package as it is installed: its program, stubs, docstrings, and where it refuses."""

import inspect
import os
import pathlib
import re
import subprocess
import sys

import numpy as np
import pytest

import forceserver as fs
from conftest import ROOT

FOLDER = pathlib.Path(fs.__file__).parent


def test_import_in_an_empty_environment():
    code = "import forceserver as fs; s = fs.Scene(); s['a'] = fs.Point(front=fs.Custom('d', limit=1)); print(s)"
    done = subprocess.run(["env", "-i", sys.executable, "-c", code], cwd="/", capture_output=True, text=True)
    assert done.stdout == "<forceserver.Scene of 1 object>\n", done.stderr


def test_the_program():
    for program in ([sys.executable, "-m", "forceserver"], [pathlib.Path(sys.executable).parent / "forceserver"]):
        done = subprocess.run(["env", "-i", *program, "devices", "--json"], capture_output=True, text=True, cwd="/")
        assert done.returncode == 0 and "sim:" in done.stdout, done.stderr


def test_the_drivers_come_along():
    usable = {driver.scheme for driver in fs.drivers() if not driver.trouble}
    assert {"falcon", "fidel", "sim"} <= usable, fs.drivers()
    with pytest.raises(fs.Error, match="127.0.0.1"):
        fs.Device("fidel:udp:127.0.0.1:1")


def test_version_and_files():
    assert f'version = "{fs.__version__}"' in (ROOT / "bindings/python/pyproject.toml").read_text()
    assert [path.name for path in FOLDER.glob("libforceserver*")] == ["libforceserver.so.1"]
    assert (
        (FOLDER / "py.typed").exists()
        and (FOLDER / "licenses" / "LICENSE").exists()
        and not any(p.is_symlink() for p in FOLDER.rglob("*"))
    )


def test_a_sub_interpreter_is_refused(run):
    if sys.version_info >= (3, 13):
        create = "import _interpreters as i; sub = i.create('legacy'); error = i.exec(sub, code); i.destroy(sub); print(error)"
    else:
        create = """
import _xxsubinterpreters as i
sub = i.create(isolated=False)
try: error = i.run_string(sub, code)
except i.RunFailedError as e: error = e
i.destroy(sub); print(error)"""
    out = run(f"import sys\ncode = 'import forceserver'\n{create}", timeout=30)
    assert "cannot be imported in a sub-interpreter" in out


def test_stubs(tmp_path):
    mypy = pytest.importorskip("mypy.api")
    use = tmp_path / "use.py"
    use.write_text("""
import numpy as np
import forceserver as fs
from scipy.spatial.transform import Rotation  # type: ignore[import-untyped]

scene = fs.Scene()
scene["rock"] = fs.Mesh(np.eye(3), [[0, 1, 2]], front=fs.Gaussian(5, 0.01, limit=5, sense="repulsive"), orientation=Rotation.identity())
with scene.change():
    scene["rock"].move(position=(0, 0, 0.1))
    del scene["rock"]
forces = scene.evaluate(np.zeros((5, 3)))
print(forces.shape)
state, response = fs.State(), fs.Response()
state.pose.position = (0, 0, 1)
tool = fs.Tool(scene)
print(tool.evaluate(state, out=response).wrench.force.shape, tool.evaluate(np.zeros(3, fs.State.dtype)))
with fs.Servo(scene, fs.Device("sim:?path=figure8"), mode="virtual", fade=0.1) as servo:
    servo.step(10)
    print(servo.stats.ticks, scene.hand().sent.force, servo.record)
for event in scene.events(timeout=0):
    print(event.kind is fs.EventKind.READY, event.name.upper())
scene["rock"].enabled = False
scene["rock"].change(position=(0, 0, 1), enabled=True)
print(scene["rock"].pose.position, scene.get_reports()[0].name, scene.frame.scale)
try:
    fs.connect("shm:lab", "rover")
except fs.NotFoundError as error:
    print(error.status is fs.Status.NOT_FOUND)
""")
    out, err, status = mypy.run(["--strict", "--cache-dir", str(tmp_path / "cache"), str(use)])
    assert status == 0, out + err
    out, err, status = mypy.run(["--strict", "--cache-dir", str(tmp_path / "cache"), "-p", "forceserver"])
    assert status == 0, out + err
    wrong = (
        "fs.Gaussian('5', 3)",
        "fs.Servo(scene, nix=3)",
        "scene.nix()",
        "scene['a'].change(enabeld=False)",
        "scene['a'].change(front=3)",
        "scene['a'].enabled = 'no'",
        "fs.Contact(keep='frnt')",
        "fs.Servo(scene, mode='virtal')",
        "fs.Constant(1, limit=1, sense='atractive')",
    )
    use.write_text("import forceserver as fs\nscene = fs.Scene()\n" + "\n".join(wrong) + "\n")
    out, err, status = mypy.run(["--strict", "--cache-dir", str(tmp_path / "cache"), str(use)])
    assert {int(line.split(":")[1]) for line in out.splitlines() if ": error:" in line} == set(range(3, 3 + len(wrong))), out


def test_the_stub_is_what_the_module_has():
    stub = (FOLDER / "_core.pyi").read_text()
    for name in re.findall(r"^(?:class|def) (\w+)", stub, re.M):
        if not name.endswith("Fields") and name != "Rotation":
            assert hasattr(fs._core, name), name
    for name in dir(fs._core):
        if not name.startswith("_"):
            assert re.search(rf"^(?:class |def )?{name}\b", stub, re.M), name
    for name in dir(fs):
        assert fs.__all__.count(name) < 2
    assert not [name for name in fs.__all__ if not hasattr(fs, name)]


def test_docstrings_are_the_comments_of_the_headers():
    assert "several changes" in fs.Scene.change.__doc__ and "Opens a group" in fs.Scene.begin.__doc__
    assert "In C: fs_object_move." in fs.Scene.object_move.__doc__ and "N, > 0" in fs.Profile.limit.__doc__
    assert str(inspect.signature(fs.Scene.object_move)) == "(self, name, pose, twist, time)"
    assert str(inspect.signature(fs.Scene().object_move)) == "(name, pose, twist, time)"
    assert (
        str(inspect.signature(fs.pose_from_z)) == "(position, direction)" and "tool_create" not in fs.Tool.reset.__doc__
    )
    assert "Ctrl-C" in fs.shape_load.__doc__ and "Ctrl-C" in fs.Shape.build.__doc__
    assert "Ctrl-C" not in fs.Scene.object_set.__doc__
    assert "x, y, z, w" in fs.SceneObject.move.__doc__ and "x, y, z, w" in fs.__doc__
    assert "x, y, z, w" in fs.Pose.orientation.__doc__ and "sampled now" in fs.Custom.__doc__


def test_plot_says_that_matplotlib_is_missing(run):
    out = run("""
        import sys
        sys.modules["matplotlib"] = None
        import forceserver as fs
        try: fs.plot(fs.Constant(1, limit=1))
        except ImportError as error: print(error)
    """)
    assert out.startswith("fs.plot needs matplotlib, which is not installed")


def test_arrows_are_no_longer_than_the_way_to_the_next(run):
    pytest.importorskip("matplotlib")
    out = run("""
        import matplotlib; matplotlib.use("Agg")
        import numpy as np, forceserver as fs
        scene = fs.Scene()
        axes = fs.plot(scene, extent=0.05)  # no force at all
        scene["magnet"] = fs.Point(front=fs.Gaussian(2, 0.01, limit=2))
        axes = fs.plot(scene, extent=0.05)
        axes.figure.canvas.draw()
        arrows = axes.collections[0]
        longest = np.hypot(arrows.U, arrows.V).max() / arrows.scale
        print(arrows.scale_units, round(longest, 3), np.ptp(np.unique(arrows.XY[:, 0])) / 20)
        print(fs.plot(scene, extent=0.05, scale=7).collections[0].scale)
    """)
    assert out.splitlines() == ["xy 4.5 5.0", "7"]


def python_lines(file):
    text = file.read_text()
    return re.findall(r"```python\n(.*?)```", text, re.S)


@pytest.mark.parametrize("page", ["README.md", "bindings/python/README.md"])
def test_the_lines_of_the_pages_work(run, page):
    programs = python_lines(ROOT / page)
    assert programs
    for lines in programs:
        assert "mm" in run(lines)


EXAMPLES = ROOT / "examples/python"
TWINS = ROOT / "build/release/examples"  # those in C and C++
HAVE_TWINS = {"hello": "c", "own_loop": "c", "peg_in_hole": "c", "follow_path": "cpp", "custom_profile": "cpp"}


def run_example(example, folder):
    done = subprocess.run(
        [sys.executable, "-B", example],
        cwd=folder,
        capture_output=True,
        text=True,
        env={**os.environ, "MPLBACKEND": "Agg"},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("example", sorted(EXAMPLES.rglob("*.py")), ids=lambda path: path.name)
def test_examples(example, tmp_path):
    if "import matplotlib" in example.read_text():
        pytest.importorskip("matplotlib")
    if "from PIL" in example.read_text():
        pytest.importorskip("PIL")
    said = run_example(example, tmp_path)
    folder = "recipes" if example.parent.name == "recipes" else HAVE_TWINS.get(example.stem)
    if folder and (TWINS / folder / example.stem).exists():
        assert said == subprocess.run([TWINS / folder / example.stem], capture_output=True, text=True, check=True).stdout


def test_every_recipe_has_its_twin():
    twins = {path.stem for path in (EXAMPLES / "recipes").glob("*.py")} - {"recipe", "image"}
    assert twins == {path.stem for path in (ROOT / "examples/recipes").glob("*.c")}


def test_the_recipe_of_a_picture(tmp_path):
    pytest.importorskip("PIL")
    recipe, page = EXAMPLES / "recipes/image.py", ROOT / "examples/recipes/README.md"
    assert python_lines(page) == [recipe.read_text()]
    (output,) = re.findall(r"`image\.py`.*?```text\n(.*?)```", page.read_text(), re.S)
    assert run_example(recipe, tmp_path) == output
    # The middle of the dent is 1 mm deep, and it is where the picture has it; elsewhere the surface is as it would be without.
    force = {tuple(map(float, at)): float(f) for *at, f in re.findall(r"\( *(\S+), *(\S+), *(\S+)\) mm .* (\S+)\) N", output)}
    assert force[6, 5, -3] == 1.0 and force[-14, 5, -3] == 1.5 and force[6, -5, -3] > 1.48
    # Sixteen bits and colours are read as well.
    code = recipe.read_text()
    assert code.count("\nwith tempfile") == 1
    names = {}
    sys.path.insert(0, str(recipe.parent))
    try:
        exec(code.partition("\nwith tempfile")[0], names)
    finally:
        sys.path.pop(0)
    from PIL import Image

    path = tmp_path / "three.png"
    for picture, wanted in (
        (Image.fromarray(np.array([[65535], [32768], [0]], np.uint16)), [-1, 32768 / 65535 - 1, 0]),
        (Image.fromarray(np.array([[[255, 255, 255]], [[0, 255, 0]], [[0, 0, 0]]], np.uint8)), [-1, 150 / 255 - 1, 0]),
    ):
        picture.save(path)
        assert names["heights_of"](path, 1).ravel().tolist() == pytest.approx(wanted)


def test_the_figures_of_the_page(tmp_path):
    pytest.importorskip("matplotlib")
    folder, page = ROOT / "examples/python", (ROOT / "bindings/python/README.md").read_text()
    subprocess.run([sys.executable, "-B", folder / "figures.py", tmp_path], check=True)
    drawn = {file.name for file in tmp_path.glob("*.png")}
    assert drawn == {file.name for file in folder.glob("*.png")} == {"figure_3.png", "figure_4.png"}
    assert all(f"](../../examples/python/{name})" in page for name in drawn)
    assert sum(file.stat().st_size for file in folder.glob("*.png")) <= 150e3


def test_the_profiles_of_the_page(tmp_path):
    pytest.importorskip("matplotlib")
    folder = ROOT / "examples/profiles"
    subprocess.run([sys.executable, "-B", folder / "profiles.py", tmp_path], check=True)
    assert (tmp_path / "profiles.csv").read_text() == (folder / "profiles.csv").read_text()
    kinds = {name.partition(":")[0] for name in (folder / "profiles.csv").read_text().splitlines()[0].split(",")[1:]}
    wanted = {kind.name.lower().replace("_", " ") for kind in fs.ProfileKind} - {"none"}
    assert kinds == wanted
    page = (folder / "README.md").read_text()
    assert "](profiles.png)" in page and all(f"\n| {kind} |" in page for kind in wanted)
    assert (tmp_path / "profiles.png").stat().st_size <= 150e3


def test_the_picture_of_the_quickstart(tmp_path):
    pytest.importorskip("matplotlib")
    forces, picture = tmp_path / "forces.csv", tmp_path / "picture.png"
    forces.write_text("time,x,y,z,ground,rover's plane\n0,0,0,0,0,0\n0.01,100,50,0,1,0\n0.02,200,99,0,1,2\n")
    folder = ROOT / "examples/quickstart_source"
    subprocess.run(
        [sys.executable, "-B", folder / "picture.py", folder / "jacksboro_fault.asc", forces, picture], check=True
    )
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_picture_of_the_slide(tmp_path):
    pytest.importorskip("matplotlib")
    table, picture = tmp_path / "slide.csv", tmp_path / "slide.png"
    names = "time,clutch,slide x,slide y,slide z,tip x,tip y,tip z,ground,too high,ground's force,envelope's force\n"
    rows = ["0,0,0,0,0,.8,0,-.3,-.3,0,2,0", "0.01,1,.1,0,-.1,.7,0,-.1,-.3,nan,0,0", "0.02,0,.2,0,-.2,.6,0,-.1,-.3,.2,1,0"]
    table.write_text(names + "\n".join(rows))
    subprocess.run([sys.executable, "-B", ROOT / "examples/slide/picture.py", table, picture], check=True)
    assert picture.read_bytes().startswith(b"\x89PNG")
