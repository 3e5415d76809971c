import java.nio.DoubleBuffer;
import java.nio.IntBuffer;
import org.forceserver.*;

/** A box of 60 mm x 60 mm x 40 mm: no force outside; inside, 500 N/m push the hand to the nearest face, 10 N at most. */
public class Box {
  public static void main(String[] arguments) {
    IntBuffer faces = Buffers.of(  // counter-clockwise as seen from outside, so the front is outside
        0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5);
    DoubleBuffer corners = Buffers.doubles(24);
    for (int i = 0; i < 8; ++i) {  // bit 0 of i: right, bit 1: away, bit 2: up
      corners.put(3 * i, (i & 1) != 0 ? 0.03 : -0.03);
      corners.put(3 * i + 1, (i & 2) != 0 ? 0.03 : -0.03);
      corners.put(3 * i + 2, (i & 4) != 0 ? 0.02 : -0.02);
    }
    try (Scene scene = new Scene(); Shape shape = Shape.mesh(corners, faces)) {
      scene.set(ForceObject.of("box", Primitive.MESH).shape(shape)
          .back(Profile.of(ProfileKind.LINEAR_INCREASING, Sense.ATTRACTIVE, 500, 0, 10)));
      Recipe.feel(scene, "above the box", 0, 0, 0.03);
      Recipe.feel(scene, "5 mm below the top", 0, 0, 0.015);
      Recipe.feel(scene, "5 mm from the right face", 0.025, 0, 0);
      Recipe.feel(scene, "beside a corner, outside", 0.031, 0.031, 0.021);
      Recipe.finish(scene, arguments);
    }
  }
}
