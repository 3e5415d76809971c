#include "scenes/scenes.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <numbers>

namespace scenes {

constexpr double pi = std::numbers::pi;

// Handles.

void stop_with_last_error(const char* what) {
  std::fprintf(stderr, "%s: %s\n", what, fs_last_error());
  std::abort();
}

Scene make_scene() {
  fs_scene* scene = nullptr;
  require(fs_scene_create(&scene), "fs_scene_create");
  return Scene(scene);
}

Tool make_tool(fs_scene* scene) {
  fs_tool* tool = nullptr;
  const fs_vec3 origin{};
  require(fs_tool_create(scene, &origin, 1, &tool), "fs_tool_create");
  return Tool(tool);
}

Device open_device(const char* uri) {
  fs_device* device = nullptr;
  require(fs_device_open(uri, &device), "fs_device_open");
  return Device(device);
}

Servo start_servo(fs_scene* scene, fs_device* device, const fs_servo_options& options) {
  fs_servo* servo = nullptr;
  require(fs_servo_start(scene, device, &options, &servo), "fs_servo_start");
  return Servo(servo);
}

Shape make_polyline(const fs_vec3* points, size_t count, bool closed) {
  fs_shape* shape = nullptr;
  require(fs_shape_create_polyline(points, count, closed, &shape), "fs_shape_create_polyline");
  return Shape(shape);
}

Shape make_mesh(const MeshData& mesh) {
  fs_shape* shape = nullptr;
  require(fs_shape_create_mesh(mesh.points.data(), mesh.points.size(), mesh.triangles.data(),
                               mesh.triangles.size() / 3, &shape), "fs_shape_create_mesh");
  return Shape(shape);
}

Curve make_table(const double* forces, size_t count, double step) {
  fs_curve* curve = nullptr;
  require(fs_curve_create_table(forces, count, step, &curve), "fs_curve_create_table");
  return Curve(curve);
}

fs_surface_settings sticky(double static_friction, double dynamic_friction, double slip_distance) {
  fs_surface_settings out = fs_surface_settings_init();
  out.static_friction = static_friction;
  out.dynamic_friction = dynamic_friction;
  out.slip_distance = slip_distance;
  return out;
}

Surface make_surface(const fs_surface_settings& settings) {
  fs_surface* surface = nullptr;
  require(fs_surface_create(&settings, &surface), "fs_surface_create");
  return Surface(surface);
}

Surface make_texture(const fs_surface_settings& settings, const std::vector<double>& heights) {
  fs_surface* surface = nullptr;
  require(fs_surface_create_texture(&settings, heights.data(), heights.size(), &surface), "fs_surface_create_texture");
  return Surface(surface);
}

Curve make_expression(const char* text) {
  fs_curve* curve = nullptr;
  require(fs_curve_create_expression(text, &curve), "fs_curve_create_expression");
  return Curve(curve);
}

bool has_expressions() {
  static const bool answer = [] {
    fs_curve* curve = nullptr;
    const bool made = fs_curve_create_expression("d", &curve) == FS_OK;
    fs_curve_destroy(curve);
    return made;
  }();
  return answer;
}

Function monotone_cubic(std::vector<double> y, double step) {
  const size_t n = y.size();
  for (double& f : y) f = f > 0 && std::isfinite(f) ? f : 0;  // below 0 or not finite counts as 0
  std::vector<long double> secant(n - 1), slope(n, 0);
  for (size_t i = 0; i + 1 < n; ++i) secant[i] = (static_cast<long double>(y[i + 1]) - y[i]) / step;
  auto end = [](long double near, long double far) -> long double {
    const long double s = (3 * near - far) / 2;
    if (s * near <= 0) return 0;
    return near * far <= 0 && std::fabs(s) > std::fabs(3 * near) ? 3 * near : s;
  };
  for (size_t i = 1; i + 1 < n; ++i) {
    const long double a = secant[i - 1], b = secant[i];
    slope[i] = a * b > 0 ? 2 * a * b / (a + b) : 0;
  }
  slope[0] = n == 2 ? secant[0] : end(secant[0], secant[1]);
  slope[n - 1] = n == 2 ? secant[0] : end(secant[n - 2], secant[n - 3]);
  return [y = std::move(y), slope = std::move(slope), step](long double d, long double) -> long double {
    const size_t n = y.size();
    if (d >= (n - 1) * static_cast<long double>(step)) return y[n - 1];
    const size_t i = std::min(n - 2, static_cast<size_t>(d / step));
    const long double u = d / step - i, v = 1 - u;
    return y[i] * v * v * (1 + 2 * u) + y[i + 1] * u * u * (3 - 2 * u) +
           step * u * v * (slope[i] * v - slope[i + 1] * u);
  };
}

// Content.

fs_object& Content::add(const std::string& name, fs_primitive primitive, fs_vec3 position) {
  objects.push_back(fs_object_init(name.c_str(), primitive));
  objects.back().pose = at(position);
  return objects.back();
}

fs_object& Content::add_shape(const std::string& name, Shape shape, fs_vec3 position) {
  fs_shape_info info = fs_shape_info_init();
  require(fs_shape_get_info(shape.get(), &info), "fs_shape_get_info");
  fs_object& object = add(name, info.primitive, position);
  object.shape = shape.get();
  shapes.push_back(std::move(shape));
  return object;
}

fs_curve* Content::keep(Curve curve, Function function) {
  fs_curve* raw = curve.get();
  functions[raw] = std::move(function);
  curves.push_back(std::move(curve));
  return raw;
}

void fill(fs_scene* scene, const Content& content) {
  require(fs_scene_begin(scene), "fs_scene_begin");
  for (const fs_object& object : content.objects) require(fs_object_set(scene, &object), object.name);
  require(fs_scene_commit(scene), "fs_scene_commit");
}

// Meshes.

static void add_grid(MeshData& mesh, uint32_t first, size_t rows, size_t columns, bool wraps_rows, bool wraps_columns) {
  const size_t row_cells = wraps_rows ? rows : rows - 1, column_cells = wraps_columns ? columns : columns - 1;
  for (size_t i = 0; i < row_cells; ++i) {
    for (size_t j = 0; j < column_cells; ++j) {
      auto index = [&](size_t r, size_t c) { return static_cast<uint32_t>(first + r % rows * columns + c % columns); };
      const uint32_t a = index(i, j), b = index(i, j + 1), c = index(i + 1, j + 1), d = index(i + 1, j);
      mesh.triangles.insert(mesh.triangles.end(), {a, b, c, a, c, d});
    }
  }
}

MeshData sphere_mesh(double radius, size_t triangles) {
  const size_t rings = std::max<size_t>(3, std::lround((1 + std::sqrt(1.0 + triangles)) / 2)), sectors = 2 * rings;
  MeshData mesh;
  for (size_t i = 1; i < rings; ++i) {  // from the south upwards
    const double latitude = pi * i / rings - pi / 2;
    for (size_t j = 0; j < sectors; ++j) {
      const double longitude = 2 * pi * j / sectors;
      mesh.points.push_back(radius * fs_vec3{std::cos(latitude) * std::cos(longitude),
                                             std::cos(latitude) * std::sin(longitude), std::sin(latitude)});
    }
  }
  add_grid(mesh, 0, rings - 1, sectors, false, true);
  const uint32_t south = static_cast<uint32_t>(mesh.points.size()), north = south + 1;
  const uint32_t last_ring = static_cast<uint32_t>((rings - 2) * sectors), n = static_cast<uint32_t>(sectors);
  mesh.points.push_back({0, 0, -radius});
  mesh.points.push_back({0, 0, radius});
  for (uint32_t j = 0; j < n; ++j) {
    mesh.triangles.insert(mesh.triangles.end(), {south, (j + 1) % n, j});
    mesh.triangles.insert(mesh.triangles.end(), {north, last_ring + j, last_ring + (j + 1) % n});
  }
  return mesh;
}

MeshData torus_mesh(double radius, double tube_radius, size_t triangles) {
  const size_t tube = std::max<size_t>(3, std::lround(std::sqrt(static_cast<double>(triangles)) / 2));
  const size_t around = 2 * tube;
  MeshData mesh;
  for (size_t i = 0; i < tube; ++i) {
    const double a = 2 * pi * i / tube, r = radius + tube_radius * std::cos(a);
    for (size_t j = 0; j < around; ++j) {
      const double b = 2 * pi * j / around;
      mesh.points.push_back({r * std::cos(b), r * std::sin(b), tube_radius * std::sin(a)});
    }
  }
  add_grid(mesh, 0, tube, around, true, true);
  return mesh;
}

MeshData terrain_mesh(double half_width, double height, size_t triangles) {
  const size_t cells = std::max<size_t>(1, std::lround(std::sqrt(triangles / 2.0))), n = cells + 1;
  MeshData mesh;
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j < n; ++j) {
      const double x = 2.0 * j / cells - 1, y = 2.0 * i / cells - 1;
      const double z = 0.5 * std::sin(3.1 * x + 0.3) * std::cos(2.3 * y) + 0.3 * std::sin(7.3 * x - 5.1 * y) +
                       0.2 * std::cos(13.7 * y + 4.1 * x * x);
      mesh.points.push_back({half_width * x, half_width * y, height * z});
    }
  }
  add_grid(mesh, 0, n, n, false, false);
  return mesh;
}

MeshData box_mesh(fs_vec3 h) {
  MeshData mesh;
  for (int i = 0; i < 8; ++i) mesh.points.push_back({i & 1 ? h.x : -h.x, i & 2 ? h.y : -h.y, i & 4 ? h.z : -h.z});
  mesh.triangles = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                    2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
  return mesh;
}

MeshData soup_mesh(Random& random, double half, size_t triangles) {
  MeshData mesh;
  for (size_t i = 0; i < triangles; ++i) {
    const fs_vec3 centre = random.in_box(half);
    for (uint32_t corner = 0; corner < 3; ++corner) {
      mesh.triangles.push_back(static_cast<uint32_t>(mesh.points.size()));
      mesh.points.push_back(centre + random.in_box(0.3 * half));
    }
  }
  return mesh;
}

MeshData moved(MeshData mesh, const fs_pose& pose) {
  for (fs_vec3& p : mesh.points) p = pose * p;
  return mesh;
}

MeshData split_corners(const MeshData& mesh) {
  MeshData out;
  for (const uint32_t i : mesh.triangles) {
    out.triangles.push_back(static_cast<uint32_t>(out.points.size()));
    out.points.push_back(mesh.points[i]);
  }
  return out;
}

std::vector<fs_vec3> helix(double radius, double height, double turns, size_t points) {
  std::vector<fs_vec3> line;
  for (size_t i = 0; i < points; ++i) {
    const double u = static_cast<double>(i) / (points - 1), a = 2 * pi * turns * u;
    line.push_back({radius * std::cos(a), radius * std::sin(a), height * (u - 0.5)});
  }
  return line;
}

// Profiles.

fs_profile attract(double stiffness, double limit) {
  return fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, stiffness, 0, limit);
}

fs_profile constant(fs_sense sense, double force) {
  return fs_profile_init(FS_PROFILE_CONSTANT, sense, force, 0, force);
}

static fs_profile custom(fs_sense sense, double gain, fs_curve* curve, double limit) {
  fs_profile p = fs_profile_init(FS_PROFILE_CUSTOM, sense, gain, 0, limit);
  p.curve = curve;
  return p;
}

std::vector<fs_profile> all_profiles(Content& content, fs_sense sense, double limit) {
  const std::vector<double> table{0.5, 2, 2.5, 1, 1.5, 0};
  fs_curve* curve = content.keep(make_table(table.data(), table.size(), 0.002), monotone_cubic(table, 0.002));
  std::vector<fs_profile> all{
      fs_profile_init(FS_PROFILE_CONSTANT, sense, 1, 0, limit),
      fs_profile_init(FS_PROFILE_LINEAR_INCREASING, sense, 300, 0.2, limit),
      fs_profile_init(FS_PROFILE_LINEAR_DECREASING, sense, -250, 2.5, limit),
      fs_profile_init(FS_PROFILE_GAUSSIAN, sense, 3, 0.004, limit),
      fs_profile_init(FS_PROFILE_QUADRATIC, sense, 2e4, 0.1, limit),
      fs_profile_init(FS_PROFILE_INVERSE, sense, 0.005, -0.3, limit),
      custom(sense, 1.5, curve, limit)};
  for (fs_profile& p : all) p.reach = 0.01;
  return all;
}

// Scenes.

Content hello() {
  Content content;
  content.add("spring", FS_PRIMITIVE_POINT).front = attract(200, 3);
  return content;
}

Content profiles() {
  Content content;
  const Shape line = [] {
    const std::vector<fs_vec3> points = helix(0.004, 0.01, 1.5, 20);
    return make_polyline(points.data(), points.size(), false);
  }();
  const Shape mesh = make_mesh(sphere_mesh(0.004, 80));
  const std::vector<fs_profile> kinds = all_profiles(content, FS_SENSE_ATTRACTIVE, 3);
  for (size_t i = 0; i < kinds.size(); ++i) {
    for (int primitive = FS_PRIMITIVE_POINT; primitive <= FS_PRIMITIVE_MESH; ++primitive) {
      const fs_vec3 position{0.025 * (i - 3.0), 0.025 * (primitive - 1.5), 0};
      fs_object& o = content.add("k" + std::to_string(i) + "p" + std::to_string(primitive),
                                 static_cast<fs_primitive>(primitive), position);
      o.front = kinds[i];
      if (primitive >= FS_PRIMITIVE_PLANE) o.back = kinds[(i + 1) % kinds.size()];
      if (primitive == FS_PRIMITIVE_POLYLINE) o.shape = line.get();
      if (primitive == FS_PRIMITIVE_MESH) o.shape = mesh.get();
      if (primitive == FS_PRIMITIVE_PLANE) o.pose.orientation = turn({1, 1, 0}, 0.3 * i);
    }
  }
  content.shapes.emplace_back(fs_shape_retain(line.get()));
  content.shapes.emplace_back(fs_shape_retain(mesh.get()));
  return content;
}

Content path() {
  Content content;
  const std::vector<fs_vec3> line = helix(0.04, 0.06, 1.5, 200);
  content.add_shape("path", make_polyline(line.data(), line.size(), false)).front =
      fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 300, 0, 4);
  return content;
}

static Content solid(const char* name, const MeshData& mesh) {
  Content content;
  fs_object& o = content.add_shape(name, make_mesh(mesh));
  o.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_ATTRACTIVE, 0.5, 0.005, 1);
  o.back = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 800, 0, 5);
  return content;
}

Content ball(size_t triangles) { return solid("ball", sphere_mesh(0.04, triangles)); }
Content ring(size_t triangles) { return solid("ring", torus_mesh(0.05, 0.02, triangles)); }
Content ground(size_t triangles) { return solid("ground", terrain_mesh(0.1, 0.02, triangles)); }

Content moving(double time) {
  Content content;
  const std::vector<fs_vec3> line = helix(0.02, 0.04, 1, 50);
  content.add("point", FS_PRIMITIVE_POINT, {0.03, 0, 0}).front = attract(200, 3);
  content.add("plane", FS_PRIMITIVE_PLANE, {0, 0, -0.03}).back = attract(500, 4);
  content.add_shape("line", make_polyline(line.data(), line.size(), false), {0, 0.04, 0}).front =
      fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_ATTRACTIVE, 2, 0.008, 2);
  content.add_shape("mesh", make_mesh(torus_mesh(0.03, 0.01, 300)), {-0.04, -0.02, 0.01}).front =
      fs_profile_init(FS_PROFILE_INVERSE, FS_SENSE_REPULSIVE, 0.01, 0, 3);
  double k = 0;
  for (fs_object& o : content.objects) {
    o.time = time;
    o.twist = {{0.05 - 0.02 * k, 0.03 * k, -0.04}, {0.5 * k, -1, 2 - k}};
    o.damping = k;
    ++k;
  }
  return content;
}

Content crowd(size_t count) {
  Content content;
  Random random(count);
  const double half = 0.005 * std::cbrt(static_cast<double>(count));  // one in a cube of 10 mm
  for (size_t i = 0; i < count; ++i) {
    fs_object& o = content.add("p" + std::to_string(i), FS_PRIMITIVE_POINT, random.in_box(half));
    o.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 200, 0, 1);
    o.front.reach = 0.005;
  }
  return content;
}

Content testbed() {
  Content content;
  fs_object& ground = content.add_shape("ground", make_mesh(terrain_mesh(0.09, 0.02, 1800)), {0, 0, -0.04});
  ground.back = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 600, 0, 6);
  const std::vector<fs_vec3> line{{-0.07, -0.05, 0}, {-0.03, -0.02, 0.01}, {0, 0.02, 0}, {0.05, 0.03, 0.01}};
  content.add_shape("path", make_polyline(line.data(), line.size(), false)).front =
      fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_ATTRACTIVE, 1.5, 0.01, 2);
  const fs_vec3 stones[]{{-0.05, 0.01, -0.02}, {0.01, -0.03, -0.02}, {0.03, 0.055, -0.02}};
  int number = 0;
  for (const fs_vec3& stone : stones) {
    fs_profile& p = content.add("stone" + std::to_string(++number), FS_PRIMITIVE_POINT, stone).front;
    p = fs_profile_init(FS_PROFILE_INVERSE, FS_SENSE_REPULSIVE, 0.01, 0, 3);
    p.reach = 0.03;
  }
  content.add("goal", FS_PRIMITIVE_POINT, line.back()).front =
      fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_ATTRACTIVE, -40, 1.2, 2);
  content.add_shape("reach", make_mesh(sphere_mesh(0.1, 800))).front =
      fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 500, 0, 5);
  const std::vector<double> ticks{0, 1, 0, 1, 0};
  fs_object& wall = content.add("wall", FS_PRIMITIVE_PLANE, {0.08, 0, 0});
  wall.pose.orientation = turn({0, 1, 0}, -pi / 2);
  wall.front = custom(FS_SENSE_REPULSIVE, 0.5, content.keep(make_table(ticks.data(), ticks.size(), 0.003),
                                                            monotone_cubic(ticks, 0.003)), 1);
  wall.back = attract(700, 5);
  wall.damping = 1;
  return content;
}

const std::vector<Named>& all_scenes() {
  static const std::vector<Named> all{
      {"hello", hello},
      {"profiles", profiles},
      {"path", path},
      {"ball", [] { return ball(1000); }},
      {"ring", [] { return ring(1000); }},
      {"ground", [] { return ground(1000); }},
      {"moving", [] { return moving(0); }},
      {"crowd", [] { return crowd(1000); }},
      {"testbed", testbed},
      {"random", [] { Random random(1); return random_content(random, {}); }},
  };
  return all;
}

// Random ones.

fs_profile random_profile(Random& random, Content& content) {
  const fs_profile_kind kind = static_cast<fs_profile_kind>(FS_PROFILE_CONSTANT + random.below(7));
  const fs_sense sense = random.coin() ? FS_SENSE_ATTRACTIVE : FS_SENSE_REPULSIVE;
  const double limit = random.log_between(0.3, 10), offset = random.coin() ? 0 : random.between(-1, 3);
  fs_profile p{};
  switch (kind) {
    case FS_PROFILE_LINEAR_INCREASING:
      p = fs_profile_init(kind, sense, random.log_between(10, 2000), offset, limit);
      break;
    case FS_PROFILE_LINEAR_DECREASING:
      p = fs_profile_init(kind, sense, -random.log_between(10, 2000), offset, limit);
      break;
    case FS_PROFILE_GAUSSIAN: {
      const double gain = random.log_between(0.3, 10), width = random.log_between(0.003, 0.1);
      p = fs_profile_init(kind, sense, gain, width, limit);
      p.reach = 20 * width;  // cuts off the tail before a double rounds the force to 0
      break;
    }
    case FS_PROFILE_QUADRATIC: p = fs_profile_init(kind, sense, random.between(-3e3, 3e3), offset, limit); break;
    case FS_PROFILE_INVERSE: p = fs_profile_init(kind, sense, random.log_between(0.001, 0.1), offset, limit); break;
    case FS_PROFILE_CUSTOM: {
      std::vector<double> table(2 + random.below(9));
      for (double& f : table) f = random.coin(0.2) ? 0 : random.between(-0.5, 4);
      const double step = random.log_between(0.002, 0.02);
      fs_curve* curve = content.keep(make_table(table.data(), table.size(), step), monotone_cubic(table, step));
      p = custom(sense, random.between(0.2, 2), curve, limit);
      break;
    }
    default: p = fs_profile_init(FS_PROFILE_CONSTANT, sense, random.log_between(0.1, 10), 0, limit);
  }
  if (random.coin(0.05)) p.gain = 0;
  if (random.coin()) p.reach = std::fmin(p.reach > 0 ? p.reach : 1, random.log_between(0.01, 0.2));
  return p;
}

static MeshData random_mesh(Random& random, double half, size_t triangles) {
  switch (random.below(4)) {
    case 0: return sphere_mesh(half, triangles);
    case 1: return torus_mesh(half, 0.4 * half, triangles);
    case 2: return terrain_mesh(half, half, triangles);
    default: return box_mesh({half, 0.5 * half, 0.7 * half});
  }
}

Content random_content(Random& random, const RandomOptions& options) {
  Content content;
  for (size_t i = 0; i < options.count; ++i) {
    fs_object object = fs_object_init(("o" + std::to_string(i)).c_str(),
                                      static_cast<fs_primitive>(random.below(options.mesh_triangles ? 4 : 3)));
    object.pose = random.pose(options.half);
    object.time = options.time - random.between(0, 0.15);
    object.start = options.time - random.between(0, 5);
    object.front = random_profile(random, content);
    if (object.primitive >= FS_PRIMITIVE_PLANE) {
      if (random.coin(0.7)) object.back = random_profile(random, content);
      if (random.coin(0.1)) object.front = fs_profile{};
    }
    if (options.moves && random.coin()) {
      object.twist = {random.in_box(0.3), random.in_box(3)};
    }
    if (options.damps && random.coin()) object.damping = random.log_between(0.1, 20);
    if (options.masks && random.coin()) object.tool_points = static_cast<uint32_t>(random.below(8));
    if (options.disables && random.coin(0.2)) object.enabled = false;
    if (object.primitive == FS_PRIMITIVE_POLYLINE) {
      std::vector<fs_vec3> line(2 + random.below(12));
      for (fs_vec3& p : line) p = random.in_box(0.6 * options.half);
      content.shapes.push_back(make_polyline(line.data(), line.size(), random.coin()));
      object.shape = content.shapes.back().get();
    } else if (object.primitive == FS_PRIMITIVE_MESH && random.coin(0.15)) {
      content.shapes.push_back(make_mesh(soup_mesh(random, 0.6 * options.half, 12)));
      object.shape = content.shapes.back().get();
      object.back = object.front;  // a soup has no inside and outside
    } else if (object.primitive == FS_PRIMITIVE_MESH) {
      content.shapes.push_back(make_mesh(random_mesh(random, 0.6 * options.half, options.mesh_triangles)));
      object.shape = content.shapes.back().get();
    }
    content.objects.push_back(object);
  }
  return content;
}

}  // namespace scenes
