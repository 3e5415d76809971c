package org.forceserver;

import static org.junit.jupiter.api.Assertions.*;

import java.nio.file.Path;
import java.util.concurrent.CountDownLatch;
import java.util.concurrent.TimeUnit;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.function.Executable;

/** What is refused, by which exception and in which words; and what must not be. */
class RefusalsTest {
  private static void refused(Class<? extends Exception> type, String sentence, Executable call) {
    Exception e = assertThrows(type, call);
    assertTrue(e.getMessage().contains(sentence), e.getMessage());
  }

  @Test void what_is_moved_stands_still_and_a_stream_goes_on() {
    try (Scene scene = new Scene()) {
      scene.setTime(10);
      scene.set(Support.spring("a"));
      for (int i = 0; i < 3; ++i) {
        scene.setTime(10.05 + 0.05 * i);
        scene.move("a", Support.at(0.01 * i, 0, 0));
        assertEquals(Support.STILL, scene.get("a").twist());
      }
      for (int i = 3; i < 6; ++i) {
        scene.setTime(10.05 + 0.05 * i);
        scene.stream("a", Support.at(0.01 * i, 0, 0));
      }
      assertEquals(0.2, scene.get("a").twist().linear().x(), 1e-9);
    }
  }

  @Test void an_interrupted_thread_edits() throws Exception {
    try (Scene scene = new Scene()) {
      Thread.currentThread().interrupt();
      scene.set(Support.spring("a"));
      assertTrue(Thread.interrupted());
      try (Change change = scene.change()) {
        Thread.currentThread().interrupt();
        scene.set(Support.spring("b"));
        assertTrue(Thread.interrupted());
        change.commit();
      }
      assertEquals(2, scene.reports().size());
    }
  }

  @Test void an_interrupted_thread_waits_for_a_tool_without_haste() {
    try (Scene scene = new Scene(); Tool tool = new Tool(scene)) {
      Thread.currentThread().interrupt();
      tool.evaluate(new State());
      assertTrue(Thread.interrupted());
    }
  }

  @Test void a_shape_that_is_closed_does_not_matter_to_a_profile() {
    ForceObject path = ForceObject.of("path", Primitive.POLYLINE).front(Support.spring("a").front());
    Shape shape = Shape.polyline(false, Support.ORIGIN, Support.UP);
    path.shape(shape);
    shape.close();
    assertEquals(2, ForceServer.evaluate(path.front(), 0, 0.01), 1e-12);
  }

  @Test void sentences() throws Exception {
    try (Scene scene = new Scene()) {
      refused(IllegalArgumentException.class, "timeout is -1.0 s, must be >= 0", () -> scene.sync(-1));
      refused(UnsupportedException.class, "Scene.connect", scene::clients);
      refused(NotFoundException.class, "nobody", () -> scene.get("nobody"));
      refused(ForceServerException.class, "not set, but changed (Scene.change)", () -> scene.set(Support.spring("a/b")));
      refused(ForceServerException.class, "the scene has no servo; new Servo gives it one", scene::servoStats);
      refused(IllegalArgumentException.class, "'a?b' holds a NUL character", () -> scene.remove("a\0b"));
      refused(IllegalArgumentException.class, "name holds a NUL character", () -> ForceObject.of("", Primitive.POINT).name("a\0b"));
      refused(IllegalArgumentException.class, "half of a surrogate pair", () -> scene.set(Support.spring("a\ud800")));
      refused(IllegalArgumentException.class, "half of a surrogate pair", () -> Support.spring("a").name("\ud800"));
      refused(IllegalArgumentException.class, "entry 1 of the table is NaN", () -> Curve.table(1, 0, Double.NaN));
      try (Change change = scene.change()) {
        refused(IllegalStateException.class, "Scene.change() cannot be nested", scene::change);
        change.commit();
      }
      try (Servo servo = Support.servo(scene, ServoMode.VIRTUAL)) {
        scene.set(Support.spring("a"));
        refused(TimeoutException.class, "timeout 0.25 s", () -> scene.sync(0.25));
        refused(IllegalArgumentException.class, "ticks is -1, must be >= 0", () -> servo.step(-1));
      }
    }
    assertNull(Failures.of(-99, "as a newer library says").status());
    for (Status status : Status.values()) {
      if (status != Status.OK) assertEquals(status, Failures.of(status.value(), "").status());
    }
  }

  @Test void null_is_named() {
    try (Scene scene = new Scene(); Device device = new Device("sim:")) {
      refused(NullPointerException.class, "name", () -> ForceObject.of(null, Primitive.POINT));
      refused(NullPointerException.class, "object", () -> scene.set(null));
      refused(NullPointerException.class, "pose", () -> scene.move("a", null));
      refused(NullPointerException.class, "pose", () -> Support.spring("a").pose(null));
      refused(NullPointerException.class, "twist", () -> scene.move("a", Support.at(0, 0, 0), null));
      refused(NullPointerException.class, "frame", () -> scene.setFrame(null));
      refused(NullPointerException.class, "file", () -> scene.load((Path) null));
      refused(NullPointerException.class, "scene", () -> new Tool(null));
      refused(NullPointerException.class, "device", () -> new Servo(scene, null));
      refused(NullPointerException.class, "positions", () -> scene.evaluate(null, Buffers.doubles(3)));
      refused(NullPointerException.class, "profile", () -> ForceServer.evaluate(null, 0, 0));
    }
  }

  @Test void structs_are_equal_where_their_values_are_and_say_them() {
    assertEquals(Support.spring("a"), Support.spring("a"));
    assertNotEquals(Support.spring("a"), Support.spring("b"));
    assertEquals(Support.spring("a").front().hashCode(), Support.spring("b").front().hashCode());
    assertEquals(Support.spring("a").front(), Support.spring("b").front());
    assertEquals(new State().time(3), new State().time(3));
    assertTrue(Support.spring("a").toString().startsWith("ForceObject[primitive=POINT, name=a, pose=Pose["));
    assertTrue(Support.spring("a").front().toString().contains("gain=200.0"));
    try (Scene scene = new Scene(); Curve curve = Curve.expression("d")) {
      Profile one = Profile.of(ProfileKind.CUSTOM, Sense.ATTRACTIVE, 1, 0, 5), other = Profile.of(ProfileKind.CUSTOM, Sense.ATTRACTIVE, 1, 0, 5);
      assertEquals(one, other);
      assertNotEquals(one.curve(curve), other);
      assertEquals(one, other.curve(curve));
      scene.set(Support.spring("a"));
      assertTrue(scene.report("a").toString().startsWith("Report[name=a,"), scene.report("a").toString());
      assertEquals("Scene", scene.toString());
      scene.close();
      assertEquals("closed Scene", scene.toString());
    }
  }

  @Test void edits_of_several_threads_do_not_wait_for_each_other() throws Exception {
    try (Scene scene = new Scene()) {
      ForceObject object = Support.spring("a");
      CountDownLatch inside = new CountDownLatch(2);
      Runnable edit = () -> {
        // The object is lent within the edit: while this thread has it, both edits are under way.
        scene.set(object);
        inside.countDown();
      };
      Thread[] threads = {new Thread(edit), new Thread(edit)};
      try (Memory.Lent lent = object.memory.lend(object)) {
        for (Thread thread : threads) thread.start();
        Support.await(() -> threads[0].getState() == Thread.State.WAITING && threads[1].getState() == Thread.State.WAITING);
        scene.set(Support.spring("b"));
        assertEquals(2, inside.getCount());
      }
      assertTrue(inside.await(20, TimeUnit.SECONDS));
    }
  }

  /** A servo of a shutdown hook, when others already end. */
  static final class Ending {
    public static void main(String[] arguments) {
      Runtime.getRuntime().addShutdownHook(new Thread(() -> {
        try (Scene scene = new Scene(); Device device = new Device("sim:")) {
          String said;
          try {
            new Servo(scene, device);
            said = "started";
          } catch (IllegalStateException e) {
            said = e.getMessage();
          }
          System.out.println(said + ", " + device.read().flags());
        }
      }));
    }
  }

  @Test void a_shutdown_hook_starts_no_servo() throws Exception {
    Process process = Support.jvm(java.util.List.of(), Ending.class).start();
    String said = new String(process.getInputStream().readAllBytes());
    assertTrue(said.startsWith("the JVM is ending, "), said);
    assertEquals(0, process.waitFor());
  }
}
