import org.forceserver.*;

/**
 * A fingertip: the tool's point is a ball with a radius of 8 mm. A floor and a wall hold it at its skin, and a post that pushes
 * everything away within 10 mm is felt 8 mm earlier.
 */
public class Fingertip {
  private static Vec3 at = new Vec3(0.02, 0, 0.03);  // m

  private static void goTo(Tool tool, String where, double x, double z) {
    final Vec3 from = at;
    Vec3 force = from;
    for (int i = 1; i <= 50; ++i) {
      at = new Vec3(from.x() + (x - from.x()) * i / 50, 0, from.z() + (z - from.z()) * i / 50);
      force = tool.evaluate(new State().pose(new Pose(at, new Quat(1, 0, 0, 0)))).wrench().force();
    }
    System.out.printf("%-26s (%5.1f, %5.1f, %5.1f) mm   (%5.2f, %5.2f, %5.2f) N%n", where, 1e3 * at.x(), 1e3 * at.y(), 1e3 * at.z(),
        Recipe.rounded(force.x()), Recipe.rounded(force.y()), Recipe.rounded(force.z()));
  }

  public static void main(String[] arguments) {
    Contact contact = new Contact().keep(Keep.FRONT).stiffness(500).limit(10);
    try (Scene scene = new Scene(); Tool tool = new Tool(scene)) {
      scene.setToolRadius(0.008);
      scene.set(ForceObject.of("floor", Primitive.PLANE).contact(contact));
      scene.set(ForceObject.of("wall", Primitive.PLANE).contact(contact).pose(ForceServer.poseFromZ(new Vec3(0, 0, 0), new Vec3(1, 0, 0))));
      scene.set(ForceObject.of("post", Primitive.POINT).pose(new Pose(new Vec3(0.04, 0, 0.008), new Quat(1, 0, 0, 0)))
          .front(Profile.of(ProfileKind.LINEAR_DECREASING, Sense.REPULSIVE, -100, 1, 10)));
      goTo(tool, "above", 0.02, 0.02);
      goTo(tool, "it touches the floor", 0.02, 0.008);
      goTo(tool, "2 mm into the floor", 0.02, 0.006);
      goTo(tool, "1 mm into the wall, too", 0.007, 0.006);
      goTo(tool, "6 mm from the post", 0.026, 0.008);
      goTo(tool, "touches the post", 0.032, 0.008);
      Recipe.finish(scene, arguments);
    }
  }
}
