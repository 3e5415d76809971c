import org.forceserver.*;

/**
 * A ball of honey with a radius of 30 mm: it resists motion with 20 N s/m, 5 N at most, and does nothing to a hand at
 * rest. The damping of an object acts where its profile gives a force: here a force too small to be felt.
 */
public class ViscousZone {
  static void feelMoving(Tool tool, String where, double x, double speed) {
    Vec3 zero = new Vec3(0, 0, 0);
    State hand = new State();
    hand.pose(new Pose(new Vec3(x, 0, 0), new Quat(1, 0, 0, 0))).twist(new Twist(new Vec3(0, speed, 0), zero));
    Vec3 f = tool.evaluate(hand).wrench().force();
    System.out.printf("%-26s %4.1f m/s   (%5.2f, %5.2f, %5.2f) N%n", where, speed, Recipe.rounded(f.x()), Recipe.rounded(f.y()),
        Recipe.rounded(f.z()));
  }

  public static void main(String[] arguments) {
    ForceObject honey = ForceObject.of("honey", Primitive.POINT).damping(20)
        .front(Profile.of(ProfileKind.CONSTANT, Sense.ATTRACTIVE, 1e-6, 0, 5).reach(0.03));  // the limit is for both
    try (Scene scene = new Scene(); Tool tool = new Tool(scene)) {
      scene.set(honey);
      feelMoving(tool, "inside, at rest", 0.01, 0);
      feelMoving(tool, "inside, slowly", 0.01, 0.1);
      feelMoving(tool, "inside, back", 0.01, -0.1);
      feelMoving(tool, "inside, fast: the limit", 0.01, 1);
      feelMoving(tool, "outside, slowly", 0.04, 0.1);
      Recipe.finish(scene, arguments);
    }
  }
}
