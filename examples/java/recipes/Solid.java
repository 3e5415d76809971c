import java.nio.DoubleBuffer;
import java.nio.IntBuffer;
import org.forceserver.*;

/** A solid plate, 1 mm thick: the hand comes from above and pushes 30 mm through it, and the plate still holds it. */
public class Solid {
  public static void main(String[] arguments) {
    IntBuffer faces = Buffers.of(  // counter-clockwise as seen from outside, so the front is outside
        0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5);
    DoubleBuffer corners = Buffers.doubles(24);
    for (int i = 0; i < 8; ++i) {
      corners.put(3 * i, (i & 1) != 0 ? 0.03 : -0.03);
      corners.put(3 * i + 1, (i & 2) != 0 ? 0.03 : -0.03);
      corners.put(3 * i + 2, (i & 4) != 0 ? 0 : -0.001);
    }
    try (Scene scene = new Scene(); Shape shape = Shape.mesh(corners, faces); Tool tool = new Tool(scene)) {
      scene.set(ForceObject.of("plate", Primitive.MESH).shape(shape)
          .contact(new Contact().keep(Keep.FRONT).stiffness(200).limit(5)));
      State state = new State();
      Response felt = new Response();  // the tool remembers where it has been
      for (int i = 10; i >= -30; --i) {
        state.pose(new Pose(new Vec3(0, 0, 1e-3 * i), new Quat(1, 0, 0, 0)));
        tool.evaluate(state, felt);
        if (i % 10 != 0) continue;
        Vec3 force = felt.wrench().force();
        System.out.printf("%-26s (%5.1f, %5.1f, %5.1f) mm   (%5.2f, %5.2f, %5.2f) N%n",
            i > 0 ? "above" : "on or through the plate", 0.0, 0.0, 1.0 * i, Recipe.rounded(force.x()),
            Recipe.rounded(force.y()), Recipe.rounded(force.z()));
      }
      Recipe.finish(scene, arguments);
    }
  }
}
