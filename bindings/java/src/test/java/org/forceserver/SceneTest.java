package org.forceserver;

import static org.junit.jupiter.api.Assertions.*;

import java.nio.DoubleBuffer;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;

/** Objects, shapes, curves, tools and files in this process. */
class SceneTest {
  @Test void objects() {
    try (Scene scene = new Scene()) {
      scene.set(Support.spring("a"));
      scene.set(Support.wall());
      assertEquals(-2, scene.evaluate(new Vec3(0.01, 0, 0.001)).x(), 0.02);
      ForceObject got = scene.get("a");
      assertEquals(200, got.front().gain());
      got.front().gain(100);
      scene.change(got, Part.PROFILES);
      assertEquals(100, scene.get("a").front().gain());
      scene.move("a", Support.at(1, 0, 0), Support.STILL);
      scene.move("a", Support.at(2, 0, 0));
      assertEquals(2, scene.get("a").pose().position().x());
      assertEquals(2, scene.motions().size());
      assertEquals(ObjectState.FELT, scene.report("wall").state());
      scene.remove("a");
      assertEquals(List.of("wall"), scene.reports().stream().map(Report::name).toList());
      scene.clear();
      assertTrue(scene.reports().isEmpty());
      Support.refused(Status.ERROR_NOT_FOUND, "a", () -> scene.get("a"));
      Support.refused(Status.ERROR_INVALID, "name", () -> scene.set(Support.spring("no/name")));
      Support.refused(Status.ERROR_STATE, "servo", scene::hand);
      Support.refused(Status.ERROR_UNSUPPORTED, "", scene::clients);
    }
  }

  @Test void many_objects_in_lists() {
    try (Scene scene = new Scene()) {
      for (int i = 0; i < 300; ++i) scene.set(Support.spring("object " + i));
      assertEquals(300, scene.reports().size());
      assertEquals(300, scene.motions().stream().map(Motion::name).distinct().count());
      assertEquals("object 299", scene.report("object 299").name());
    }
  }

  @Test void shapes() {
    try (Shape line = Shape.polyline(false, new Vec3(0, 0, 0), new Vec3(0.1, 0, 0));
         Shape mesh = Shape.mesh(Buffers.of(0.0, 0, 0, 1, 0, 0, 0, 1, 0), Buffers.of(0, 1, 2))) {
      assertEquals(6, line.points().capacity());
      assertEquals(0.1, line.points().get(3));
      assertEquals(0, line.triangles().capacity());
      assertFalse(line.info().closed());
      assertEquals(0, mesh.progress());
      mesh.build();
      assertEquals(1, mesh.progress());
      assertTrue(mesh.info().built());
      assertEquals(3, mesh.info().openEdges());
      assertFalse(mesh.info().content(0) == 0 || mesh.info().content(0) == line.info().content(0));
      assertThrows(IndexOutOfBoundsException.class, () -> mesh.info().content(2));
      assertEquals(2, mesh.triangles().get(2));
      assertEquals(new Vec3(1, 1, 0), mesh.info().upper());
      Support.refused(Status.ERROR_INVALID, "at least 2", () -> Shape.polyline(false, Support.UP));
      Support.refused(Status.ERROR_NOT_FOUND, "nowhere.obj", () -> Shape.load(Path.of("nowhere.obj"), 1));
    }
  }

  @Test void curves() {
    try (Curve table = Curve.table(0.005, 0, 2, 3, 2, 0); Curve expression = Curve.expression("3*exp(-d/0.01)")) {
      assertArrayEquals(new double[] {0, 2, 3, 2, 0}, table.table());
      assertEquals(0.005, table.step());
      assertNull(table.expression());
      assertEquals("3*exp(-d/0.01)", expression.expression());
      assertEquals(0, expression.table().length);
      Profile profile = Profile.of(ProfileKind.CUSTOM, Sense.ATTRACTIVE, 1, 0, 5).curve(table);
      assertEquals(3, ForceServer.evaluate(profile, 0, 0.01));
      profile.curve(expression);
      assertEquals(3 * Math.exp(-1), ForceServer.evaluate(profile, 0, 0.01), 1e-12);
      Support.refused(Status.ERROR_PARSE, "column", () -> Curve.expression("3*("));
    }
  }

  @Test void an_object_keeps_its_shape_and_curves() throws Exception {
    try (Scene scene = new Scene()) {
      ForceObject path = ForceObject.of("path", Primitive.POLYLINE);
      path.shape(Shape.polyline(false, new Vec3(0, 0, 0), new Vec3(0.1, 0, 0)));
      path.front(Profile.of(ProfileKind.CUSTOM, Sense.ATTRACTIVE, 1, 0, 3).curve(Curve.table(0.005, 0, 2, 3, 2, 0)));
      for (int i = 0; i < 3; ++i) {
        System.gc();
        Thread.sleep(20);
      }
      scene.set(path);
      assertEquals(-3, scene.evaluate(new Vec3(0.05, 0, 0.01)).z(), 1e-9);
      ForceObject got = scene.get("path");
      assertNotSame(path.shape(), got.shape());
      assertEquals(6, got.shape().points().capacity());
      assertArrayEquals(new double[] {0, 2, 3, 2, 0}, got.front().curve().table());
      assertNull(got.back().curve());
      scene.set(got.name("copy"));
      assertEquals(-6, scene.evaluate(new Vec3(0.05, 0, 0.01)).z(), 1e-9);

      // One that is closed is refused before the library sees it.
      got.shape().close();
      IllegalStateException e = assertThrows(IllegalStateException.class, () -> scene.set(got));
      assertEquals("this Shape is closed", e.getMessage());
      got.shape(null);
      Support.refused(Status.ERROR_INVALID, "shape", () -> scene.set(got));
      assertEquals(-6, scene.evaluate(new Vec3(0.05, 0, 0.01)).z(), 1e-9);
    }
  }

  @Test void tools() {
    try (Scene scene = new Scene(); Tool tool = new Tool(scene); Tool two = new Tool(scene, Support.ORIGIN, new Vec3(0.1, 0, 0))) {
      scene.set(Support.spring("a"));
      State state = new State().pose(Support.at(0.01, 0, 0));
      Response response = tool.evaluate(state);
      assertEquals(new Vec3(-2, 0, 0), response.wrench().force());
      assertEquals(-200, response.stiffness().xx(), 1e-9);
      assertEquals(1, response.feltCount());
      assertEquals(-3.5, two.evaluate(state).wrench().force().x(), 1e-12);  // the mean of 2 and 5 N
      tool.reset();
      scene.setTool(Support.UP, new Vec3(0, 1, 0));
      assertEquals(List.of(Support.UP, new Vec3(0, 1, 0)), scene.tool());
      scene.setToolRadius(0.25);
      assertEquals(0.25, scene.toolRadius());
      assertEquals(0.25, scene.view().pointRadius());
      Support.refused(Status.ERROR_INVALID, "radius is -1 m", () -> scene.setToolRadius(-1));
      Support.refused(Status.ERROR_INVALID, "position", () -> tool.evaluate(state.pose(Support.at(Double.NaN, 0, 0)), response));
      assertEquals(Support.ORIGIN, response.wrench().force());  // as C leaves it: zeros
    }
  }

  @Test void frame_clutch_and_clock() {
    try (Scene scene = new Scene()) {
      Frame frame = new Frame(Support.at(0, 0, 0.1), 2, 0.5);
      scene.setFrame(frame);
      assertEquals(frame, scene.frame());
      scene.setClutch(true);
      View view = scene.view();
      assertTrue(view.held());
      assertEquals(frame, view.frame());
      assertEquals(Support.ORIGIN, view.points(0));
      assertThrows(IndexOutOfBoundsException.class, () -> view.points(32));
      scene.setTime(5);
      assertEquals(5, scene.time());
      scene.setAccuracy(0.1);
      scene.setMaxStiffness(100);
    }
  }

  @Test void files(@TempDir Path folder) throws Exception {
    boolean unicode = System.getProperty("sun.jnu.encoding").equals("UTF-8");  // else no such path can be named
    Path file = folder.resolve(unicode ? "scène.json" : "scene.json");
    try (Scene scene = new Scene(); Scene other = new Scene()) {
      scene.set(Support.wall());
      scene.save(file);
      other.load(file);
      assertEquals(500, other.get("wall").back().gain());
      Files.writeString(file, "{");
      Support.refused(Status.ERROR_PARSE, "line", () -> other.load(file));
    }
  }

  @Test void the_field_equals_the_tool_bit_for_bit() {
    try (Scene scene = new Scene(); Tool tool = new Tool(scene)) {
      scene.set(Support.spring("a"));
      scene.set(Support.wall());
      int count = 1000;
      DoubleBuffer positions = Buffers.doubles(3 * count), forces = Buffers.doubles(3 * count);
      java.util.Random random = new java.util.Random(1);
      for (int i = 0; i < 3 * count; ++i) positions.put(i, 0.1 * random.nextGaussian());
      scene.evaluate(positions, forces);
      State state = new State();
      for (int i = 0; i < count; ++i) {
        state.pose(Support.at(positions.get(3 * i), positions.get(3 * i + 1), positions.get(3 * i + 2)));
        Vec3 force = tool.evaluate(state).wrench().force();
        assertEquals(force, new Vec3(forces.get(3 * i), forces.get(3 * i + 1), forces.get(3 * i + 2)));
      }
    }
  }
}
