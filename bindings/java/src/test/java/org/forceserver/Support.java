package org.forceserver;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.function.BooleanSupplier;
import org.junit.jupiter.api.function.Executable;

/** What the tests share. */
final class Support {
  static final Vec3 ORIGIN = new Vec3(0, 0, 0), UP = new Vec3(0, 0, 1);
  static final Quat UPRIGHT = new Quat(1, 0, 0, 0);
  static final Twist STILL = new Twist(ORIGIN, ORIGIN);

  /** A refusal by the library: its status, and what its sentence says. */
  static void refused(Status status, String sentence, Executable call) {
    ForceServerException e = assertThrows(ForceServerException.class, call);
    assertEquals(status, e.status(), e.getMessage());
    assertTrue(e.getMessage().contains(sentence), e.getMessage());
  }

  static ForceObject spring(String name) {
    return ForceObject.of(name, Primitive.POINT).front(Profile.of(ProfileKind.LINEAR_INCREASING, Sense.ATTRACTIVE, 200, 0, 5));
  }

  static ForceObject wall() {
    return ForceObject.wall("wall", ORIGIN, UP, 500, 10);
  }

  static Pose at(double x, double y, double z) {
    return new Pose(new Vec3(x, y, z), UPRIGHT);
  }

  /** A servo on the simulator whose hand wants to be 20 mm below z = 0. */
  static Servo servo(Scene scene, ServoMode mode) {
    try (Device device = new Device("sim:?hold=0,0,-0.02")) {
      return new Servo(scene, device, new ServoOptions().mode(mode));
    }
  }

  /** Collects garbage until the condition holds: within 20 s. */
  static void collect(BooleanSupplier condition) throws InterruptedException {
    for (int i = 0; i < 400 && !condition.getAsBoolean(); ++i) {
      System.gc();
      Thread.sleep(50);
    }
    assertTrue(condition.getAsBoolean());
  }

  static void await(BooleanSupplier condition) throws InterruptedException {
    for (int i = 0; i < 4000 && !condition.getAsBoolean(); ++i) Thread.sleep(5);
    assertTrue(condition.getAsBoolean());
  }

  /** A JVM of its own that runs main() of a test. */
  static ProcessBuilder jvm(List<String> options, Class<?> test, String... arguments) {
    List<String> command = new ArrayList<>(List.of(ProcessHandle.current().info().command().orElseThrow()));
    command.add("--enable-native-access=ALL-UNNAMED");  // JDK 24 and later warn without it
    command.addAll(options);
    command.addAll(List.of("-cp", System.getProperty("java.class.path"), test.getName()));
    command.addAll(List.of(arguments));
    return new ProcessBuilder(command).redirectErrorStream(true);
  }

  /** A number of kB from /proc/self/status. */
  static long kilobytes(String key) throws Exception {
    for (String line : Files.readAllLines(Path.of("/proc/self/status"))) {
      if (line.startsWith(key + ":")) return Long.parseLong(line.replaceAll("[^0-9]", ""));
    }
    return 0;
  }

  private Support() {}
}
