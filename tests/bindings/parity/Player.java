import java.nio.DoubleBuffer;
import java.nio.IntBuffer;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.Comparator;
import java.util.HashMap;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import org.forceserver.*;

/** Plays the scenario through the Java classes; player.cpp has the rest of what there is to say. */
public final class Player implements AutoCloseable {
  private final boolean connected;
  private final Path folder;
  private final List<Vec3> places;
  private final Map<?, ?> scenario;
  private final Scene base = new Scene();
  private final Device device;
  private final Map<String, Scene> others = new LinkedHashMap<>();  // connected: the server's own, and that of another client
  private Scene scene;
  private long since;
  private Servo servo;
  private Server server;
  private final Map<String, Shape> shapes = new HashMap<>();
  private final Map<String, Curve> curves = new HashMap<>();
  private final Map<String, Surface> surfaces = new HashMap<>();
  private StringBuilder line = new StringBuilder();

  Player(Map<?, ?> scenario, boolean connected, Path folder) throws InterruptedException {
    this.scenario = scenario;
    this.connected = connected;
    this.folder = folder;
    places = vectors(scenario.get("places"));
    device = new Device((String) scenario.get("device"));
    if (!connected) {
      scene = base;
      return;
    }
    String endpoint = "shm:parity-" + ProcessHandle.current().pid();
    servo = start();
    server = servo.serve(endpoint);
    scene = Scene.connect(endpoint, "player");
    others.put("server", base);
    others.put("other", Scene.connect(endpoint, "other"));
  }

  private Servo start() {
    return new Servo(base, device, new ServoOptions().mode(ServoMode.VIRTUAL).fade(number(scenario.get("fade")))
        .maxStiffness(-1));
  }

  @Override public void close() {
    scene.close();
    others.values().forEach(Scene::close);
    if (server != null) server.close();
    if (servo != null) servo.close();
    device.close();
    base.close();
  }

  void play(List<?> steps, String prefix) throws Exception {
    for (int i = 0; i < steps.size(); ++i) {
      Map<?, ?> step = (Map<?, ?>) steps.get(i);
      if (step.containsKey("only") && step.get("only").equals("connected") != connected) continue;
      String place = prefix + i, status = "OK";
      line = new StringBuilder();
      Scene own = scene;
      if (step.containsKey("by")) scene = others.get(step.get("by"));
      try {
        if (step.get("do").equals("group")) {
          try (Change change = scene.change()) {
            play((List<?>) step.get("steps"), place + ".");
            if ((Boolean) step.get("commit")) change.commit();
          }
          line = new StringBuilder();
        } else {
          run(step, (String) step.get("do"), (String) step.get("name"));
        }
      } catch (ForceServerException e) {
        status = e.status().toString();
        line = new StringBuilder();
      }
      scene = own;
      System.out.println(place + "\t'" + status + line);
    }
  }

  // ---- What a step gives

  private void give(double... numbers) {
    for (double number : numbers) line.append('\t').append(Double.toHexString(number));
  }

  private void give(boolean truth) {
    give(truth ? 1 : 0);
  }

  private void give(String text) {
    line.append("\t'").append(text);
  }

  private void give(Vec3 v) {
    give(v.x(), v.y(), v.z());
  }

  private void give(Pose pose) {
    give(pose.position());
    give(pose.orientation().w(), pose.orientation().x(), pose.orientation().y(), pose.orientation().z());
  }

  private void give(Twist twist) {
    give(twist.linear());
    give(twist.angular());
  }

  private void give(Wrench wrench) {
    give(wrench.force());
    give(wrench.torque());
  }

  private void give(Profile p) {
    give(p.kind().value(), p.sense().value(), p.gain(), p.offset(), p.width(), p.limit(), p.reach());
  }

  private void give(View view) {
    give(view.frame().pose());
    give(view.frame().scale(), view.frame().forceScale());
    give(view.tool());
    give(view.held());
    give(view.pointRadius());
    for (int i = 0; i < view.pointCount(); ++i) give(view.points(i));
  }

  private void give(Report r) {
    give(r.name());
    give(r.primitive().value(), r.state().value(), r.weight(), r.stiffnessWanted(), r.stiffnessApplied(), r.distance());
    give(r.point());
    give(r.wrench());
  }

  private void give(DeviceInfo d) {
    give(d.name());
    give(d.serial());
    give(d.forceAxes(), d.torqueAxes(), d.workspaceRadius(), d.workspaceHeight(), d.workspaceAngle(), d.forceMax(),
        d.torqueMax(), d.resolution(), d.rate(), d.delay(), d.damping(), d.mass(),
        d.linkRate(), d.controllerRate(), d.controllerDelay(), d.controllerDamping(), d.watchdog());
  }

  private void give(DoubleBuffer numbers) {
    for (int i = 0; i < numbers.capacity(); ++i) give(numbers.get(i));
  }

  // ---- What a step takes

  private static double number(Object o) {
    return (Double) o;
  }

  private static double number(Map<?, ?> map, String key) {
    return map.containsKey(key) ? number(map.get(key)) : 0;
  }

  private static double[] numbers(Object list) {
    return ((List<?>) list).stream().mapToDouble(Player::number).toArray();
  }

  private static Vec3 vector(Object list) {
    double[] v = numbers(list);
    return new Vec3(v[0], v[1], v[2]);
  }

  private static List<Vec3> vectors(Object list) {
    List<Vec3> out = new ArrayList<>();
    for (Object v : (List<?>) list) out.add(vector(v));
    return out;
  }

  private static Vec3[] array(List<Vec3> points) {
    return points.toArray(new Vec3[0]);
  }

  private static <T extends Enum<T>> T value(Class<T> type, Object name) {
    return Enum.valueOf(type, ((String) name).toUpperCase(Locale.ROOT));
  }

  private static Pose pose(Object o) {
    Map<?, ?> p = (Map<?, ?>) o;
    Vec3 position = p.containsKey("position") ? vector(p.get("position")) : new Vec3(0, 0, 0);
    if (p.containsKey("z")) return ForceServer.poseFromZ(position, vector(p.get("z")));
    if (!p.containsKey("orientation")) return new Pose(position, new Quat(1, 0, 0, 0));
    double[] q = numbers(p.get("orientation"));
    return new Pose(position, new Quat(q[0], q[1], q[2], q[3]));
  }

  private static Twist twist(Object o) {
    List<?> t = (List<?>) o;
    return new Twist(vector(t.get(0)), vector(t.get(1)));
  }

  private Profile profile(Object o) {
    Map<?, ?> p = (Map<?, ?>) o;
    Profile out = new Profile().kind(value(ProfileKind.class, p.get("kind"))).gain(number(p, "gain"))
        .offset(number(p, "offset")).width(number(p, "width")).limit(number(p, "limit")).reach(number(p, "reach"));
    if (p.containsKey("sense")) out.sense(value(Sense.class, p.get("sense")));
    if (p.containsKey("curve")) out.curve(curves.get(p.get("curve")));
    return out;
  }

  private ForceObject object(Object given) {
    Map<?, ?> o = (Map<?, ?>) given;
    Primitive primitive = o.containsKey("primitive") ? value(Primitive.class, o.get("primitive")) : Primitive.POINT;
    String name = (String) o.get("name");
    ForceObject out = ForceObject.of(name, primitive);
    if (o.containsKey("wall")) {
      List<?> wall = (List<?>) o.get("wall");
      out = ForceObject.wall(name, vector(wall.get(0)), vector(wall.get(1)), number(wall.get(2)), number(wall.get(3)));
    }
    out.time(number(o, "time")).start(number(o, "start"))
        .lifetime(number(o, "lifetime")).damping(number(o, "damping")).toolPoints((int) number(o, "tool_points"));
    if (o.containsKey("pose")) out.pose(pose(o.get("pose")));
    if (o.containsKey("twist")) out.twist(twist(o.get("twist")));
    if (o.containsKey("front")) out.front(profile(o.get("front")));
    if (o.containsKey("back")) out.back(profile(o.get("back")));
    if (o.containsKey("solid")) out.contact(new Contact().keep(Keep.FRONT).stiffness(number(o, "solid")).limit(10));
    if (o.containsKey("shape")) out.shape(shapes.get(o.get("shape")));
    if (o.containsKey("surface")) out.surface(surfaces.get(o.get("surface")));
    if (o.containsKey("enabled")) out.enabled((Boolean) o.get("enabled"));
    return out;
  }

  // ---- The verbs

  private void settle() throws InterruptedException {
    List<Scene> all = new ArrayList<>(List.of(scene));
    all.addAll(others.values());
    for (Scene each : all) {
      for (int patience = 0; patience < 10000; ++patience) {
        servo.step(10);
        try {
          each.sync(1e-3);
          break;
        } catch (ForceServerException e) {
          if (e.status() != Status.ERROR_TIMEOUT) throw e;
        }
      }
    }
    servo.step(5000);
  }

  private void run(Map<?, ?> step, String verb, String name) throws Exception {
    String client = (String) step.get("client");
    switch (verb) {
      case "time" -> {
        double at = number(step, "at");
        if (connected) servo.step(Math.round((at - scene.time()) * 1000));
        else scene.setTime(at);
        give(scene.time());
      }
      case "shape" -> {
        Shape shape;
        if (step.containsKey("file")) {
          shape = Shape.load(folder.resolve((String) step.get("file")), number(step, "scale"));
        } else if (step.containsKey("triangles")) {
          List<Integer> corners = new ArrayList<>();
          for (Object t : (List<?>) step.get("triangles")) for (double i : numbers(t)) corners.add((int) i);
          int[] triangles = corners.stream().mapToInt(Integer::intValue).toArray();
          shape = Shape.mesh(Buffers.points(array(vectors(step.get("points")))), Buffers.of(triangles));
        } else {
          boolean closed = step.containsKey("closed") && (Boolean) step.get("closed");
          shape = Shape.polyline(closed, array(vectors(step.get("points"))));
        }
        shapes.put(name, shape);
        ShapeInfo info = shape.info();
        give(info.primitive().value());
        give(info.closed());
        give(info.openEdges());
        give(info.lower());
        give(info.upper());
        for (int i = 0; i < 2; ++i) give(String.format("%016x", info.content(i)));
      }
      case "build" -> {
        shapes.get(name).build();
        give(shapes.get(name).info().built());
        give(shapes.get(name).progress());
      }
      case "curve" -> curves.put(name, step.containsKey("table")
          ? Curve.table(number(step, "step"), numbers(step.get("table"))) : Curve.expression((String) step.get("expression")));
      case "surface" -> {
        SurfaceSettings settings = new SurfaceSettings().staticFriction(number(step, "static"))
            .dynamicFriction(number(step, "dynamic")).slipDistance(number(step, "distance"));
        if (step.containsKey("impact")) settings.impact(Impact.values()[(int) number(step, "impact")]);
        if (step.containsKey("heights")) {
          double[] heights = numbers(step.get("heights"));
          int columns = (int) number(step, "columns");
          double width = number(step, "width");
          settings.columns(columns).rows(heights.length / columns).columnWidth(width).rowWidth(width).repeats(true);
          surfaces.put(name, Surface.texture(settings, heights));
        } else if (step.containsKey("expression")) {
          double width = number(step, "width");
          settings.columns((int) number(step, "columns")).rows((int) number(step, "rows")).columnWidth(width).rowWidth(width);
          surfaces.put(name, Surface.expression(settings, (String) step.get("expression")));
        } else {
          surfaces.put(name, Surface.of(settings));
        }
      }
      case "profile" -> {
        DoubleBuffer distances = Buffers.of(numbers(step.get("distances"))), forces = Buffers.doubles(distances.capacity());
        double maxStiffness = step.containsKey("max_stiffness") ? number(step, "max_stiffness") : 0;
        ForceServer.evaluate(profile(step.get("profile")), maxStiffness, number(step, "t"), distances, forces);
        give(forces);
      }
      case "law" -> {
        DoubleBuffer distances = Buffers.of(numbers(step.get("distances"))), forces = Buffers.doubles(distances.capacity());
        ForceServer.evaluateLaw(object(step.get("object")), number(step, "max_stiffness"), number(step, "t"), distances, forces);
        give(forces);
      }
      case "set" -> scene.set(object(step.get("object")));
      case "change" -> scene.change(object(step.get("object")),
          ((List<?>) step.get("parts")).stream().map(part -> value(Part.class, part)).toArray(Part[]::new));
      case "move" -> {
        if (step.containsKey("twist")) scene.move(name, pose(step.get("pose")), twist(step.get("twist")), number(step, "time"));
        else scene.stream(name, pose(step.get("pose")), number(step, "time"));
      }
      case "remove" -> scene.remove(name);
      case "evaluate" -> {
        List<Vec3> positions = step.containsKey("positions") ? vectors(step.get("positions")) : places;
        DoubleBuffer forces = Buffers.doubles(3 * positions.size());
        scene.evaluate(name, number(step, "time"), Buffers.points(array(positions)), forces);
        give(forces);
      }
      case "tool" -> {
        Vec3[] points = step.containsKey("points") ? array(vectors(step.get("points"))) : new Vec3[0];
        try (Tool tool = new Tool(scene, points)) {
          State state = new State().twist(twist(step.get("twist"))).time(number(step, "time"));
          for (Vec3 place : places) {
            Response response = tool.evaluate(state.pose(new Pose(place, pose(step.get("pose")).orientation())));
            give(response.wrench());
            give(response.feltCount(), response.stiffness().xx(), response.stiffness().xy(), response.stiffness().zz());
          }
          tool.reset();
        }
      }
      case "get" -> {
        ForceObject o = scene.get(name);
        give(o.name());
        give(o.primitive().value());
        give(o.pose());
        give(o.twist());
        give(o.lifetime());
        give(o.front());
        give(o.back());
        give(o.damping(), o.toolPoints());
        give(o.enabled());
        if (o.shape() != null) {
          give(o.shape().points());
          IntBuffer triangles = o.shape().triangles();
          for (int i = 0; i < triangles.capacity(); ++i) give(triangles.get(i));
        }
        Curve curve = o.front().curve();
        if (curve != null) {
          if (curve.expression() != null) give(curve.expression());
          give(curve.table());
          give(curve.step());
        }
        if (o.surface() != null) {
          SurfaceSettings settings = o.surface().settings();
          give(settings.staticFriction(), settings.dynamicFriction(), settings.slipDistance());
          give(o.surface().heights());
          give(settings.columnWidth(), settings.impactGain(), settings.impactFrequency(), settings.impactDecay());
        }
      }
      case "motions" -> {
        for (Motion m : scene.motions(client)) {
          give(m.name());
          give(m.primitive().value());
          give(m.pose());
          give(m.twist());
          give(m.horizon());
          give(ForceServer.at(m, m.time() + 0.03));
        }
      }
      case "motions_since" -> {
        for (Motion m : scene.motionsSince(client, since)) {
          give(m.name());
          give(m.pose());
          since = m.motionRevision();
        }
      }
      case "reports" -> scene.reports().stream().sorted(Comparator.comparing(Report::name)).forEach(this::give);
      case "report" -> give(scene.report(name));
      case "clear" -> scene.clear();
      case "accuracy" -> scene.setAccuracy(number(step, "newtons"));
      case "max_stiffness" -> scene.setMaxStiffness(number(step, "stiffness"));
      case "events" -> {
        List<Event> events = new ArrayList<>();
        for (Event e = scene.nextEvent(0); e.kind() != EventKind.NONE; e = scene.nextEvent(0)) events.add(e);
        if (step.containsKey("drain")) events.clear();
        events.sort(Comparator.comparing((Event e) -> e.kind()).thenComparing(e -> e.name()));
        for (Event e : events) {
          boolean isOwn = e.value() == ProcessHandle.current().pid();
          give(e.kind().value(), e.status().value(), e.kind() == EventKind.CLIENT ? (isOwn ? 1.0 : 0.0) : e.value());
          give(e.name());
          give(e.text());
        }
      }
      case "clients" -> {
        for (Client c : scene.clients()) {
          give(c.name());
          give(c.process() == ProcessHandle.current().pid());
          give(c.objects(), c.forceLimit());
          give(c.wrench());
          give(c.refused(), c.limited(), c.shapeBytes());
        }
      }
      case "frame" -> scene.setFrame(new Frame(pose(step.get("pose")), number(step, "scale"), number(step, "force_scale")));
      case "get_frame" -> {
        Frame frame = scene.frame(client);
        give(frame.pose());
        give(frame.scale(), frame.forceScale());
        Pose there = ForceServer.toDevice(frame, frame.pose());
        give(there);
        give(ForceServer.toScene(frame, there));
      }
      case "get_points" -> scene.tool().forEach(this::give);
      case "points" -> scene.setTool(array(vectors(step.get("points"))));
      case "radius" -> {
        scene.setToolRadius(number(step, "radius"));
        give(scene.toolRadius());
      }
      case "clutch" -> scene.setClutch((Boolean) step.get("held"));
      case "view" -> {
        give(scene.view(client));
      }
      case "views" -> {
        for (ClientView each : scene.views()) {
          give(each.name());
          give(each.view());
        }
      }
      case "servo" -> {
        if (!connected) servo = start();
      }
      case "settle" -> settle();
      case "enable" -> servo.setEnabled((Boolean) step.get("enabled"));
      case "record" -> {
        List<Tick> ticks = servo.record();
        give(ticks.size());
        for (Tick tick : ticks.subList(ticks.size() - 3, ticks.size())) {
          give(tick.state().pose());
          give(tick.response().wrench());
          give(tick.sent());
          give(tick.device().value(), tick.faults());
        }
      }
      case "scene_record" -> {
        List<RecordedTick> ticks = scene.record(0);
        give(ticks.size());
        List<RecordedTick> newest = scene.record(ticks.get(ticks.size() - 1).number() - 3);
        give(newest.size());
        for (RecordedTick each : newest) {
          Tick tick = each.tick();
          give(tick.state().pose());
          give(tick.response().wrench());
          give(tick.sent());
          give(each.number() - newest.get(0).number());
        }
      }
      case "stats" -> {
        ServoStats t = scene.servoStats();
        give(t.realtime().value(), t.faults(), t.protectionsOff(), t.maxStiffness(), t.damping(), t.misses(),
            t.deviceErrors(), t.approximated(), t.enabled());
        give(t.ticks() > 5000);
        give(t.energy() > 0);
      }
      case "stop_force" -> scene.stopForce();
      case "resume_force" -> scene.resumeForce();
      case "device" -> give(step.containsKey("opened") ? device.info() : scene.deviceInfo());
      case "devices" -> {
        for (DeviceEntry each : ForceServer.devices()) if (each.uri().equals("sim:")) give(each.label());
      }
      case "device_read" -> {
        State state = device.read();
        give(state.pose());
        give(state.flags());
      }
      case "device_write" -> device.write(new Wrench(vector(step.get("force")), new Vec3(0, 0, 0)));
      case "device_control" -> give(device.control((String) step.get("request")));
      case "drivers" -> {
        for (DriverInfo each : ForceServer.drivers()) {
          if (each.scheme().equals("sim")) {
            give(each.path());
            give(each.trouble());
          }
        }
      }
      case "state_reason" -> give(ForceServer.stateReason(((Number) step.get("flags")).intValue()));
      case "driver" -> ForceServer.loadDriver(Path.of((String) step.get("file")));
      case "hand" -> {
        Hand hand = scene.hand();
        give(hand.state().pose());
        give(hand.response().wrench());
        give(hand.sent());
      }
      case "save" -> scene.save(folder.resolve((String) step.get("file")));
      case "load" -> scene.load(folder.resolve((String) step.get("file")));
      default -> throw new IllegalArgumentException("there is no verb " + verb);
    }
  }

  // ---- JSON, as much of it as the scenario needs: objects become maps, lists lists, all numbers doubles

  private static final class Json {
    private final String text;
    private int at;

    Json(String text) {
      this.text = text;
    }

    private char next() {
      while (Character.isWhitespace(text.charAt(at))) ++at;
      return text.charAt(at);
    }

    private boolean ends(char end) {  // whether no other entry follows
      if (next() == ',') ++at;
      return next() == end;
    }

    Object value() {
      char first = next();
      if (first == '{') {
        Map<String, Object> map = new HashMap<>();
        for (++at; !ends('}');) {
          String key = (String) value();
          next();
          ++at;  // the colon
          map.put(key, value());
        }
        ++at;
        return map;
      }
      if (first == '[') {
        List<Object> list = new ArrayList<>();
        for (++at; !ends(']');) list.add(value());
        ++at;
        return list;
      }
      if (first == '"') {
        int begin = ++at;
        at = text.indexOf('"', begin) + 1;  // the scenario has no escapes
        return text.substring(begin, at - 1);
      }
      int begin = at;
      while (",]} \n".indexOf(text.charAt(at)) < 0) ++at;
      String word = text.substring(begin, at);
      return word.equals("true") || word.equals("false") ? (Object) Boolean.valueOf(word) : Double.valueOf(word);
    }
  }

  public static void main(String[] arguments) throws Exception {
    Map<?, ?> scenario = (Map<?, ?>) new Json(Files.readString(Path.of(arguments[0]))).value();
    try (Player player = new Player(scenario, arguments[1].equals("connected"), Path.of(arguments[2]))) {
      player.play((List<?>) scenario.get("steps"), "");
    }
  }
}
