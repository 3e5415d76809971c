import org.forceserver.*;

/** Corduroy: cords along y, 4 mm apart, 0.4 mm high. The hand comes from above, pushes 3 mm deep, and goes across a cord. */
public class Corduroy {
  public static void main(String[] arguments) {
    double[] heights = new double[16];  // of one cord, from its top to the next
    for (int i = 0; i < 16; ++i) heights[i] = -0.0002 * (1 - Math.cos(2 * Math.PI * i / 16));
    SurfaceSettings settings = new SurfaceSettings().columns(16).rows(1).columnWidth(0.004 / 16).repeats(true);
    try (Scene scene = new Scene(); Surface surface = Surface.texture(settings, heights); Tool tool = new Tool(scene)) {
      scene.set(ForceObject.of("cloth", Primitive.PLANE).surface(surface)
          .contact(new Contact().keep(Keep.FRONT).stiffness(500).limit(5)));
      State state = new State();
      Response felt = new Response();
      for (int i = -1; i <= 8; ++i) {
        double x = i < 0 ? 0 : 5e-4 * i, z = i < 0 ? 1e-3 : -3e-3;
        state.pose(new Pose(new Vec3(x, 0, z), new Quat(1, 0, 0, 0)));
        tool.evaluate(state, felt);
        Vec3 force = felt.wrench().force();
        System.out.printf("%-26s (%5.1f, %5.1f, %5.1f) mm   (%5.2f, %5.2f, %5.2f) N%n", i < 0 ? "above" : "on the cloth",
            1e3 * x, 0.0, 1e3 * z, Recipe.rounded(force.x()), Recipe.rounded(force.y()), Recipe.rounded(force.z()));
      }
      Recipe.finish(scene, arguments);
    }
  }
}
