import java.awt.BasicStroke;
import java.awt.BorderLayout;
import java.awt.Color;
import java.awt.Component;
import java.awt.Container;
import java.awt.Cursor;
import java.awt.Dimension;
import java.awt.Graphics;
import java.awt.Graphics2D;
import java.awt.GraphicsEnvironment;
import java.awt.GridLayout;
import java.awt.RenderingHints;
import java.awt.event.MouseAdapter;
import java.awt.event.MouseEvent;
import java.awt.geom.Ellipse2D;
import java.awt.geom.Path2D;
import java.awt.image.BufferedImage;
import java.io.File;
import java.nio.DoubleBuffer;
import java.util.ArrayList;
import java.util.EnumMap;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import java.util.function.BiConsumer;
import javax.imageio.ImageIO;
import javax.swing.BorderFactory;
import javax.swing.JComboBox;
import javax.swing.JComponent;
import javax.swing.JFrame;
import javax.swing.JLabel;
import javax.swing.JPanel;
import javax.swing.JTextField;
import javax.swing.SwingUtilities;
import javax.swing.WindowConstants;
import org.forceserver.*;

/**
 * A laboratory for profiles: choose a primitive and a profile, drag its components (gain, offset or width, limit), see
 * f(d), and feel it meanwhile.
 *
 * java -cp forceserver.jar examples/java/laboratory/Laboratory.java [shm:NAME] [--screenshot FILE.png]
 *
 * It is a client of the server at shm:NAME (shm:laboratory). Where there is none it starts one itself, with a simulated
 * hand that goes up and down through z = 0. --screenshot needs no display: it writes the picture and ends.
 */
public class Laboratory {
  static final double RANGE = 0.06, MOST = 12;  // m and N, of the plot
  static final double GRIP = 0.02;              // m, where a slope is dragged
  static final String NAME = "laboratory";

  // ------------------------------------------------------------------------------------------------------ what is edited

  /** The components of a profile; `second` is the offset, of a gaussian the width. */
  record Components(double gain, double second, double limit, Sense sense) {}

  /** All that the window edits. Only the thread of Swing changes it; `changed` says that it is to be sent. */
  static final class Model {
    Primitive primitive = Primitive.POINT;
    ProfileKind kind = ProfileKind.GAUSSIAN;
    String expression = "3*d/0.01*exp(0.5-(d/0.01)^2/2)";
    Curve curve = Curve.expression(expression);
    final Map<ProfileKind, Components> components = new EnumMap<>(Map.of(
        ProfileKind.CONSTANT, new Components(2, 0, 10, Sense.ATTRACTIVE),
        ProfileKind.LINEAR_INCREASING, new Components(200, 0, 5, Sense.ATTRACTIVE),
        ProfileKind.LINEAR_DECREASING, new Components(-150, 5, 6, Sense.REPULSIVE),
        ProfileKind.GAUSSIAN, new Components(5, 0.015, 8, Sense.REPULSIVE),
        ProfileKind.QUADRATIC, new Components(5000, 0, 8, Sense.ATTRACTIVE),
        ProfileKind.INVERSE, new Components(0.05, 0, 6, Sense.REPULSIVE),
        ProfileKind.CUSTOM, new Components(1, 0, 5, Sense.ATTRACTIVE)));

    Components now() {
      return components.get(kind);
    }

    Profile profile() {
      Components c = now();
      Profile profile = Profile.of(kind, c.sense, c.gain, c.second, c.limit);
      return kind == ProfileKind.CUSTOM ? profile.curve(curve) : profile;
    }

    /** Both sides of a plane or mesh have the profile. */
    ForceObject object(Shape wave, Shape box) {
      ForceObject object = ForceObject.of(NAME, primitive).front(profile());
      if (primitive == Primitive.PLANE || primitive == Primitive.MESH) object.back(profile());
      if (primitive == Primitive.POLYLINE) object.shape(wave);
      if (primitive == Primitive.MESH) object.shape(box);
      return object;
    }
  }

  // ------------------------------------------------------------------------------------------------------ what is felt

  /** The connection: a thread of its own sends the newest object, and asks what is felt. */
  static final class Link extends Thread {
    private final Scene scene;
    private final List<AutoCloseable> own = new ArrayList<>();  // the server, where it is ours
    private Runnable heard;              // set before it starts
    private ForceObject wanted;  // guarded by this
    private boolean whole;       // whether its primitive is new
    volatile String status = "", problem = "";
    volatile double distance = Double.NaN, force, sent;
    volatile boolean felt;

    Link(String endpoint) throws InterruptedException {
      super("laboratory link");
      setDaemon(true);
      Scene connected;
      try {
        connected = Scene.connect(endpoint, NAME);
        status = "connected to " + endpoint;
      } catch (ForceServerException e) {
        if (e.status() != Status.ERROR_NOT_FOUND) throw e;
        Scene empty = new Scene();
        Device device = new Device("sim:?path=touch&hand=firm");
        Servo servo = new Servo(empty, device);
        own.addAll(List.of(servo.serve(endpoint), servo, device, empty));
        connected = Scene.connect(endpoint, NAME);
        status = "simulated hand, served at " + endpoint;
      }
      scene = connected;
    }

    /** From now on this object is to be felt; whole: not only its profiles are new. */
    synchronized void send(ForceObject object, boolean whole) {
      wanted = object;
      this.whole |= whole;
      notify();
    }

    @Override public void run() {
      try {
        while (true) {
          ForceObject object;
          boolean all;
          synchronized (this) {
            if (wanted == null) wait(30);
            object = wanted;
            all = whole;
            wanted = null;
            whole = false;
          }
          try {
            if (object != null && all) scene.set(object);
            else if (object != null) scene.change(object, Part.PROFILES);
            listen();
            problem = "";
          } catch (ForceServerException e) {
            problem = e.getMessage();
            if (e.status() == Status.ERROR_DISCONNECTED) return;
          }
          SwingUtilities.invokeLater(heard);
        }
      } catch (InterruptedException | IllegalStateException end) {
        return;
      }
    }

    private void listen() {
      Vec3 whole = scene.hand().sent().force();
      sent = Math.sqrt(whole.x() * whole.x() + whole.y() * whole.y() + whole.z() * whole.z());
      for (Report report : scene.reports()) {
        if (!report.name().equals(NAME)) continue;
        Vec3 share = report.wrench().force();
        distance = report.distance();
        force = Math.sqrt(share.x() * share.x() + share.y() * share.y() + share.z() * share.z());
        felt = report.state() == ObjectState.FELT && Double.isFinite(distance);
      }
    }

    void close() throws Exception {
      interrupt();
      scene.close();
      for (AutoCloseable each : own) each.close();
    }
  }

  // ---------------------------------------------------------------------------------------------------------- the plot

  /** A point of the plot that can be dragged: where it is (m, N), and what another place makes of the components. */
  record Knob(String name, double d, double f, BiConsumer<Double, Double> drag) {}

  static final class Plot extends JComponent {
    private static final long serialVersionUID = 1;
    private static final int LEFT = 56, RIGHT = 20, TOP = 20, BOTTOM = 44;
    private static final Color INK = new Color(0x263238), FAINT = new Color(0xdfe5e8), CURVE = new Color(0x1565c0),
        LIMIT = new Color(0xc62828), HAND = new Color(0x2e7d32), KNOB = new Color(0xef6c00);
    private final transient Model model;
    private final transient Link link;
    private final transient Runnable edited;
    private String held;

    Plot(Model model, Link link, Runnable edited) {
      this.model = model;
      this.link = link;
      this.edited = edited;
      setPreferredSize(new Dimension(720, 440));
      MouseAdapter mouse = new MouseAdapter() {
        @Override public void mousePressed(MouseEvent e) {
          held = near(e);
        }

        @Override public void mouseReleased(MouseEvent e) {
          held = null;
        }

        @Override public void mouseMoved(MouseEvent e) {
          setCursor(Cursor.getPredefinedCursor(near(e) == null ? Cursor.DEFAULT_CURSOR : Cursor.HAND_CURSOR));
        }

        @Override public void mouseDragged(MouseEvent e) {
          drag(held, (e.getX() - LEFT) * RANGE / across(), (getHeight() - BOTTOM - e.getY()) * MOST / up());
        }
      };
      addMouseListener(mouse);
      addMouseMotionListener(mouse);
    }

    /** Moves a knob to (d, f), within the plot. */
    void drag(String name, double d, double f) {
      for (Knob knob : knobs()) {
        if (!knob.name.equals(name)) continue;
        knob.drag.accept(Math.min(Math.max(d, 0), RANGE), Math.min(Math.max(f, 0), MOST));
        edited.run();
      }
    }

    private double across() {
      return getWidth() - LEFT - RIGHT;
    }

    private double up() {
      return getHeight() - TOP - BOTTOM;
    }

    private double x(double d) {
      return LEFT + d / RANGE * across();
    }

    private double y(double f) {
      return getHeight() - BOTTOM - Math.min(Math.max(f, -0.3), MOST + 0.3) / MOST * up();
    }

    private String near(MouseEvent e) {
      String name = null;
      double nearest = 14;
      for (Knob knob : knobs()) {
        double distance = Math.hypot(e.getX() - x(knob.d), e.getY() - y(knob.f));
        if (distance < nearest) {
          nearest = distance;
          name = knob.name;
        }
      }
      return name;
    }

    private void put(double gain, double second, double limit) {
      model.components.put(model.kind, new Components(gain, second, limit, model.now().sense));
    }

    private List<Knob> knobs() {
      Components c = model.now();
      double gain = c.gain, second = c.second, limit = c.limit;
      List<Knob> knobs = new ArrayList<>();
      knobs.add(new Knob("limit", RANGE, limit, (d, f) -> put(gain, second, Math.max(f, 0.1))));
      switch (model.kind) {
        case CONSTANT -> knobs.add(new Knob("gain", RANGE / 2, gain, (d, f) -> put(f, 0, limit)));
        case LINEAR_INCREASING, LINEAR_DECREASING -> {
          boolean rising = model.kind == ProfileKind.LINEAR_INCREASING;
          knobs.add(new Knob("offset", 0, second, (d, f) -> put(gain, f, limit)));
          knobs.add(new Knob("gain", GRIP, gain * GRIP + second, (d, f) -> {
            double slope = (f - second) / GRIP;
            put(rising ? Math.max(slope, 0) : Math.min(slope, 0), second, limit);
          }));
        }
        case GAUSSIAN -> {
          knobs.add(new Knob("gain", 0, gain, (d, f) -> put(f, second, limit)));
          knobs.add(new Knob("width", second, gain * Math.exp(-0.5), (d, f) -> put(gain, Math.max(d, 0.001), limit)));
        }
        case QUADRATIC -> {
          knobs.add(new Knob("offset", 0, second, (d, f) -> put(gain, f, limit)));
          knobs.add(new Knob("gain", GRIP, gain * GRIP * GRIP + second, (d, f) -> put((f - second) / (GRIP * GRIP), second, limit)));
        }
        case INVERSE -> {
          knobs.add(new Knob("gain", GRIP, gain / GRIP + second, (d, f) -> put(Math.max(f - second, 0) * GRIP, second, limit)));
          knobs.add(new Knob("offset", 0.9 * RANGE, gain / (0.9 * RANGE) + second, (d, f) -> put(gain, f - gain / (0.9 * RANGE), limit)));
        }
        default -> {
          double one = ForceServer.evaluate(model.profile().gain(1).limit(1e9), 0, GRIP / 2);
          if (one > 0) knobs.add(new Knob("gain", GRIP / 2, gain * one, (d, f) -> put(f / one, 0, limit)));
        }
      }
      return knobs;
    }

    @Override protected void paintComponent(Graphics graphics) {
      Graphics2D g = (Graphics2D) graphics.create();
      g.setRenderingHint(RenderingHints.KEY_ANTIALIASING, RenderingHints.VALUE_ANTIALIAS_ON);
      g.setRenderingHint(RenderingHints.KEY_TEXT_ANTIALIASING, RenderingHints.VALUE_TEXT_ANTIALIAS_ON);
      g.setColor(Color.WHITE);
      g.fillRect(0, 0, getWidth(), getHeight());
      for (int mm = 0; mm <= 60; mm += 10) {
        g.setColor(FAINT);
        g.drawLine((int) x(mm * 1e-3), (int) y(0), (int) x(mm * 1e-3), (int) y(MOST));
        g.setColor(INK);
        g.drawString(Integer.toString(mm), (int) x(mm * 1e-3) - 6, (int) y(0) + 18);
      }
      for (int n = 0; n <= MOST; n += 2) {
        g.setColor(FAINT);
        g.drawLine((int) x(0), (int) y(n), (int) x(RANGE), (int) y(n));
        g.setColor(INK);
        g.drawString(Integer.toString(n), LEFT - 24, (int) y(n) + 5);
      }
      g.drawString("distance d, mm", (int) x(RANGE / 2) - 45, getHeight() - 8);
      g.drawString("f(d), N", 6, 14);

      g.setColor(LIMIT);
      g.setStroke(new BasicStroke(1.5f, BasicStroke.CAP_BUTT, BasicStroke.JOIN_MITER, 1, new float[] {6, 5}, 0));
      g.drawLine((int) x(0), (int) y(model.now().limit), (int) x(RANGE), (int) y(model.now().limit));

      int count = 601;  // the library itself says what the profile gives
      DoubleBuffer distances = Buffers.doubles(count), forces = Buffers.doubles(count);
      for (int i = 0; i < count; ++i) distances.put(i, i * RANGE / (count - 1));
      ForceServer.evaluate(model.profile(), 0, distances, forces);
      Path2D line = new Path2D.Double();
      for (int i = 0; i < count; ++i) {
        if (i == 0) line.moveTo(x(0), y(forces.get(0)));
        else line.lineTo(x(distances.get(i)), y(forces.get(i)));
      }
      g.setColor(CURVE);
      g.setStroke(new BasicStroke(2.5f));
      g.draw(line);

      if (Double.isFinite(link.distance) && link.distance <= RANGE) {
        g.setColor(HAND);
        g.setStroke(new BasicStroke(1.5f));
        g.drawLine((int) x(link.distance), (int) y(0), (int) x(link.distance), (int) y(MOST));
        g.fill(new Ellipse2D.Double(x(link.distance) - 6, y(link.force) - 6, 12, 12));
        g.drawString(String.format(Locale.ROOT, "hand: %.2f N", link.force), (int) Math.min(x(link.distance) + 8, getWidth() - 110),
            TOP + 14);
      }
      for (Knob knob : knobs()) {
        g.setColor(knob.name.equals(held) ? INK : KNOB);
        g.fill(new Ellipse2D.Double(x(knob.d) - 7, y(knob.f) - 7, 14, 14));
        g.setColor(INK);
        g.drawString(knob.name, (int) Math.min(x(knob.d) + 10, getWidth() - 46), (int) y(knob.f) - 8);
      }
      g.dispose();
    }
  }

  // -------------------------------------------------------------------------------------------------------- the window

  final Model model = new Model();
  final Shape wave, box;
  final Link link;
  final Plot plot;
  final JPanel panel = new JPanel(new BorderLayout(8, 8));
  private final JLabel values = new JLabel(" "), status = new JLabel(" ");

  Laboratory(Link link) {
    this.link = link;
    link.heard = this::show;
    Vec3[] points = new Vec3[41];
    for (int i = 0; i < points.length; ++i) points[i] = new Vec3(-0.08 + 0.004 * i, 0.02 * Math.sin(i * 0.157), 0);
    wave = Shape.polyline(false, points);
    DoubleBuffer corners = Buffers.doubles(24);
    for (int i = 0; i < 24; ++i) corners.put(i, (i / 3 >> i % 3 & 1) != 0 ? 0.02 : -0.02);
    box = Shape.mesh(corners, Buffers.of(0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6,
        1, 3, 5, 3, 7, 5));
    plot = new Plot(model, link, () -> edited(false));

    JComboBox<Primitive> primitive = new JComboBox<>(Primitive.values());
    JComboBox<ProfileKind> kind = new JComboBox<>(ProfileKind.values());
    JComboBox<Sense> sense = new JComboBox<>(Sense.values());
    JTextField expression = new JTextField(model.expression, 26);
    kind.removeItem(ProfileKind.NONE);
    primitive.setSelectedItem(model.primitive);
    kind.setSelectedItem(model.kind);
    sense.setSelectedItem(model.now().sense);
    expression.setEnabled(false);
    primitive.addActionListener(e -> {
      model.primitive = (Primitive) primitive.getSelectedItem();
      edited(true);
    });
    kind.addActionListener(e -> {
      model.kind = (ProfileKind) kind.getSelectedItem();
      sense.setSelectedItem(model.now().sense);
      expression.setEnabled(model.kind == ProfileKind.CUSTOM);
      edited(false);
    });
    sense.addActionListener(e -> {
      Components c = model.now();
      model.components.put(model.kind, new Components(c.gain, c.second, c.limit, (Sense) sense.getSelectedItem()));
      edited(false);
    });
    expression.addActionListener(e -> {
      try {
        model.curve = Curve.expression(expression.getText());  // what the object has of the last one lives with it
        edited(false);
      } catch (ForceServerException bad) {
        status.setText(bad.getMessage());
      }
    });

    JPanel choices = new JPanel(new GridLayout(2, 4, 8, 2));
    for (String name : new String[] {"primitive", "profile", "sense", "custom: f(d, t), N; Enter"}) choices.add(new JLabel(name));
    for (Component each : new Component[] {primitive, kind, sense, expression}) choices.add(each);
    JPanel below = new JPanel(new GridLayout(2, 1));
    below.add(values);
    below.add(status);
    panel.setBorder(BorderFactory.createEmptyBorder(10, 10, 10, 10));
    panel.add(choices, BorderLayout.NORTH);
    panel.add(plot, BorderLayout.CENTER);
    panel.add(below, BorderLayout.SOUTH);
    edited(true);
    link.start();
  }

  /** Sends the object, and shows it. */
  private void edited(boolean whole) {
    link.send(model.object(wave, box), whole);
    show();
  }

  private void show() {
    Components c = model.now();
    String second = switch (model.kind) {
      case GAUSSIAN -> String.format(Locale.ROOT, "width %.1f mm", 1e3 * c.second);
      case CONSTANT, CUSTOM -> "no offset";
      default -> String.format(Locale.ROOT, "offset %.2f N", c.second);
    };
    String unit = switch (model.kind) {
      case LINEAR_INCREASING, LINEAR_DECREASING -> "N/m";
      case QUADRATIC -> "N/m^2";
      case INVERSE -> "N m";
      case CUSTOM -> "";
      default -> "N";
    };
    values.setText(String.format(Locale.ROOT, "gain %.4g %s     %s     limit %.2f N", c.gain, unit, second, c.limit));
    status.setText(link.problem.isEmpty() ? String.format(Locale.ROOT, "%s     this object: %.2f N     all objects: %.2f N", link.status,
        link.force, link.sent) : link.problem);
    plot.repaint();
  }

  private static void layOut(Component component) {
    component.doLayout();
    if (component instanceof Container container) {
      for (Component each : container.getComponents()) layOut(each);
    }
  }

  /** Drags the gain to 4 N, waits until that is felt, and writes the picture. */
  private static void screenshot(Laboratory laboratory, File file) throws Exception {
    JPanel panel = laboratory.panel;
    SwingUtilities.invokeAndWait(() -> {
      if (!panel.isShowing()) {
        panel.setSize(panel.getPreferredSize());
        layOut(panel);
      }
      laboratory.plot.drag("gain", 0, 4);
    });
    for (int i = 0; i < 3000 && !(laboratory.link.felt && laboratory.link.force > 0.5); ++i) Thread.sleep(10);
    BufferedImage image = new BufferedImage(panel.getWidth(), panel.getHeight(), BufferedImage.TYPE_INT_RGB);
    SwingUtilities.invokeAndWait(() -> {
      laboratory.show();
      panel.printAll(image.createGraphics());
    });
    ImageIO.write(image, "png", file);
    System.out.printf(Locale.ROOT, "felt %.2f N at %.1f mm; gain %.2f N; %s is %d by %d%n", laboratory.link.force,
        1e3 * laboratory.link.distance, laboratory.model.now().gain, file.getName(), image.getWidth(), image.getHeight());
  }

  public static void main(String[] arguments) throws Exception {
    String endpoint = "shm:laboratory", picture = null;
    for (int i = 0; i < arguments.length; ++i) {
      if (arguments[i].equals("--screenshot") && i + 1 < arguments.length) picture = arguments[++i];
      else if (arguments[i].startsWith("shm:")) endpoint = arguments[i];
      else {
        System.err.println("usage: Laboratory [shm:NAME] [--screenshot FILE.png]");
        System.exit(2);
      }
    }
    boolean headless = GraphicsEnvironment.isHeadless();
    if (headless && picture == null) {
      System.err.println("laboratory: there is no display; --screenshot FILE.png needs none");
      System.exit(1);
    }
    Laboratory[] made = new Laboratory[1];
    try {
      Link link = new Link(endpoint);
      SwingUtilities.invokeAndWait(() -> {
        made[0] = new Laboratory(link);
        if (headless) return;
        JFrame frame = new JFrame("forceserver laboratory");
        frame.setDefaultCloseOperation(WindowConstants.EXIT_ON_CLOSE);  // the exit zeroes the force first
        frame.add(made[0].panel);
        frame.pack();
        frame.setVisible(true);
      });
    } catch (ForceServerException e) {
      System.err.println("laboratory: " + e.getMessage());
      System.exit(1);
    }
    if (picture != null) {
      screenshot(made[0], new File(picture));
      made[0].link.close();
      System.exit(0);
    }
  }
}
