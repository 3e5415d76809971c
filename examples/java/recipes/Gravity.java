import org.forceserver.*;

/**
 * Gravity: the weight of 0.2 kg, downwards and the same everywhere. The force of a plane is along its normal: its front
 * draws the hand to the plane, its back drives it away from the plane, and both are downwards.
 */
public class Gravity {
  public static void main(String[] arguments) {
    double weight = 0.2 * 9.81;  // N
    try (Scene scene = new Scene()) {
      scene.set(ForceObject.of("gravity", Primitive.PLANE)
          .front(Profile.of(ProfileKind.CONSTANT, Sense.ATTRACTIVE, weight, 0, weight))
          .back(Profile.of(ProfileKind.CONSTANT, Sense.REPULSIVE, weight, 0, weight)));
      Recipe.feel(scene, "above the plane", 0, 0, 0.05);
      Recipe.feel(scene, "in the plane", 0, 0, 0);
      Recipe.feel(scene, "below the plane", 0, 0, -0.05);
      Recipe.feel(scene, "far to the side", 0.09, -0.07, 0.02);
      Recipe.finish(scene, arguments);
    }
  }
}
