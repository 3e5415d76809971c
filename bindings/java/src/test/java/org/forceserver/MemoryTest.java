package org.forceserver;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.nio.DoubleBuffer;
import java.util.List;
import org.junit.jupiter.api.Test;

/** Resident and locked memory, each in a JVM of its own whose heap does not grow. */
class MemoryTest {
  private static final int ROUNDS = 5, ROUND = Integer.getInteger("forceserver.round", 40000);

  public static void main(String[] arguments) throws Exception {
    if (arguments[0].equals("servo")) servo();
    else many();
  }

  private static String told(String what, String... options) throws Exception {
    List<String> all = new java.util.ArrayList<>(List.of("-Xms48m", "-Xmx48m", "-XX:+AlwaysPreTouch"));
    all.addAll(List.of(options));
    Process jvm = Support.jvm(all, MemoryTest.class, what).start();
    String told = new String(jvm.getInputStream().readAllBytes()).trim();
    assertEquals(0, jvm.waitFor(), told);
    return told;
  }

  private static long[] numbers(String told) {
    return java.util.Arrays.stream(told.split(" ")).mapToLong(Long::parseLong).toArray();
  }

  /** Makes a wall felt in real time; prints resident and locked memory before, during and after the servo, kB. */
  private static void servo() throws Exception {
    ForceServer.version();
    StringBuilder line = new StringBuilder();
    try (Scene scene = new Scene()) {
      scene.set(Support.wall());
      System.gc();
      tell(line);
      try (Servo servo = Support.servo(scene, ServoMode.THREAD)) {
        Support.await(() -> {
          servo.setEnabled(true);  // a machine that is too slow stops the force: once more
          byte[][] garbage = new byte[64][4096];
          return scene.hand().sent().force().z() > 1 && garbage.length > 0;
        });
        System.gc();
        tell(line);
      }
    }
    tell(line);
    System.out.println(line);
  }

  private static void tell(StringBuilder line) throws Exception {
    line.append(Support.kilobytes("VmRSS")).append(' ').append(Support.kilobytes("VmLck")).append(' ');
  }

  /** A servo locks what its ticks use, about 5 MB, and not the pages of its host, which are ten times as many. */
  @Test void the_pages_of_the_host_are_not_locked() throws Exception {
    String told = told("servo");
    long[] kb = numbers(told);
    System.out.printf("memory before, during and after a servo: %d, %d, %d kB, of which are locked: %d, %d, %d kB%n",
        kb[0], kb[2], kb[4], kb[1], kb[3], kb[5]);
    assertTrue(kb[0] > 60000, told);
    assertTrue(kb[2] - kb[0] < 24000, told);
    assertTrue(kb[4] - kb[0] < 24000, told);
    assertTrue(kb[3] - kb[1] < 16000, told);
    assertEquals(kb[1], kb[5]);
  }

  /** Makes so many of each, five times, and a servo now and then; prints the resident memory before and after each, kB. */
  private static void many() throws Exception {
    ForceObject spring = Support.spring("a");
    DoubleBuffer points = Buffers.of(0.0, 0, 0, 0, 0, 1);
    StringBuilder line = new StringBuilder();
    for (int i = 0; i <= ROUNDS * ROUND; ++i) {
      Scene scene = new Scene();
      Tool tool = new Tool(scene);
      try (Shape shape = Shape.polyline(false, points); Curve curve = Curve.table(0.01, 1, 2)) {
        scene.set(spring);
        scene.set(ForceObject.of("b", Primitive.POLYLINE).shape(shape)
            .front(Profile.of(ProfileKind.CUSTOM, Sense.ATTRACTIVE, 1, 0, 3).curve(curve)));
        ForceObject got = scene.get("b");  // its shape and curve are left to the collector
        if (i % 2 == 0) got.shape().close();
      }
      if (i % 100 == 0) Support.servo(scene, ServoMode.VIRTUAL).close();
      if (i % 3 != 0) scene.close();  // so is a third of all scenes
      tool.close();
      if (i % ROUND != 0) continue;
      for (int k = 0; k < 3; ++k) {
        System.gc();
        Thread.sleep(100);
      }
      line.append(Support.kilobytes("VmRSS")).append(' ');
    }
    System.out.println(line);
  }

  /** What leaks grows in each round; a JVM grows by fits, most of them in the first: what the collector has not given back. */
  @Test void many_of_each_and_flat_memory() throws Exception {
    long[] kb = numbers(told("many", "-Dforceserver.round=" + ROUND));
    System.out.printf("memory after each %,d more of each: %s kB%n", ROUND, java.util.Arrays.toString(kb));
    assertEquals(1 + ROUNDS, kb.length);
    long least = Long.MAX_VALUE;
    for (int i = 1; i < kb.length; ++i) least = Math.min(least, kb[i] - kb[i - 1]);
    assertTrue(least < 3000);
    assertTrue(kb[ROUNDS] - kb[1] < 50000);
  }
}
