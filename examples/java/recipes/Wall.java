import org.forceserver.*;

/** A wall: no force above z = 0; below, 500 N/m push the hand out, 10 N at most. */
public class Wall {
  public static void main(String[] arguments) {
    try (Scene scene = new Scene()) {
      Vec3 point = new Vec3(0, 0, 0), normal = new Vec3(0, 0, 1);  // the normal points to where the hand is free
      scene.set(ForceObject.wall("wall", point, normal, 500, 10));
      Recipe.feel(scene, "in front", 0, 0, 0.01);
      Recipe.feel(scene, "10 mm deep", 0, 0, -0.01);
      Recipe.feel(scene, "10 mm deep, elsewhere", 0.04, 0.03, -0.01);
      Recipe.feel(scene, "50 mm deep: the limit", 0, 0, -0.05);
      Recipe.finish(scene, arguments);
    }
  }
}
