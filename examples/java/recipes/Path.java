import org.forceserver.*;

/**
 * A path: it draws the hand to itself, most strongly 10 mm away, with 3 N. On the path and from 20 mm on there is no
 * force, so the force does not jump when the hand comes or goes.
 */
public class Path {
  public static void main(String[] arguments) {
    try (Scene scene = new Scene();
         Shape line = Shape.polyline(false, new Vec3(-0.06, 0, 0), new Vec3(0, 0, 0), new Vec3(0.06, 0, 0.03));
         Curve curve = Curve.table(0.005, 0, 2, 3, 2, 0)) {  // every 5 mm; smooth in between; the last one also holds beyond
      scene.set(ForceObject.of("path", Primitive.POLYLINE).shape(line)
          .front(Profile.of(ProfileKind.CUSTOM, Sense.ATTRACTIVE, 1, 0, 3).curve(curve)));
      Recipe.feel(scene, "on the path", -0.03, 0, 0);
      Recipe.feel(scene, "5 mm beside it", -0.03, 0.005, 0);
      Recipe.feel(scene, "10 mm below it", -0.03, 0, -0.01);
      Recipe.feel(scene, "30 mm beside it", -0.03, 0.03, 0);
      Recipe.feel(scene, "10 mm past its end", -0.07, 0, 0);
      Recipe.finish(scene, arguments);
    }
  }
}
