import org.forceserver.*;

/**
 * A hazard: a border, here a circle with a radius of 40 mm, that keeps the hand away on both sides, most strongly 10 mm
 * away, with 3 N. On the border itself there is no force, so the force does not jump when the hand is pushed across it;
 * from 30 mm on there is none either.
 */
public class Hazard {
  public static void main(String[] arguments) {
    Vec3[] border = new Vec3[360];  // with so many the force hardly jumps where, inside, two edges are equally near
    for (int i = 0; i < 360; ++i) {
      double angle = Math.toRadians(i + 0.5);
      border[i] = new Vec3(0.04 * Math.cos(angle), 0.04 * Math.sin(angle), 0);
    }
    try (Scene scene = new Scene(); Shape circle = Shape.polyline(true, border);  // closed: the last is joined to the first
         Curve curve = Curve.table(0.005, 0, 2.2, 3, 2.4, 1.2, 0.3, 0)) {
      scene.set(ForceObject.of("hazard", Primitive.POLYLINE).shape(circle)
          .front(Profile.of(ProfileKind.CUSTOM, Sense.REPULSIVE, 1, 0, 3).curve(curve)));
      Recipe.feel(scene, "on the border", 0.04, 0, 0);
      Recipe.feel(scene, "10 mm outside", 0.05, 0, 0);
      Recipe.feel(scene, "10 mm inside", 0.03, 0, 0);
      Recipe.feel(scene, "10 mm above the border", 0.04, 0, 0.01);
      Recipe.feel(scene, "in the middle", 0, 0, 0);
      Recipe.finish(scene, arguments);
    }
  }
}
