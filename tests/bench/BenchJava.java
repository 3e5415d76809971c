import java.nio.DoubleBuffer;
import org.forceserver.*;

/** What tests/bench/java measures: the calls of bench_java.c from Java, and how long it takes until the first one. */
public class BenchJava {
  static final int CALLS = 500000, PLACES = 100000, TIMES = 20;
  static double sum;

  static void evaluate(Tool tool, State state, Response response) {
    for (int i = 0; i < CALLS; ++i) {
      state.pose(new Pose(new Vec3(1e-5 * (i & 1023), 0, 0), new Quat(1, 0, 0, 0)));
      tool.evaluate(state, response);
      sum += response.wrench().force().x();
    }
  }

  static void move(Scene scene) {
    Twist still = new Twist(new Vec3(0, 0, 0), new Vec3(0, 0, 0));
    for (int i = 0; i < CALLS / 4; ++i) {
      scene.move("spring", new Pose(new Vec3(1e-5 * (i & 1023), 0, 0), new Quat(1, 0, 0, 0)), still);
    }
  }

  static void batch(Scene scene, DoubleBuffer positions, DoubleBuffer forces) {
    for (int i = 0; i < TIMES; ++i) scene.evaluate(positions, forces);
  }

  public static void main(String[] arguments) {
    long begin = System.nanoTime();
    ForceServer.version();
    System.out.printf("load %.1f%n", (System.nanoTime() - begin) / 1e6);
    if (arguments.length > 0) return;
    try (Scene scene = new Scene(); Tool tool = new Tool(scene)) {
      scene.set(ForceObject.of("spring", Primitive.POINT)
          .front(Profile.of(ProfileKind.LINEAR_INCREASING, Sense.ATTRACTIVE, 200, 0, 5)));
      State state = new State();
      Response response = new Response();
      DoubleBuffer positions = Buffers.doubles(3 * PLACES), forces = Buffers.doubles(3 * PLACES);
      for (int i = 0; i < 3 * PLACES; ++i) positions.put(i, 1e-6 * (i / 3));
      for (int round = 0; round < 6; ++round) {  // all but the last warm up
        begin = System.nanoTime();
        evaluate(tool, state, response);
        if (round == 5) System.out.printf("evaluate %.1f%n", (double) (System.nanoTime() - begin) / CALLS);
        begin = System.nanoTime();
        move(scene);
        if (round == 5) System.out.printf("move %.1f%n", (double) (System.nanoTime() - begin) / (CALLS / 4));
        begin = System.nanoTime();
        batch(scene, positions, forces);
        if (round == 5) System.out.printf("batch %.2f%n", (double) (System.nanoTime() - begin) / TIMES / PLACES);
      }
    }
  }
}
