import org.forceserver.*;

/** A table that sticks and slips: the hand pushes with 1 N on it, 2 mm deep, and is drawn aside, back, and aside again. */
public class StickSlip {
  private static Vec3 goTo(Tool tool, double x, double z) {
    State state = new State();
    state.pose(new Pose(new Vec3(x, 0, z), new Quat(1, 0, 0, 0)));
    Response felt = new Response();
    tool.evaluate(state, felt);
    return felt.wrench().force();
  }

  public static void main(String[] arguments) {
    SurfaceSettings settings = new SurfaceSettings().staticFriction(0.8).dynamicFriction(0.4).slipDistance(2e-3);
    try (Scene scene = new Scene(); Surface surface = Surface.of(settings); Tool tool = new Tool(scene)) {
      scene.set(ForceObject.of("table", Primitive.PLANE).surface(surface)
          .contact(new Contact().keep(Keep.FRONT).stiffness(500).limit(5)));
      goTo(tool, 0, 1e-3);  // from above
      int x = 0;
      for (int stop : new int[] {0, 10, 16, 20, 40, 80, 70, 64, 75, 90}) {  // 0.1 mm
        Vec3 force;
        do {  // in small steps, as a hand goes
          x += Integer.signum(stop - x);
          force = goTo(tool, 1e-4 * x, -2e-3);
        } while (x != stop);
        System.out.printf("%-26s (%5.1f, %5.1f, %5.1f) mm   (%5.2f, %5.2f, %5.2f) N%n", "on the table", 0.1 * x, 0.0, -2.0,
            Recipe.rounded(force.x()), Recipe.rounded(force.y()), Recipe.rounded(force.z()));
      }
      Recipe.finish(scene, arguments);
    }
  }
}
