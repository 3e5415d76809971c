import org.forceserver.*;

/**
 * A loop of your own: a tool gives the force at a pose. Here the application is responsible for time, device and
 * safety: only the objects' own limits bound the force.
 */
public class OwnLoop {
  public static void main(String[] arguments) {
    double mass = 0.3, damping = 3, dt = 0.001;  // kg, N s/m, s: a ball on a damper, let go at 50 mm
    double x = 0.05, v = 0;
    try (Scene scene = new Scene(); Tool tool = new Tool(scene)) {
      scene.set(ForceObject.of("magnet", Primitive.POINT)  // 100 N/m, 4 N
          .front(Profile.of(ProfileKind.LINEAR_INCREASING, Sense.ATTRACTIVE, 100, 0, 4)));
      State state = new State();  // all zeros is a good state
      Response response = new Response();
      for (int i = 0; i < 2000; ++i) {
        state.pose(new Pose(new Vec3(x, 0, 0), new Quat(1, 0, 0, 0)));
        tool.evaluate(state, response);
        double force = response.wrench().force().x();
        v += (force - damping * v) / mass * dt;
        x += v * dt;
        if (i % 250 == 0) System.out.printf("%.2f s: %6.2f mm, %6.3f N%n", i * dt, x * 1e3, force);
      }
    }
  }
}
