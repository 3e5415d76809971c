import java.awt.color.ColorSpace;
import java.awt.image.BufferedImage;
import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import javax.imageio.ImageIO;
import org.forceserver.*;

/** A picture becomes a relief: white is the surface, black lies 1 mm deeper. The hand pushes 3 mm deep and goes across a dent. */
public class Image {
  /** A dark spot on white, 6 pixels right of the middle and 5 above it. */
  private static void draw(Path path) throws IOException {
    BufferedImage picture = new BufferedImage(41, 31, BufferedImage.TYPE_BYTE_GRAY);
    for (int row = 0; row < 31; ++row) {
      for (int column = 0; column < 41; ++column) {
        double distance = Math.hypot(column - 26, row - 10);
        picture.getRaster().setSample(column, row, 0, (int) Math.rint(255 * (1 - Math.exp(-Math.pow(distance / 5, 2)))));
      }
    }
    ImageIO.write(picture, "png", path.toFile());
  }

  /** 0: black, 1: white. A grey pixel is read as it stands: getRGB would brighten it. */
  private static double grey(BufferedImage picture, int column, int row) {
    if (picture.getColorModel().getColorSpace().getType() == ColorSpace.TYPE_GRAY) {
      return picture.getRaster().getSample(column, row, 0) / (Math.pow(2, picture.getSampleModel().getSampleSize(0)) - 1);
    }
    int rgb = picture.getRGB(column, row);
    return (0.299 * (rgb >> 16 & 255) + 0.587 * (rgb >> 8 & 255) + 0.114 * (rgb & 255)) / 255;
  }

  public static void main(String[] arguments) throws IOException {
    Path path = Files.createTempFile("dent", ".png");
    draw(path);
    BufferedImage picture = ImageIO.read(path.toFile());
    Files.delete(path);

    int columns = picture.getWidth(), rows = picture.getHeight();
    double[] heights = new double[columns * rows];  // the lowest row comes first, as y goes upwards in the picture
    for (int i = 0; i < heights.length; ++i) heights[i] = 1e-3 * (grey(picture, i % columns, rows - 1 - i / columns) - 1);
    double width = 1e-3;  // m, of a pixel
    SurfaceSettings settings = new SurfaceSettings().columns(columns).rows(rows).columnWidth(width).rowWidth(width)
        .firstColumn(-width * (columns - 1) / 2).firstRow(-width * (rows - 1) / 2);
    try (Scene scene = new Scene(); Surface surface = Surface.texture(settings, heights); Tool tool = new Tool(scene)) {
      scene.set(ForceObject.of("relief", Primitive.PLANE).surface(surface)
          .contact(new Contact().keep(Keep.FRONT).stiffness(500).limit(5)));
      State state = new State();
      Response felt = new Response();
      double[][] places = {{-14, 5, 1}, {-14, 5, -3}, {1, 5, -3}, {6, 5, -3}, {11, 5, -3}, {6, 0, -3}, {6, -5, -3}};  // mm
      for (double[] at : places) {
        state.pose(new Pose(new Vec3(1e-3 * at[0], 1e-3 * at[1], 1e-3 * at[2]), new Quat(1, 0, 0, 0)));
        tool.evaluate(state, felt);
        Vec3 force = felt.wrench().force();
        System.out.printf("%-26s (%5.1f, %5.1f, %5.1f) mm   (%5.2f, %5.2f, %5.2f) N%n", at[2] > 0 ? "above" : "on the relief",
            at[0], at[1], at[2], Recipe.rounded(force.x()), Recipe.rounded(force.y()), Recipe.rounded(force.z()));
      }
      Recipe.finish(scene, arguments);
    }
  }
}
