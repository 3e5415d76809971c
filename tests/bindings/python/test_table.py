"""Flat tables, meshes of other libraries, and names to complete."""

import numpy as np
import pytest

import forceserver as fs


def test_a_record_is_a_flat_table(scene, spring):
    scene["spring"] = spring
    with fs.Servo(scene, "sim:?hold=0.03,0,0", mode="virtual") as servo:
        servo.step(50)
        record = scene.get_record(0)
        columns = fs.table(record)
        reports = fs.table(scene.get_reports())
        views = fs.table(scene.get_view())
        assert (fs.table([servo.record[0], servo.record[1]])["late"] == servo.record["late"][:2]).all()
    assert all(column.shape == (50,) and column.dtype.names is None for column in columns.values())
    assert (columns["tick.state.pose.position.x"] == record["tick"]["state"]["pose"]["position"][:, 0]).all()
    assert (columns["tick.state.pose.orientation.w"] == 1).all() and columns["number"].tolist() == list(range(1, 51))
    assert (columns["tick.response.stiffness.zz"] == record["tick"]["response"]["stiffness"][:, 2, 2]).all()
    assert not [name for name in columns if "reserved" in name]
    assert reports["name"].tolist() == ["spring"] and "wrench.force.z" in reports
    assert views["points.31.z"].tolist() == [0] and views["frame.scale"].tolist() == [1]
    assert fs.table(fs.Object(name="a"))["name"].tolist() == ["a"] and fs.table(fs.devices())["uri"][0] == "sim:"


def test_pandas_takes_a_table(scene, spring):
    pandas = pytest.importorskip("pandas")
    scene["spring"] = spring
    with fs.Servo(scene, "sim:", mode="virtual") as servo:
        servo.step(5)
        frame = pandas.DataFrame(fs.table(scene.get_record(0)))
    assert len(frame) == 5 and frame["tick.sent.force.x"].dtype == float


POINTS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


class Trimesh:
    vertices, faces = np.array(POINTS, float), np.array([[0, 1, 2], [0, 2, 3]])


class PolyData:
    def __init__(self, faces):
        self.points, self.faces = np.array(POINTS, np.float32), np.array(faces)

    def triangulate(self):
        return PolyData([3, 0, 1, 2, 3, 0, 2, 3])


class Cells:
    def __init__(self, type, data):
        self.type, self.data = type, np.array(data)


class Meshio:
    def __init__(self, *cells):
        self.points, self.cells = np.array(POINTS, float), list(cells)


@pytest.mark.parametrize(
    "mesh",
    [
        Trimesh(),
        PolyData([3, 0, 1, 2, 3, 0, 2, 3]),
        PolyData([4, 0, 1, 2, 3]),
        Meshio(Cells("line", [[0, 1]]), Cells("triangle", [[0, 1, 2]]), Cells("triangle", [[0, 2, 3]]), Cells("tetra", [[0, 1, 2, 3]])),
    ],
    ids=["trimesh", "PyVista", "PyVista with a square", "meshio"],
)
def test_meshes_of_other_libraries(mesh):
    shape = fs.Mesh(mesh, scale=0.001, name="part").shape
    assert shape.get_triangles().tolist() == [[0, 1, 2], [0, 2, 3]] and shape.get_points()[2].tolist() == [0.001, 0.001, 0]


def test_meshes_that_are_no_triangles():
    for cells, words in (([Cells("quad", [[0, 1, 2, 3]]), Cells("triangle", [[0, 1, 2]])], "quad"), ([Cells("tetra", [[0, 1, 2, 3]])], "tetra"), ([], "none")):
        with pytest.raises(TypeError, match=f"this Meshio has cells of type {words}; a surface of triangles is needed"):
            fs.Mesh(Meshio(*cells))


def test_meshes_of_the_libraries_themselves():
    trimesh = pytest.importorskip("trimesh")
    made = fs.Mesh(trimesh.creation.box((0.1, 0.2, 0.3)))
    assert made.shape.get_info().closed and len(made.shape.get_triangles()) == 12
    meshio = pytest.importorskip("meshio")
    made = fs.Mesh(meshio.Mesh(POINTS, [("triangle", [[0, 1, 2], [0, 2, 3]])]))
    assert len(made.shape.get_triangles()) == 2


def test_names_to_complete(scene, spring):
    assert scene._ipython_key_completions_() == []
    scene.update(rock=spring, wall=spring)
    assert scene._ipython_key_completions_() == ["rock", "wall"]
