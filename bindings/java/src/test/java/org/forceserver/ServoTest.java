package org.forceserver;

import static org.junit.jupiter.api.Assertions.*;

import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import java.util.concurrent.TimeUnit;
import java.util.concurrent.atomic.AtomicReference;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.function.Executable;
import org.junit.jupiter.api.io.TempDir;

/** Devices, servos and servers; waits; the end of the JVM. */
class ServoTest {
  private final String endpoint = "shm:java-" + ProcessHandle.current().pid();

  @Test void the_drivers_come_along() {
    List<DriverInfo> drivers = ForceServer.drivers();
    List<String> usable = drivers.stream().filter(d -> d.trouble().isEmpty()).map(DriverInfo::scheme).toList();
    assertTrue(usable.containsAll(List.of("falcon", "fidel", "sim")), usable + " of " + drivers);
    String said = assertThrows(Exception.class, () -> new Device("fidel:udp:127.0.0.1:1")).getMessage();
    assertTrue(said.contains("127.0.0.1"), said);
  }

  @Test void devices() {
    assertTrue(ForceServer.devices().stream().anyMatch(each -> each.uri().equals("sim:")));
    try (Device device = new Device("sim:")) {
      assertEquals("FIDEL (simulated)", device.info().name());
      assertEquals(3, device.info().forceAxes());
      device.write(new Wrench(new Vec3(1, 0, 0), Support.ORIGIN));
      assertEquals(Constants.STATE_READY, device.read().flags());
    }
    Support.refused(Status.ERROR_INVALID, "colour", () -> new Device("sim:?colour=red"));
    Support.refused(Status.ERROR_IO, "nowhere.so", () -> ForceServer.loadDriver(Path.of("/nowhere.so")));
  }

  @Test void a_servo_in_virtual_time() throws Exception {
    try (Scene scene = new Scene(); Servo servo = Support.servo(scene, ServoMode.VIRTUAL)) {
      scene.set(Support.wall());
      servo.step(2050);
      Hand hand = scene.hand();
      assertEquals(2.2, hand.sent().force().z(), 0.3);
      assertTrue(hand.state().pose().position().z() > -0.006);
      assertEquals(1, hand.response().feltCount());
      List<Tick> record = servo.record();
      assertEquals(2000, record.size());
      assertEquals(hand.sent(), record.get(1999).sent());
      assertEquals(Status.OK, record.get(5).device());
      Response last = record.get(1999).response();
      assertEquals(hand.sent().force().z(), last.wrench().force().z(), 1e-9);
      ServoStats stats = scene.servoStats();
      assertEquals(2050, stats.ticks());
      assertEquals(java.util.EnumSet.noneOf(Fault.class), Fault.ofBits(stats.faults()));
      assertEquals("FIDEL (simulated)", scene.deviceInfo().name());
      Support.refused(Status.ERROR_STATE, "servo", () -> Support.servo(scene, ServoMode.VIRTUAL));
      servo.setEnabled(false);
      servo.step(1);
      assertEquals(0, scene.hand().sent().force().z());
      assertThrows(IllegalArgumentException.class, () -> servo.step(-1));
    }
    try (Scene scene = new Scene()) {
      Support.refused(Status.ERROR_INVALID, "blend", () -> new Servo(scene, new Device("sim:"), new ServoOptions().blend(1e7)));
    }
  }

  @SuppressWarnings("try")  // the server goes before its block ends
  @Test void connected() throws Exception {
    Support.refused(Status.ERROR_NOT_FOUND, "", () -> Scene.connect(endpoint, "a"));
    try (Scene scene = new Scene(); Servo servo = Support.servo(scene, ServoMode.THREAD);
         Server server = servo.serve(endpoint, new ServerOptions().maxObjects(100));
         Scene first = Scene.connect(endpoint, "first"); Scene second = Scene.connect(endpoint, "second", 1)) {
      scene.set(Support.wall());
      first.set(Support.spring("spring"));
      Shape shape = Shape.polyline(false, Support.ORIGIN, Support.UP);
      second.set(ForceObject.of("path", Primitive.POLYLINE).shape(shape)
          .front(Profile.of(ProfileKind.CUSTOM, Sense.ATTRACTIVE, 1, 0, 3).curve(Curve.table(0.01, 0, 1))));
      first.sync(20);
      second.sync(20);
      assertEquals(List.of("server", "first", "second"), first.clients().stream().map(Client::name).toList());
      assertEquals(List.of("server", "first", "second"), first.views().stream().map(ClientView::name).toList());
      assertEquals(second.view().frame(), first.views().get(2).view().frame());
      ForceObject theirs = first.get("second/path");
      assertEquals("second/path", theirs.name());
      assertEquals(6, theirs.shape().points().capacity());
      assertArrayEquals(new double[] {0, 1}, theirs.front().curve().table());
      theirs.front().gain(0.5);
      first.change(theirs, Part.PROFILES);
      first.sync(20);
      Event event;
      do {
        event = second.nextEvent(20);
      } while (event.kind() != EventKind.EDITED);
      assertEquals("path", event.name());
      assertEquals("first", event.text());
      assertEquals(0.5, second.get("path").front().gain());
      assertEquals(3, second.motions().size());
      assertEquals(1, second.motions("first").size());
      assertEquals(1, second.motionsSince("first", 0).size());
      long newest = second.motionsSince(null, 0).get(1).motionRevision();
      assertEquals(0, second.motionsSince(null, newest).size());
      assertEquals(scene.frame(), second.frame("server"));
      assertFalse(second.view("first").held());
      Support.refused(Status.ERROR_EXISTS, "first", () -> Scene.connect(endpoint, "first"));

      // A tool of one's own in a connected scene, and a group over it.
      try (Tool tool = new Tool(first); Tool here = new Tool(scene)) {
        scene.clear();
        scene.set(Support.spring("spring"));
        State state = new State().pose(Support.at(0.012, 0.003, -0.004));
        assertEquals(here.evaluate(state).wrench(), tool.evaluate(state).wrench());
      }
      try (Change change = first.change()) {
        first.remove("spring");
        first.set(Support.spring("other"));
        change.commit();
      }
      try (Change change = first.change()) {
        first.clear();
        assertNotNull(change);
      }
      first.sync(20);
      assertEquals(List.of("other"), first.motions("first").stream().map(each -> each.name().replace("first/", "")).toList());

      // The server goes amid a change.
      Change change = first.change();
      first.clear();
      server.close();
      Support.await(() -> {
        try {
          first.sync(0.1);
          return false;
        } catch (ForceServerException e) {
          return e.status() == Status.ERROR_DISCONNECTED;
        } catch (InterruptedException e) {
          throw new AssertionError(e);
        }
      });
      change.close();
      Support.refused(Status.ERROR_DISCONNECTED, "", () -> first.set(Support.spring("x")));
    }
  }

  /** An interrupt ends it, and so does close(); the thread's interrupt is gone then. */
  private static void ends(boolean byClose, Scene scene, Executable wait) throws Exception {
    AtomicReference<Throwable> why = new AtomicReference<>();
    Thread thread = new Thread(() -> {
      try {
        wait.execute();
      } catch (Throwable e) {
        why.set(e);
      }
    });
    thread.start();
    Thread.sleep(150);
    if (byClose) scene.close();
    else thread.interrupt();
    thread.join(20000);
    assertEquals(byClose ? IllegalStateException.class : InterruptedException.class, why.get().getClass());
  }

  @Test void waits_end() throws Exception {
    for (boolean byClose : new boolean[] {false, true}) {
      Scene scene = new Scene(), other = new Scene();
      ends(byClose, scene, () -> scene.nextEvent(1000));
      try (Servo servo = Support.servo(other, ServoMode.VIRTUAL)) {
        other.set(Support.spring("a"));
        Support.refused(Status.ERROR_TIMEOUT, "", () -> other.sync(0.25));
        ends(byClose, other, () -> other.sync(1000));
        assertNotNull(servo);
      }
      if (!byClose) {
        assertEquals(EventKind.NONE, scene.nextEvent(0).kind());
        assertEquals(EventKind.NONE, scene.nextEvent(0.15).kind());
        ends(false, scene, () -> Scene.connect("shm:java-nobody", "me", 1000));
        ends(false, scene, () -> Scene.connect("shm:java-nobody?timeout=5", "me"));
      }
      scene.close();
      other.close();
    }
    Support.refused(Status.ERROR_NOT_FOUND, "", () -> Scene.connect("shm:java-nobody", "me", 0.25));
    try (Scene scene = new Scene()) {
      assertThrows(IllegalArgumentException.class, () -> scene.sync(Double.NaN));
      assertThrows(IllegalArgumentException.class, () -> scene.nextEvent(-1));
    }
  }

  /** Nobody waits any more for what an interrupted connect gets: it is given back, and its name is free. */
  @Test void an_interrupted_connect_is_given_back() throws Exception {
    String alone = endpoint + "-late";  // the interrupted connect may still wait for it when this test has ended
    try (Scene scene = new Scene()) {
      ends(false, scene, () -> Scene.connect(alone + "?timeout=20", "late"));
      try (Servo servo = Support.servo(scene, ServoMode.THREAD); Server server = servo.serve(alone)) {
        Support.await(() -> {
          try (Scene late = Scene.connect(alone, "late")) {
            return late.clients().size() == 2;
          } catch (ForceServerException e) {
            assertEquals(Status.ERROR_EXISTS, e.status());
            return false;
          } catch (InterruptedException e) {
            throw new AssertionError(e);
          }
        });
        assertNotNull(server);
      }
    }
  }

  /** What a JVM of its own does: it makes a wall felt, and then ends in its way. */
  public static void main(String[] arguments) throws Exception {
    ForceServer.loadDriver(Path.of(arguments[0]));
    Scene scene = new Scene();
    scene.set(Support.wall());
    Servo servo = new Servo(scene, new Device("witness:" + arguments[1]));
    Support.await(() -> {
      servo.setEnabled(true);
      return scene.hand().sent().force().z() > 1;
    });
    switch (arguments[2]) {
      case "return" -> { }
      case "exit" -> new Thread(() -> System.exit(0)).start();
      case "throw" -> throw new RuntimeException("as asked");
      default -> Thread.sleep(100000);  // until a signal
    }
  }

  @Test void the_end_of_the_jvm_zeroes_the_force(@TempDir Path folder) throws Exception {
    Path driver = folder.resolve("libwitness.so");
    assertEquals(0, new ProcessBuilder("cc", "-shared", "-fPIC", "-I../../include", "src/test/c/witness.c", "-o", driver.toString())
        .inheritIO().start().waitFor());
    for (String way : List.of("return", "exit", "throw", "TERM", "INT")) {
      Path forces = folder.resolve(way), temporary = Files.createDirectory(folder.resolve(way + "-tmp"));
      Process jvm = Support.jvm(List.of("-Xmx64m", "-Djava.io.tmpdir=" + temporary), ServoTest.class, driver.toString(),
          forces.toString(), way).redirectOutput(folder.resolve(way + ".log").toFile()).start();
      if (way.length() > 2 && Character.isUpperCase(way.charAt(0))) {
        Support.await(() -> Files.exists(forces) && lines(forces).stream().anyMatch(line -> line.length() > 0 && Double.parseDouble(line) > 1));
        new ProcessBuilder("kill", "-" + way, Long.toString(jvm.pid())).start().waitFor();
      }
      assertTrue(jvm.waitFor(60, TimeUnit.SECONDS), way);
      List<String> told = lines(forces);
      assertTrue(told.stream().anyMatch(line -> !line.equals("closed") && Double.parseDouble(line) > 1), way);
      int last = told.size() - 1;
      while (told.get(last).equals("closed")) --last;
      assertEquals(0, Double.parseDouble(told.get(last)), way + ": " + told.subList(Math.max(0, told.size() - 5), told.size()));
      try (var left = Files.list(temporary)) {
        assertEquals(List.of(), left.filter(each -> !each.getFileName().toString().startsWith("hsperf")).toList());
      }
    }
  }

  private static List<String> lines(Path file) {
    try {
      String text = Files.readString(file);
      return List.of(text.substring(0, text.lastIndexOf('\n') + 1).split("\n"));
    } catch (java.io.IOException e) {
      throw new java.io.UncheckedIOException(e);
    }
  }
}
