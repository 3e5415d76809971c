// Other programs on DDS, which know the topics and nothing else: what they publish is felt, and nonsense harms nobody.
#include <cmath>
#include <limits>

#include "dds/bridge_rig.h"
#include "room.h"
#include "samples.h"
#include "scenes/random.h"

using namespace dds;
using namespace scenes;
using bridge::put_text;

namespace {

bridge::Participant::Settings settings_for(const RoomName& room) {
  bridge::Participant::Settings out;
  out.domain = static_cast<uint32_t>(std::stoul(room.domain));
  out.partition = room.room;
  out.network = "lo";
  return out;
}

// A program that takes part without a server.
struct Foreign {
  explicit Foreign(const RoomName& name) : participant(settings_for(name)), room(participant) {}
  const bridge::Participant participant;
  const bridge::Room room;

  bool hears_bridge() {
    bool out = false;
    room.status.reader.take([&](const forceserver_Status&, const dds_sample_info_t& info) { out |= info.valid_data; });
    return out;
  }
};

forceserver_ForceObject make_object(const char* name, fs_vec3 place) {
  const fs_object spring = spring_at(name, place);
  forceserver_ForceObject out{};
  put_text(out.site, "rover");
  put_text(out.client, "sim");
  put_text(out.name, name);
  out.session = 1;
  out.revision = 1;
  out.change = 1;
  out.change_size = 1;
  bridge::put_object(out, spring);
  out.place.orientation.w = 1;
  return out;
}

fs_vec3 place_of(const Scene& scene, const std::string& name) {
  for (const fs_motion& motion : scene.get_motions()) {
    if (name == motion.name) return motion.pose.position;
  }
  return {};
}

}  // namespace

START_TEST(another_program_publishes_objects) {
  const RoomName name;
  const Site desk(name, "desk");
  const Scene viewer = desk.connect("viewer");
  Foreign foreign(name);
  EVENTUALLY(foreign.hears_bridge());
  ck_assert(foreign.room.objects.writer.write(make_object("rock", {0.03, 0, 0})));
  EVENTUALLY(weight_of(viewer, "sim@rover/rock") == 1);
  // It moves it,
  for (int i = 1; i <= 20; ++i) {
    forceserver_ForceObject moved = make_object("rock", {0.03, 0.001 * i, 0});
    moved.revision = 1 + static_cast<uint64_t>(i);
    std::vector<forceserver_Moved> moves = {bridge::to_moved(moved)};
    forceserver_Motions motions{};
    put_text(motions.site, "rover");
    motions.session = 1;
    motions.number = static_cast<uint64_t>(i);
    motions.sent = i;  // on a clock of its own
    bridge::lend(motions.moves, moves);
    ck_assert(foreign.room.motions.writer.write(motions));
    wait_a_little(0.02);
  }
  EVENTUALLY(std::fabs(place_of(viewer, "sim@rover/rock").y - 0.02) < 1e-12);
  // gives it a shape under a name of its own,
  std::vector<forceserver_Vec3> points = {{0, 0, 0}, {0.02, 0, 0}};
  forceserver_Shape shape{};
  put_text(shape.content, "rover-line");
  shape.pieces = 1;
  shape.primitive = FS_PRIMITIVE_POLYLINE;
  bridge::lend(shape.points, points);
  forceserver_ForceObject line = make_object("line", {0, 0, 0.02});
  line.primitive = FS_PRIMITIVE_POLYLINE;
  put_text(line.form, "rover-line");
  ck_assert(foreign.room.objects.writer.write(line));
  wait_a_little(0.1);
  ck_assert(foreign.room.shapes.writer.write(shape));
  EVENTUALLY(weight_of(viewer, "sim@rover/line") == 1);
  // reads what is felt,
  const Scene app = desk.connect("app");
  app.object_set(spring_at("spring", {0.04, 0, 0}));
  bridge::Reader<forceserver_Reports> reports(foreign.participant);
  EVENTUALLY(([&] {
    bool out = false;
    reports.take([&](const forceserver_Reports& sample, const dds_sample_info_t& info) {
      for (uint32_t i = 0; info.valid_data && i < sample.felt._length; ++i) {
        out |= bridge::text_of(sample.felt._buffer[i].name) == "spring" && sample.felt._buffer[i].force.x > 1;
      }
    });
    return out;
  }()));
  // and takes an object back.
  ck_assert(foreign.room.objects.writer.dispose(line));
  EVENTUALLY(!has_object(viewer, "sim@rover/line"));
  ck_assert(has_object(viewer, "sim@rover/rock"));
}
END_TEST

// A piece that is taken back before all have come, as what nobody uses any more is, is no piece without points.
START_TEST(a_piece_that_is_taken_back) {
  const RoomName name;
  const Site desk(name, "desk");
  const Scene viewer = desk.connect("viewer");
  Foreign foreign(name);
  EVENTUALLY(foreign.hears_bridge());
  std::vector<forceserver_Vec3> points = {{0, 0, 0}, {0.02, 0, 0}}, others = {{0.02, 0.01, 0}};
  forceserver_Shape shape{};
  put_text(shape.content, "rover-line");
  shape.pieces = 2;
  shape.primitive = FS_PRIMITIVE_POLYLINE;
  forceserver_Shape second = shape;
  second.piece = 1;
  bridge::lend(shape.points, points);
  forceserver_ForceObject line = make_object("line", {0, 0, 0.02});
  line.primitive = FS_PRIMITIVE_POLYLINE;
  put_text(line.form, "rover-line");
  ck_assert(foreign.room.objects.writer.write(line));
  ck_assert(foreign.room.shapes.writer.dispose(second));
  wait_a_little(0.3);
  ck_assert(foreign.room.shapes.writer.write(shape));
  wait_a_little(0.3);
  bridge::lend(second.points, others);
  ck_assert(foreign.room.shapes.writer.write(second));
  EVENTUALLY(weight_of(viewer, "sim@rover/line") == 1);
  size_t count = 0;
  fs_shape_get_points(viewer.object_get("sim@rover/line").shape, &count);
  ck_assert_uint_eq(count, 3);
}
END_TEST

START_TEST(when_it_is_lost_its_objects_fade) {
  const RoomName name;
  const Site desk(name, "desk");
  const Scene viewer = desk.connect("viewer");
  {
    Foreign foreign(name);
    EVENTUALLY(foreign.hears_bridge());
    ck_assert(foreign.room.objects.writer.write(make_object("rock", {0.03, 0, 0})));
    EVENTUALLY(weight_of(viewer, "sim@rover/rock") == 1);
  }
  EVENTUALLY(!has_object(viewer, "sim@rover/rock"));
}
END_TEST

START_TEST(nonsense_is_left_out) {
  const RoomName name;
  const Site desk(name, "desk");
  const Scene viewer = desk.connect("viewer");
  const Scene app = desk.connect("app");
  app.object_set(spring_at("spring", {0.04, 0, 0}));
  Foreign foreign(name);
  EVENTUALLY(foreign.hears_bridge());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  int number = 0;
  const auto write = [&](auto change) {
    forceserver_ForceObject object = make_object(("bad" + std::to_string(++number)).c_str(), {0.03, 0, 0});
    change(object);
    ck_assert(foreign.room.objects.writer.write(object));
  };
  write([&](forceserver_ForceObject& o) { o.place.position.x = nan; });
  write([&](forceserver_ForceObject& o) { o.place.orientation.w = 3; });
  write([&](forceserver_ForceObject& o) { o.primitive = -1; });
  write([&](forceserver_ForceObject& o) { o.primitive = FS_PRIMITIVE_MESH; });  // without a shape
  write([&](forceserver_ForceObject& o) { o.front.kind = 77; });
  write([&](forceserver_ForceObject& o) { o.front.limit = -1; });
  write([&](forceserver_ForceObject& o) { o.start = nan; });
  write([&](forceserver_ForceObject& o) { o.damping = 1e300; });
  write([&](forceserver_ForceObject& o) { o.solid.keep = FS_KEEP_FRONT; });
  write([&](forceserver_ForceObject& o) { put_text(o.name, ""); });
  write([&](forceserver_ForceObject& o) { put_text(o.name, "a/b"); });
  write([&](forceserver_ForceObject& o) { put_text(o.name, "\n\x1b[2J"); });
  write([&](forceserver_ForceObject& o) { put_text(o.site, "NO SITE"); });
  write([&](forceserver_ForceObject& o) { put_text(o.site, "desk"); });  // that of somebody else
  write([&](forceserver_ForceObject& o) { put_text(o.form, "not there"); });
  write([&](forceserver_ForceObject& o) { o.front.kind = FS_PROFILE_CUSTOM, put_text(o.front.curve, "wrong"); });
  // Contents that make no sense.
  std::vector<forceserver_Vec3> points = {{0, 0, 0}, {0.02, 0, 0}, {0, 0.02, 0}};
  std::vector<uint32_t> triangles = {0, 1, 7};
  const auto write_shape = [&](auto change) {
    forceserver_Shape shape{};
    put_text(shape.content, "shape" + std::to_string(++number));
    shape.pieces = 1;
    shape.primitive = FS_PRIMITIVE_MESH;
    bridge::lend(shape.points, points);
    bridge::lend(shape.triangles, triangles);
    change(shape);
    ck_assert(foreign.room.shapes.writer.write(shape));
  };
  write_shape([&](forceserver_Shape&) {});  // an index that is too large
  write_shape([&](forceserver_Shape& s) { s.pieces = 0; });
  write_shape([&](forceserver_Shape& s) { s.pieces = ~0u; });
  write_shape([&](forceserver_Shape& s) { s.piece = 5; });
  write_shape([&](forceserver_Shape& s) { s.triangles = {}; });
  write_shape([&](forceserver_Shape& s) { put_text(s.content, "0123456789abcdef0123456789abcdef"); s.triangles._length = 0; s.primitive = FS_PRIMITIVE_POLYLINE; });
  forceserver_Curve curve{};
  put_text(curve.content, "wrong");
  curve.pieces = 1;
  put_text(curve.expression, "system(1");
  ck_assert(foreign.room.curves.writer.write(curve));
  // An edit of what is not there, and one with numbers that are none.
  forceserver_Edit edit{};
  put_text(edit.site, "desk");
  put_text(edit.client, "app");
  put_text(edit.asker, "rover");
  edit.parts = ~0u;
  edit.wanted.place = {{nan, nan, nan}, {1, 0, 0, 0}};
  const auto ask = [&](const char* of, bool removes) {
    put_text(edit.name, of);
    edit.removes = removes;
    ++edit.number;
    ck_assert(foreign.room.edits.writer.write(edit));
  };
  int refused = 0, looks = 0;
  EVENTUALLY(([&] {
    // Again: an answer is lost where the bridge does not know yet who hears it.
    if (looks++ % 2000 == 0) ask("nobody", true), ask("spring", false);
    foreign.room.answers.reader.take([&](const forceserver_Answer& answer, const dds_sample_info_t& info) {
      if (info.valid_data && answer.result < 0 && *answer.text) ++refused;
    });
    return refused >= 2;
  }()));
  EXPECT_VECTOR(app.object_get("spring").pose.position, (fs_vec3{0.04, 0, 0}), 0);
  // All of that was left out, and what makes sense is felt.
  ck_assert(foreign.room.objects.writer.write(make_object("rock", {0.03, 0, 0})));
  EVENTUALLY(weight_of(viewer, "sim@rover/rock") == 1);
  ck_assert_uint_eq(objects_of(viewer, "sim@rover"), 1);
  EVENTUALLY(desk.bridge.output().find("another one") != std::string::npos);  // a hash that is not that of the content
}
END_TEST

// Random numbers in every field of every topic.
START_TEST(random_samples) {
  const RoomName name;
  Site desk(name, "desk");
  const Scene viewer = desk.connect("viewer");
  Foreign foreign(name);
  EVENTUALLY(foreign.hears_bridge());
  Random random(1);
  const auto any = [&](void* data, size_t size) {
    auto* const bytes = static_cast<unsigned char*>(data);
    for (size_t i = 0; i < size; ++i) bytes[i] = static_cast<unsigned char>(random.below(256));
  };
  const auto fill = [&](auto& sample) {
    any(&sample, sizeof sample);
    put_text(sample.site, random.below(4) ? "rover" : "desk");
  };
  const auto name_it = [&](auto& text) {
    put_text(text, random.below(3) ? std::string(1, static_cast<char>('a' + random.below(6))) : std::string("\x01/@\xff"));
  };
  const auto tame = [&](forceserver_ForceObject& object) {
    for (auto* const text : {&object.form, &object.finish, &object.front.curve, &object.back.curve}) put_text(*text, random.below(2) ? "x" : "");
    object.enabled = random.below(2);
    name_it(object.client);
    name_it(object.name);
    if (random.below(2)) object.primitive = static_cast<int32_t>(random.below(4));
    if (random.below(2)) object.front = object.back = {};
    if (random.below(2)) object.place = {{0.01, 0, 0}, {1, 0, 0, 0}};
  };
  for (int i = 0; i < 20000; ++i) {
    switch (random.below(8)) {
      case 0: {
        forceserver_ForceObject object{};
        fill(object);
        tame(object);
        if (random.below(5)) foreign.room.objects.writer.write(object);
        else foreign.room.objects.writer.dispose(object);
        break;
      }
      case 1: {
        forceserver_Motions motions{};
        fill(motions);
        std::vector<forceserver_Moved> moves(random.below(100));
        for (forceserver_Moved& moved : moves) {
          any(&moved, sizeof moved);
          name_it(moved.client);
          name_it(moved.name);
        }
        bridge::lend(motions.moves, moves);
        foreign.room.motions.writer.write(motions);
        break;
      }
      case 2: {
        forceserver_ClientView view{};
        fill(view);
        name_it(view.client);
        view.clutch_held = random.below(2);
        std::vector<forceserver_Vec3> tool(random.below(32));
        any(tool.data(), tool.size() * sizeof(forceserver_Vec3));
        bridge::lend(view.tool, tool);
        foreign.room.clients.writer.write(view);
        break;
      }
      case 3: {
        forceserver_Hand hand{};
        fill(hand);
        foreign.room.hands.writer.write(hand);
        break;
      }
      case 4: {
        forceserver_Shape shape{};
        put_text(shape.content, std::string(1, static_cast<char>('x' + random.below(3))));
        shape.piece = random.below(4);
        shape.pieces = random.below(5);
        shape.primitive = static_cast<int32_t>(random.below(5));
        std::vector<forceserver_Vec3> points(random.below(50));
        std::vector<uint32_t> triangles(random.below(50));
        any(points.data(), points.size() * sizeof(forceserver_Vec3));
        any(triangles.data(), triangles.size() * sizeof(uint32_t));
        bridge::lend(shape.points, points);
        bridge::lend(shape.triangles, triangles);
        foreign.room.shapes.writer.write(shape);
        break;
      }
      case 5: {
        forceserver_Ping ping{};
        fill(ping);
        ping.echoes = {};
        foreign.room.pings.writer.write(ping);
        break;
      }
      case 6: {
        forceserver_Edit edit{};
        fill(edit);
        name_it(edit.client);
        name_it(edit.name);
        put_text(edit.asker, "rover");
        put_text(edit.editor, "a");
        for (auto* const text : {&edit.wanted.form, &edit.wanted.finish, &edit.wanted.front.curve, &edit.wanted.back.curve}) put_text(*text, "x");
        edit.wanted.enabled = random.below(2);
        edit.removes = random.below(2);
        foreign.room.edits.writer.write(edit);
        break;
      }
      default: {
        forceserver_Surface surface{};
        any(&surface, sizeof surface);
        put_text(surface.content, "x");
        surface.piece = random.below(3);
        surface.pieces = random.below(3);
        surface.repeats = random.below(2);
        std::vector<double> heights(random.below(50));
        bridge::lend(surface.heights, heights);
        foreign.room.surfaces.writer.write(surface);
      }
    }
    if (i % 100 == 0) wait_a_little(0.01);
  }
  ck_assert(foreign.room.objects.writer.write([] {
    forceserver_ForceObject object = make_object("rock", {0.03, 0, 0});
    put_text(object.site, "other");
    return object;
  }()));
  EVENTUALLY(weight_of(viewer, "sim@other/rock") == 1);
  ck_assert_int_eq(desk.bridge.end(), 0);
}
END_TEST

int main() {
  Suite* const suite = suite_create("foreign programs");
  add_case(suite, "sense", {another_program_publishes_objects, a_piece_that_is_taken_back, when_it_is_lost_its_objects_fade});
  add_case(suite, "nonsense", {nonsense_is_left_out, random_samples});
  return run_suite(suite);
}
