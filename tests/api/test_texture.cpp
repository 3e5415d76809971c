// Textures: heights that are carved into the surface of a solid. What is felt there, and what the loop bears of it.
#include <cmath>
#include <fstream>
#include <functional>
#include <numbers>

#include "scenes/folder.h"
#include "api/hand.h"

using namespace scenes;

namespace {

using Heights = std::function<double(double, double)>;  // m, of a place on the surface

// A grid of 16 by 16 heights, 1/16 mm apart, that repeats.
struct Grid {
  fs_surface_settings settings = fs_surface_settings_init();
  std::vector<double> heights;

  explicit Grid(const Heights& of, uint32_t columns = 16, uint32_t rows = 16, double width = 1e-3 / 16) {
    settings.columns = columns;
    settings.rows = rows;
    settings.column_width = settings.row_width = width;
    settings.repeats = true;
    for (uint32_t row = 0; row < rows; ++row) {
      for (uint32_t column = 0; column < columns; ++column) heights.push_back(of(column * width, row * width));
    }
  }
  Surface make() const {
    return make_texture(settings, heights);
  }
};

constexpr double wave = 2 * std::numbers::pi / 1e-3;  // rad/m, of 1 mm
double ridges(double x, double) { return 5e-5 * (std::cos(wave * x) - 1); }  // +-0.05 mm
double bumps(double x, double y) { return 2.5e-5 * (std::cos(wave * x) + std::cos(wave * y) - 2); }

Grid noise(Random& random, uint32_t columns = 12, uint32_t rows = 9) {
  Grid out([&](double, double) { return -random.between(0, 1e-4); }, columns, rows, 3e-4);
  out.settings.repeats = random.coin();
  out.settings.axis = static_cast<fs_axis>(random.below(3));
  out.settings.first_column = random.between(-1e-3, 1e-3);
  out.settings.first_row = random.between(-1e-3, 1e-3);
  return out;
}

// A table along x and y with this texture, and a hand above it.
struct Table : Hand {
  Surface surface;
  fs_object object = fs_object_init("table", FS_PRIMITIVE_PLANE);

  explicit Table(const Grid& grid, double limit = 1000, double stiffness = 1000) : surface(grid.make()) {
    object.surface = surface.get();
    put(object, solid(FS_KEEP_FRONT, stiffness, limit));
    go({0, 0, 0.01});
    slide({0, 0, -0.001});
  }
};

// ------------------------------------------------------------------------------------------------------------ the force

START_TEST(the_force_is_the_gradient_of_one_energy) {
  Random random(5);
  for (int round = 0; round < times(40, 400); ++round) {
    Table table(noise(random));
    const auto at = [&](fs_vec3 x) { return table.slide(x); };
    // Forces at places near one another: the curl is 0, and it is 1000 N/m along the normal.
    const fs_vec3 x = {random.between(-4e-3, 4e-3), random.between(-4e-3, 4e-3), -random.between(2e-4, 2e-3)};
    constexpr double h = 1e-7;
    fs_mat3 change{};
    double* const entries = &change.xx;
    const fs_vec3 ways[] = {{h, 0, 0}, {0, h, 0}, {0, 0, h}};
    for (int i = 0; i < 3; ++i) {
      const fs_vec3 d = (0.5 / h) * (at(x + ways[i]) - at(x - ways[i]));
      entries[i] = d.x, entries[3 + i] = d.y, entries[6 + i] = d.z;
    }
    const double size = 1000 * 3;
    EXPECT_NEAR(change.xy, change.yx, 1e-3 * size);
    EXPECT_NEAR(change.xz, change.zx, 1e-3 * size);
    EXPECT_NEAR(change.yz, change.zy, 1e-3 * size);
    EXPECT_NEAR(change.zz, -1000, 1e-3 * size);
    // The response says the same.
    at(x);
    const double* const told = &table.felt.stiffness.xx;
    for (int i = 0; i < 9; ++i) EXPECT_NEAR(told[i], entries[i], 2e-3 * size);
  }
}
END_TEST

// stiffness * (depth + h) * (n - grad h), with the heights at their places, and between them close to the function they are of.
START_TEST(it_is_that_of_the_heights) {
  Table table{Grid(ridges)};
  for (int i = 0; i < 64; ++i) {
    const double x = i * 1e-3 / 64 - 3.7e-3, depth = 1e-3;
    const fs_vec3 force = table.slide({x, 0.4e-3, -depth});
    const double s = depth + ridges(x, 0), slope = -5e-5 * wave * std::sin(wave * x);
    EXPECT_NEAR(force.z, 1000 * s, 2e-4);
    EXPECT_NEAR(force.x, -1000 * s * slope, 2e-3);
    EXPECT_NEAR(force.y, 0, 1e-9);
  }
  // Nothing is felt in front of the texture.
  EXPECT_VECTOR(table.slide({0.5e-3, 0, -0.9e-4}), (fs_vec3{0, 0, 0}), 1e-12);
  ck_assert_double_gt(table.slide({0, 0, -0.9e-4}).z, 0.05);
}
END_TEST

START_TEST(axes_and_borders) {
  // A single ridge at the second column of five.
  for (const fs_axis axis : {FS_AXIS_Z, FS_AXIS_X, FS_AXIS_Y}) {
    Grid grid([](double x, double) { return std::fabs(x - 1e-3) < 1e-6 ? 0 : -1e-4; }, 5, 1, 1e-3);
    grid.settings.axis = axis;
    grid.settings.repeats = false;
    grid.settings.first_column = 2e-3;
    Hand hand;
    const Surface surface = grid.make();
    fs_object o = fs_object_init("wall", FS_PRIMITIVE_PLANE);
    const fs_vec3 normals[] = {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}, along[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    o.surface = surface.get();
    // The grid is in the axes of the object, so the wall of a mesh.
    MeshData data;
    const fs_vec3 n = normals[axis], u = along[axis], v = cross(n, u);
    data.points = {-0.1 * u - 0.1 * v, 0.1 * u - 0.1 * v, 0.1 * u + 0.1 * v, -0.1 * u + 0.1 * v};
    data.triangles = {0, 1, 2, 0, 2, 3};
    hand.shapes.push_back(make_mesh(data));
    o.primitive = FS_PRIMITIVE_MESH;
    o.shape = hand.shapes.back().get();
    hand.put(o, solid(FS_KEEP_FRONT));
    hand.go(0.01 * n + 3e-3 * u);
    const auto push = [&](double x) { return dot(n, hand.slide(x * u - 1e-3 * n)); };
    EXPECT_NEAR(push(3e-3), 1, 0.02);           // the spline overshoots a little, and all of it is lowered by that
    for (const double x : {2e-3, 4e-3, 5e-3, 6e-3}) EXPECT_NEAR(push(x), 0.9, 0.02);
    const double border = push(6e-3);
    for (const double x : {6.5e-3, 9e-3, 0.05}) EXPECT_NEAR(push(x), border, 1e-9);  // it goes on
    EXPECT_NEAR(dot(u, hand.felt.wrench.force), 0, 1e-9);
    EXPECT_NEAR(push(2e-3), push(-0.05), 1e-9);
  }
}
END_TEST

START_TEST(the_limit_is_that_of_the_whole) {
  Random random(7);
  for (const double friction : {0.0, 0.5, 2.0}) {
    Table table(Grid(ridges), 2);
    table.object.contact.friction = friction;
    OK(fs_object_set(table.scene.get(), &table.object));
    double most = 0;
    for (int i = 0; i < 4000; ++i) most = std::max(most, norm(table.slide(random.in_box(0.01) + fs_vec3{0, 0, -0.01}, 5e-3)));
    ck_assert_double_le(most, 2 * (1 + 1e-9));
    ck_assert_double_ge(most, 2 * 0.8);
  }
}
END_TEST

// On a mesh friction may hold the proxy back across an edge.
START_TEST(the_limit_is_that_of_the_whole_mesh) {
  Random random(10);
  const Shape box = make_mesh(box_mesh({0.02, 0.02, 0.02}));
  for (int round = 0; round < times(30, 300); ++round) {
    Hand hand;
    Grid grid = noise(random);
    grid.settings.static_friction = grid.settings.dynamic_friction = random.coin() ? random.between(0.3, 2) : 0;
    const Surface surface = grid.make();
    fs_object o = fs_object_init("box", FS_PRIMITIVE_MESH);
    o.shape = box.get();
    o.surface = surface.get();
    hand.put(o, solid(FS_KEEP_FRONT, 1000, 2));
    hand.go({0, 0, 0.03});
    const fs_vec3 speed = {random.between(2, 5), random.between(2, 5), random.between(2, 5)};
    for (int i = 0; i < 2000; ++i) {
      const double t = i * dt, most = 2 * (1 + 1e-9);
      ck_assert_double_le(norm(hand.go({0.03 * std::sin(speed.x * t), 0.03 * std::sin(speed.y * t), 0.03 * std::cos(speed.z * t)})), most);
    }
  }
}
END_TEST

// What a closed way gives to the hand, J. Without friction nothing, with it less than nothing.
START_TEST(no_closed_way_gives_energy) {
  Random random(17);
  for (int round = 0; round < times(12, 120); ++round) {
    const bool has_friction = random.coin(), is_limited = random.coin();
    Grid grid = noise(random);
    if (has_friction) {
      grid.settings.static_friction = random.between(0.05, 2);
      grid.settings.dynamic_friction = grid.settings.static_friction * random.between(0.1, 1);
      grid.settings.slip_distance = random.coin() ? 0 : random.log_between(1e-5, 1e-3);
    }
    Table table(grid, is_limited ? random.between(0.2, 2) : 1000);
    std::vector<fs_vec3> corners;
    for (int i = 0; i < 5; ++i) corners.push_back({random.between(-3e-3, 3e-3), random.between(-3e-3, 3e-3), random.between(-2e-3, 5e-4)});
    constexpr double step = 2e-6;
    table.slide(corners.back(), step);
    double energy = 0, way = 0;
    fs_vec3 force = table.felt.wrench.force;
    for (int loop = 0; loop < 2; ++loop) {
      energy = way = 0;
      for (const fs_vec3& corner : corners) {
        const fs_vec3 from = table.x;
        const int count = static_cast<int>(std::ceil(norm(corner - from) / step));
        for (int i = 1; i <= count; ++i) {
          const fs_vec3 x = table.x, to = from + (static_cast<double>(i) / count) * (corner - from), now = table.go(to);
          energy += dot(0.5 * (force + now), to - x);
          way += norm(to - x);
          force = now;
        }
      }
    }
    ck_assert_msg(energy <= 2e-7 * way / 1e-2, "round %d: %g J on %g m", round, energy, way);
    if (!has_friction) ck_assert_msg(energy >= -2e-7 * way / 1e-2, "round %d: %g J on %g m", round, energy, way);
  }
}
END_TEST

// On a flat mesh as on a plane.
START_TEST(meshes_are_as_planes) {
  Random random(9);
  for (const double friction : {0.0, 0.6}) {
    Grid grid(bumps);
    grid.settings.static_friction = friction;
    grid.settings.dynamic_friction = 0.5 * friction;
    Table table(grid);
    Hand flat;
    fs_object o = fs_object_init("flat", FS_PRIMITIVE_MESH);
    MeshData data;
    data.points = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
    data.triangles = {0, 1, 2, 0, 2, 3};
    flat.shapes.push_back(make_mesh(data));
    o.shape = flat.shapes.back().get();
    o.surface = table.surface.get();
    flat.put(o, solid(FS_KEEP_FRONT));
    flat.go({0, 0, 0.01});
    flat.slide({0, 0, -0.001});
    for (int i = 0; i < 500; ++i) {
      const fs_vec3 to = {random.between(-2e-3, 2e-3), random.between(-2e-3, 2e-3), random.between(-2e-3, 1e-4)};
      EXPECT_VECTOR(flat.slide(to), table.slide(to), 1e-9);
    }
  }
}
END_TEST

// While the surface holds it, the hand is on a spring: a small closed way gives nothing and takes nothing.
START_TEST(what_sticks_loses_nothing) {
  Random random(19);
  for (int round = 0; round < times(50, 500); ++round) {
    Grid grid = noise(random);
    grid.settings.static_friction = grid.settings.dynamic_friction = 2;
    Table table(grid);
    const fs_vec3 centre = {random.between(-3e-3, 3e-3), random.between(-3e-3, 3e-3), -3e-3};
    table.slide(centre);
    const fs_vec3 proxy = table.proxy();
    const fs_vec3 corners[] = {centre + random.in_box(3e-4), centre + random.in_box(3e-4), centre + random.in_box(3e-4), centre};
    double energy = 0;
    fs_vec3 force = table.felt.wrench.force;
    for (const fs_vec3& corner : corners) {
      const fs_vec3 from = table.x;
      for (int i = 1; i <= 200; ++i) {
        const fs_vec3 x = table.x, to = from + (i / 200.0) * (corner - from), now = table.go(to);
        energy += dot(0.5 * (force + now), to - x);
        force = now;
      }
    }
    EXPECT_VECTOR(table.proxy(), proxy, 1e-12);
    EXPECT_NEAR(energy, 0, 5e-9);
  }
}
END_TEST

// Beside other solids a textured one has a proxy of its own, and the forces add.
START_TEST(in_a_corner_the_forces_add) {
  Random random(21);
  const fs_contact contact = solid(FS_KEEP_FRONT);
  const Surface rough = Grid(ridges).make();
  const auto put_back = [&](Hand& hand) {
    fs_object back = fs_object_init("back", FS_PRIMITIVE_PLANE);
    OK(fs_pose_from_z({0, 1e-3, 0}, {0, -1, 0.1}, &back.pose));
    back.surface = rough.get();
    hand.put(back, contact);
  };
  Table all{Grid(bumps)}, table{Grid(bumps)};
  Hand side, back;
  for (Hand* const hand : {static_cast<Hand*>(&all), &side}) hand->plane("side", {1e-3, 0, 0}, {-1, 0, 0.2}, contact);
  put_back(all);
  put_back(back);
  for (int i = 0; i < 3000; ++i) {
    const fs_vec3 to = random.in_box(3e-3);
    EXPECT_VECTOR(all.slide(to, 1), table.slide(to, 1) + side.slide(to, 1) + back.slide(to, 1), 1e-9);
  }
}
END_TEST

// ------------------------------------------------------------------------------------------------- what the loop bears

// The slope of the force between places that are close, N/m.
double steepest_of(const std::function<fs_vec3(fs_vec3)>& force_at, double size, double depth) {
  Random random(1);
  double most = 0;
  for (int i = 0; i < 5000; ++i) {
    const fs_vec3 x = {random.between(-size, size), random.between(-size, size), -random.between(0, depth)};
    constexpr double h = 2e-6;
    const fs_vec3 way = random.in_box(1), to = x + (h / norm(way)) * way;
    const fs_vec3 force = force_at(x);
    most = std::max(most, norm(force_at(to) - force) / h);
  }
  return most;
}

START_TEST(it_wants_what_it_slopes) {
  Random random(13);
  for (int round = 0; round < times(6, 60); ++round) {
    Grid grid = round == 0 ? Grid(ridges) : round == 1 ? Grid(bumps) : noise(random);
    grid.settings.axis = FS_AXIS_Z;
    Table table(grid, 3);
    const double wanted = report_of(table.scene.get(), "table").stiffness_wanted;
    const double found = steepest_of([&](fs_vec3 x) { return table.slide(x, 1); }, 3e-3, 4e-3);
    const double least = round == 0 ? 0.65 : round == 1 ? 0.5 : 0.1;  // of noise the steepest place is seldom met
    ck_assert_msg(found <= 1.001 * wanted && found >= least * wanted, "round %d: %g N/m, told are %g", round, found, wanted);
  }
}
END_TEST

// +-0.05 mm at 1 mm and 5 N.
START_TEST(heights_are_reduced_to_what_is_granted) {
  const double slope = 5e-5 * wave, curved = slope * wave;
  for (const double stiffness : {1000.0, 0.0}) {
    for (const double most : {20000.0, 5000.0, 1500.0, 400.0}) {
      Rig rig("texture");
      const Surface surface = Grid(ridges).make();
      fs_object o = fs_object_init("table", FS_PRIMITIVE_PLANE);
      o.contact = solid(FS_KEEP_FRONT, stiffness, 5);
      o.surface = surface.get();
      OK(fs_object_set(rig.scene.get(), &o));
      OK(fs_scene_set_max_stiffness(rig.scene.get(), most));
      rig.fake.state.pose.position = {0, 0, 1e-3};
      fs_servo_options options = virtual_options();
      options.speed_limit = options.ramp = -1;
      options.max_stiffness = 25000;
      rig.fake.info.mass = 10;
      rig.fake.info.damping = 100;
      rig.start(options);
      ck_assert_double_eq(stats_of(rig.scene.get()).max_stiffness, 25000);
      rig.step(3000);
      const auto force_at = [&](fs_vec3 x) {
        rig.fake.state.pose.position = x;
        rig.step(1);
        return rig.sent();
      };
      const fs_report told = report_of(rig.scene.get(), "table");
      const double whole = 5 * curved + 1000 * slope * slope;
      ck_assert_double_le(told.stiffness_applied, most * (1 + 1e-9));
      if (most > 1.1 * whole && stiffness > 0) {
        EXPECT_NEAR(told.texture_lost, 0, 0);
      } else {
        ck_assert_double_ge(told.stiffness_applied, 0.999 * most);  // nothing is left unused
        ck_assert((told.texture_lost > 0) == (most < whole) && told.texture_lost < 1);
      }
      const double steepest = steepest_of(force_at, 3e-3, 4e-3);
      ck_assert_msg(steepest <= 1.001 * told.stiffness_applied && steepest >= 0.5 * told.stiffness_applied,
                    "%g N/m, told are %g", steepest, told.stiffness_applied);
      // Most of what is granted stays with the contact.
      ck_assert_double_ge(force_at({0, 0, -1e-4}).z, 0.98 * 1e-4 * std::min(stiffness > 0 ? stiffness : most, 0.8 * most));
    }
  }
}
END_TEST

// ------------------------------------------------------------------------------------------------------------- handles

START_TEST(bad_grids_are_refused_by_name) {
  const struct {
    const char* words;
    void (*spoil)(Grid&);
  } cases[] = {
      {"columns is 0, must be within 1..1048576", [](Grid& g) { g.settings.columns = 0; }},
      {"rows is 0", [](Grid& g) { g.settings.rows = 0; }},
      {"rows is 100000000", [](Grid& g) { g.settings.rows = 100000000; }},
      {"columns * rows is 1099511627776", [](Grid& g) { g.settings.columns = g.settings.rows = 1 << 20; }},
      {"count is 256, must be columns * rows (15 * 16)", [](Grid& g) { g.settings.columns = 15; }},
      {"column_width is 0", [](Grid& g) { g.settings.column_width = 0; }},
      {"row_width is nan", [](Grid& g) { g.settings.row_width = NAN; }},
      {"row_width is 1e-07", [](Grid& g) { g.settings.row_width = 1e-7; }},
      {"first_column is inf", [](Grid& g) { g.settings.first_column = INFINITY; }},
      {"first_row is nan", [](Grid& g) { g.settings.first_row = NAN; }},
      {"axis is 3", [](Grid& g) { const int bad = 3; std::memcpy(&g.settings.axis, &bad, sizeof bad); }},
      {"axis is -1", [](Grid& g) { const int bad = -1; std::memcpy(&g.settings.axis, &bad, sizeof bad); }},
      {"reserved_8", [](Grid& g) { g.settings.reserved_8[1] = 1; }},
      {"heights[7] is 1e-09, must be within -1..0 m", [](Grid& g) { g.heights[7] = 1e-9; }},
      {"heights[255] is nan", [](Grid& g) { g.heights[255] = NAN; }},
      {"heights[0] is -inf", [](Grid& g) { g.heights[0] = -INFINITY; }},
      {"heights[0] is -1.5", [](Grid& g) { g.heights[0] = -1.5; }},
  };
  for (const auto& [words, spoil] : cases) {
    Grid bad(bumps);
    spoil(bad);
    fs_surface* out = nullptr;
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_surface_create_texture(&bad.settings, bad.heights.data(), bad.heights.size(), &out), words);
    ck_assert_ptr_null(out);
  }
  const Grid good(bumps);
  fs_surface* out = nullptr;
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_surface_create_texture(&good.settings, nullptr, 256, &out), "heights is null");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_surface_create_texture(&good.settings, good.heights.data(), 0, &out), "count is 0");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_surface_create(&good.settings, &out), "count is 0, must be columns * rows");
  fs_surface_settings none = fs_surface_settings_init();
  none.row_width = 1;
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_surface_create(&none, &out), "row_width is 1, must be 0 without a texture");
  size_t count = 1;
  ck_assert_ptr_null(fs_surface_get_heights(nullptr, &count));
  ck_assert_uint_eq(count, 0);
  const Surface smooth = make_surface(sticky(0.3, 0.3, 0));
  ck_assert_ptr_null(fs_surface_get_heights(smooth.get(), &count));
}
END_TEST

// A cliff, a single height, and one as deep as may be.
START_TEST(odd_grids_do_no_harm) {
  for (const auto& [columns, rows] : {std::pair{1u, 1u}, {1u, 7u}, {2u, 1u}, {2u, 2u}, {3u, 1u}, {400u, 3u}}) {
    for (const bool repeats : {false, true}) {
      Random random(columns);
      Grid grid([&](double, double) { return random.coin() ? 0 : -1; }, columns, rows, 1e-6);
      grid.settings.repeats = repeats;
      Table table(grid, 5);
      OK(fs_scene_set_max_stiffness(table.scene.get(), 2000));
      for (int i = 0; i < 1000; ++i) {
        const fs_vec3 force = table.slide({random.between(-1, 1), random.between(-1e6, 1e6), -random.between(0, 2)}, 1e9);
        ck_assert(std::isfinite(norm(force)) && norm(force) <= 5 * (1 + 1e-9));
      }
    }
  }
}
END_TEST

void expect_heights(const fs_surface* surface, const Grid& wanted) {
  fs_surface_settings settings = fs_surface_settings_init();
  OK(fs_surface_get_settings(surface, &settings));
  ck_assert_mem_eq(&settings, &wanted.settings, sizeof settings);
  size_t count = 0;
  const double* const heights = fs_surface_get_heights(surface, &count);
  ck_assert_uint_eq(count, wanted.heights.size());
  ck_assert_mem_eq(heights, wanted.heights.data(), count * sizeof *heights);
}

START_TEST(textures_in_files) {
  const Folder folder;
  const std::string path = folder / "scene.json";
  Random random(3);
  for (int round = 0; round < 10; ++round) {
    const Grid grid = noise(random, 1 + random.below(7), 1 + random.below(7));
    const Surface surface = grid.make();
    const Scene scene = make_scene(), again = make_scene();
    fs_object o = fs_object_init("a", FS_PRIMITIVE_PLANE);
    o.surface = surface.get();
    OK(fs_object_set(scene.get(), &o));
    OK(fs_scene_save(scene.get(), path.c_str()));
    OK(fs_scene_load(again.get(), path.c_str()));
    fs_object a = fs_object_init(nullptr, FS_PRIMITIVE_POINT);
    OK(fs_object_get(again.get(), "a", &a));
    expect_heights(a.surface, grid);
    fs_object_release(&a);
  }
  const struct {
    const char *texture, *words;
  } bad[] = {
      {R"({})", "\"heights\" is missing"},       {R"({"heights": []})", "a list of rows"},
      {R"({"heights": [[]]})", "a list of rows"}, {R"({"heights": [[0, 0], [0]]})", "a list of rows"},
      {R"({"heights": [3]})", "a list of rows"},  {R"({"heights": [[0, 1]], "column_width": 1})", "heights[1] is 1"},
      {R"({"heights": [[0, 0]]})", "column_width"}, {R"({"heights": [["a"]]})", "heights"},
      {R"({"heights": [[0]], "axis": "w"})", "axis"}, {R"({"heights": [[0]], "depth": 1})", "\"depth\" is unknown"},
  };
  const Scene scene = make_scene();
  for (const auto& [texture, words] : bad) {
    std::ofstream(path) << R"({"forceserver": "scene", "version": 1, "surfaces": {"rough": {"texture": )" << texture << "}}}";
    EXPECT_SENTENCE(FS_ERROR_PARSE, fs_scene_load(scene.get(), path.c_str()), words);
  }
}
END_TEST

// The heights of an expression are those that it has at the places of the grid.
START_TEST(heights_by_an_expression) {
  if (!has_expressions()) return;
  const struct {
    const char* text;
    fs_axis axis;
    double (*of)(double column, double row);
  } cases[] = {
      {"5e-5*(cos(2*_pi*x/1e-3) - 1)", FS_AXIS_Z, [](double x, double) { return 5e-5 * (std::cos(wave * x) - 1); }},
      {"-abs(x) - y^2 - z", FS_AXIS_Z, [](double x, double y) { return -std::fabs(x) - y * y; }},
      {"-abs(y) - z^2 + x", FS_AXIS_X, [](double y, double z) { return -std::fabs(y) - z * z; }},
      {"z > 0 ? -1e-3 : -abs(x + y)", FS_AXIS_Y, [](double z, double x) { return z > 0 ? -1e-3 : -std::fabs(x); }},
  };
  for (const auto& [text, axis, of] : cases) {
    Grid grid([&](double column, double row) { return of(column - 3e-4, row + 2e-4); }, 16, 8);
    grid.settings.axis = axis;
    grid.settings.first_column = -3e-4;
    grid.settings.first_row = 2e-4;
    fs_surface* raw = nullptr;
    OK(fs_surface_create_expression(&grid.settings, text, &raw));
    const Surface surface(raw);
    size_t count = 0;
    const double* const heights = fs_surface_get_heights(raw, &count);
    ck_assert_uint_eq(count, 16 * 8);
    for (size_t i = 0; i < count; ++i) EXPECT_NEAR(heights[i], grid.heights[i], 1e-15);
  }
  const Grid grid(ridges);
  const struct {
    fs_status status;
    const char *text, *words;
  } bad[] = {
      {FS_ERROR_INVALID, "1e-9", "the expression is 1e-09 at x = 0, y = 0, z = 0, must be within -1..0 m"},
      {FS_ERROR_INVALID, "-1e-3/(x - 1e-3/16*7)", "must be within -1..0 m"},
      {FS_ERROR_INVALID, "-1/(x - 1e-3/2)", "at x = 0, y = 0, z = 0"},
      {FS_ERROR_INVALID, "-sqrt(5e-4 - x)", "nan at x = 0.0005625, y = 0, z = 0"},
      {FS_ERROR_INVALID, "y > 5e-4 ? log(0) : 0", "the expression is -inf at x = 0, y = 0.0005625, z = 0"},
      {FS_ERROR_INVALID, "-2", "the expression is -2"},
      {FS_ERROR_PARSE, "", "is empty"},
      {FS_ERROR_PARSE, "-d", "at 'd': the name is unknown; the names are the place x, y, z (m),"},
      {FS_ERROR_PARSE, "-X", "write x"},
      {FS_ERROR_PARSE, "-t", "the name is unknown"},
      {FS_ERROR_PARSE, "-(x", "it is not closed"},
      {FS_ERROR_PARSE, "x = 3", "assignment"},
      {FS_ERROR_PARSE, "-pow(x, 2)", "write a^b"},
  };
  for (const auto& [status, text, words] : bad) {
    fs_surface* out = nullptr;
    EXPECT_SENTENCE(status, fs_surface_create_expression(&grid.settings, text, &out), words);
    ck_assert_ptr_null(out);
  }
  fs_surface* out = nullptr;
  Grid large(ridges);
  large.settings.rows = 100000000;
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_surface_create_expression(&large.settings, "-x", &out), "rows is 100000000");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_surface_create_expression(&grid.settings, std::string(300, '1').c_str(), &out),
                  "more than 255 bytes");
  // In a file: the same heights.
  const Folder folder;
  const std::string path = folder / "scene.json";
  const auto load = [&](const Scene& scene, const std::string& texture) {
    std::ofstream(path) << R"({"forceserver": "scene", "version": 1, "surfaces": {"rough": {"texture": )" << texture
                        << R"(}}, "objects": [{"name": "a", "primitive": "plane", "surface": "rough"}]})";
    return fs_scene_load(scene.get(), path.c_str());
  };
  const Scene scene = make_scene();
  OK(load(scene, R"({"expression": "-x", "columns": 3, "rows": 2, "column_width": 0.01, "row_width": 0.02, "repeats": true})"));
  fs_object a = fs_object_init(nullptr, FS_PRIMITIVE_POINT);
  OK(fs_object_get(scene.get(), "a", &a));
  size_t count = 0;
  const double* const heights = fs_surface_get_heights(a.surface, &count);
  const double wanted[] = {0, -0.01, -0.02, 0, -0.01, -0.02};
  ck_assert_uint_eq(count, 6);
  for (size_t i = 0; i < 6; ++i) EXPECT_NEAR(heights[i], wanted[i], 1e-16);
  fs_object_release(&a);
  EXPECT_SENTENCE(FS_ERROR_PARSE, load(scene, R"({"expression": "-x"})"), "columns is 0");
  EXPECT_SENTENCE(FS_ERROR_PARSE, load(scene, R"({"expression": "-q", "columns": 1, "rows": 1})"), "at 'q'");
  EXPECT_SENTENCE(FS_ERROR_PARSE, load(scene, R"({"expression": 3, "columns": 1, "rows": 1})"), "expression");
  EXPECT_SENTENCE(FS_ERROR_PARSE, load(scene, R"({"expression": "-x", "heights": [[0]], "columns": 1, "rows": 1})"), "\"heights\" is unknown");
}
END_TEST

}  // namespace

int main() {
  Suite* const suite = suite_create("texture");
  add_case(suite, "the force",
           {the_force_is_the_gradient_of_one_energy, it_is_that_of_the_heights, axes_and_borders, the_limit_is_that_of_the_whole, the_limit_is_that_of_the_whole_mesh,
            no_closed_way_gives_energy, what_sticks_loses_nothing, meshes_are_as_planes, in_a_corner_the_forces_add});
  add_case(suite, "the loop", {it_wants_what_it_slopes, heights_are_reduced_to_what_is_granted});
  add_case(suite, "handles", {bad_grids_are_refused_by_name, odd_grids_do_no_harm, textures_in_files, heights_by_an_expression});
  return run_suite(suite);
}
