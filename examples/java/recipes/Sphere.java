import org.forceserver.*;

/**
 * A ball with a radius of 30 mm: no force outside; inside, 500 N/m push the hand out, away from the centre. No mesh is
 * needed: the force of a point can fall with the distance d, as 500 N/m * (30 mm - d), and is 0 from 30 mm on.
 */
public class Sphere {
  public static void main(String[] arguments) {
    double stiffness = 500, radius = 0.03;  // N/m, m
    try (Scene scene = new Scene()) {
      scene.set(ForceObject.of("ball", Primitive.POINT)
          .front(Profile.of(ProfileKind.LINEAR_DECREASING, Sense.REPULSIVE, -stiffness, stiffness * radius, 10)));
      Recipe.feel(scene, "outside", 0, 0.04, 0);
      Recipe.feel(scene, "on the surface", 0, 0.03, 0);
      Recipe.feel(scene, "10 mm deep", 0, 0.02, 0);
      Recipe.feel(scene, "10 mm deep, elsewhere", 0.012, 0, -0.016);
      Recipe.feel(scene, "25 mm deep: the limit", 0, 0, 0.005);
      Recipe.finish(scene, arguments);
    }
  }
}
