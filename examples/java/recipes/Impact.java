import org.forceserver.*;

/** A wooden table that knocks: the hand comes down at three speeds, and stops as it touches, 0.1 mm below the surface. */
public class Impact {
  private static double time = 1;  // s

  private static Vec3 goTo(Tool tool, double z, double speed) {
    State state = new State().time(time += 5e-4);
    state.pose(new Pose(new Vec3(0, 0, z), new Quat(1, 0, 0, 0))).twist(new Twist(new Vec3(0, 0, -speed), new Vec3(0, 0, 0)));
    Response felt = new Response();
    tool.evaluate(state, felt);
    return felt.wrench().force();
  }

  private static void show(double speed, String when, double z, Vec3 force) {
    System.out.printf("%4.2f m/s, %-16s (%5.1f, %5.1f, %5.1f) mm   (%5.2f, %5.2f, %5.2f) N%n", speed, when, 0.0, 0.0, 1e3 * z,
        Recipe.rounded(force.x()), Recipe.rounded(force.y()), Recipe.rounded(force.z()));
  }

  private static void tap(Tool tool, double speed) {
    final double way = 5e-4 * speed, touching = -1e-4;  // m
    double z = 0.02;
    for (int i = 0; i < 400; ++i) goTo(tool, z, 0);  // 0.2 s, in which the last knock fades
    show(speed, "above", z, goTo(tool, z, 0));
    while ((z -= way) > way / 2) goTo(tool, z, speed);
    for (int i = 0; i <= 15; ++i) {
      Vec3 force = goTo(tool, touching, i == 0 ? speed : 0);
      if (i % 5 == 0) show(speed, String.format("after %3.1f ms", 0.5 * i), touching, force);
    }
  }

  public static void main(String[] arguments) {
    SurfaceSettings settings = new SurfaceSettings().impact(org.forceserver.Impact.MEDIUM);  // wood: 8 N s/m, 100 Hz, 80/s
    try (Scene scene = new Scene(); Surface surface = Surface.of(settings); Tool tool = new Tool(scene)) {
      scene.set(ForceObject.of("table", Primitive.PLANE).surface(surface)
          .contact(new Contact().keep(Keep.FRONT).stiffness(500).limit(5)));
      tap(tool, 0.2);
      tap(tool, 0.1);
      tap(tool, 0.01);
      Recipe.finish(scene, arguments);
    }
  }
}
