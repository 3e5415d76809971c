// Plays the scenario through the C functions, and prints what they give: the reference for the other players.
//     parity_player SCENARIO.json here|connected FOLDER
// A line for each step: its place in the scenario, the status, then what the step gives: numbers as hexadecimal doubles,
// texts after a '.
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <forceserver/driver.h>
#include <forceserver/forceserver.h>

namespace {

using nlohmann::json;

struct Failure {
  fs_status status;
};
void check(fs_status status) {
  if (status < 0) throw Failure{status};
}

std::string line;  // what the present step has given so far
void give(double number) {
  char text[40];
  std::snprintf(text, sizeof text, "\t%a", number);
  line += text;
}
void give(const char* text) { line += std::string("\t'") + text; }
void give(const fs_vec3& v) { give(v.x), give(v.y), give(v.z); }
void give(const fs_quat& q) { give(q.w), give(q.x), give(q.y), give(q.z); }
void give(const fs_pose& pose) { give(pose.position), give(pose.orientation); }
void give(const fs_twist& twist) { give(twist.linear), give(twist.angular); }
void give(const fs_wrench& wrench) { give(wrench.force), give(wrench.torque); }
void give(const fs_frame& frame) { give(frame.pose), give(frame.scale), give(frame.force_scale); }
void give(const fs_view& view) {
  give(view.frame), give(view.tool), give(view.held), give(view.point_radius);
  for (uint32_t i = 0; i < view.point_count; ++i) give(view.points[i]);
}
void give(const fs_report& r) {
  give(r.name), give(r.primitive), give(r.state), give(r.weight), give(r.stiffness_wanted), give(r.stiffness_applied);
  give(r.distance), give(r.point), give(r.wrench);
}
void give(const fs_profile& p) {
  give(p.kind), give(p.sense), give(p.gain), give(p.offset), give(p.width), give(p.limit), give(p.reach);
}

class Player {
 public:
  Player(const json& scenario, bool is_connected, std::string folder)
      : is_connected_(is_connected), folder_(std::move(folder)), places_(vectors(scenario.at("places"))) {
    check(fs_scene_create(&base_));
    check(fs_device_open(scenario.at("device").get<std::string>().c_str(), &device_));
    options_.mode = FS_SERVO_VIRTUAL;
    options_.fade = scenario.at("fade");
    options_.max_stiffness = -1;  // else a force would depend on when the servo has looked at what else is there
    scene_ = base_;
    if (!is_connected) return;
    const std::string endpoint = "shm:parity-" + std::to_string(getpid());
    check(fs_servo_start(base_, device_, &options_, &servo_));
    check(fs_server_start(servo_, endpoint.c_str(), nullptr, &server_));
    check(fs_scene_connect(endpoint.c_str(), "player", &scene_));
    check(fs_scene_connect(endpoint.c_str(), "other", &other_));
  }
  ~Player() {
    if (is_connected_) fs_scene_destroy(scene_), fs_scene_destroy(other_);
    fs_server_stop(server_);
    fs_servo_stop(servo_);
    fs_device_close(device_);
    fs_scene_destroy(base_);
    for (const auto& [name, shape] : shapes_) fs_shape_destroy(shape);
    for (const auto& [name, curve] : curves_) fs_curve_destroy(curve);
    for (const auto& [name, surface] : surfaces_) fs_surface_destroy(surface);
  }
  Player(const Player&) = delete;

  void play(const json& steps, const std::string& prefix = "") {
    for (std::size_t i = 0; i < steps.size(); ++i) {
      const json& step = steps[i];
      if (step.contains("only") && (step["only"] == "connected") != is_connected_) continue;
      const std::string place = prefix + std::to_string(i);
      fs_status status = FS_OK;
      if (step["do"] == "group") check(fs_scene_begin(scene_)), play(step.at("steps"), place + ".");
      line.clear();
      fs_scene* const own = scene_;
      const std::string who = step.value("by", "player");
      scene_ = who == "server" ? base_ : who == "other" ? other_ : own;
      try {
        run(step, step.at("do"));
      } catch (const Failure& failure) {
        status = failure.status;
        line.clear();
      }
      scene_ = own;
      std::printf("%s\t'%s%s\n", place.c_str(), fs_status_name(status) + 3, line.c_str());
    }
  }

 private:
  static fs_vec3 vector(const json& v) { return {v.at(0), v.at(1), v.at(2)}; }
  static std::vector<fs_vec3> vectors(const json& list) {
    std::vector<fs_vec3> out;
    for (const json& v : list) out.push_back(vector(v));
    return out;
  }
  static fs_pose pose(const json& p) {
    fs_pose out = {p.contains("position") ? vector(p["position"]) : fs_vec3{}, {1, 0, 0, 0}};
    if (p.contains("z")) check(fs_pose_from_z(out.position, vector(p["z"]), &out));
    if (p.contains("orientation")) {
      const json& q = p["orientation"];
      out.orientation = {q.at(0), q.at(1), q.at(2), q.at(3)};
    }
    return out;
  }
  static fs_twist twist(const json& t) { return {vector(t.at(0)), vector(t.at(1))}; }
  // The value of an enum from its name in lower case, without the prefix that all its values have.
  template <class Enum>
  static Enum value(const json& name, const char* (*name_of)(Enum), const char* prefix) {
    std::string full = prefix;
    for (const char c : name.get<std::string>()) full += char(std::toupper(c));
    for (int i = 0; i < 16; ++i) {
      if (full == name_of(Enum(i))) return Enum(i);
    }
    std::fprintf(stderr, "the library has no %s\n", full.c_str());
    std::exit(2);
  }
  fs_profile profile(const json& p) const {
    fs_profile out = {};
    out.kind = value(p.at("kind"), fs_profile_kind_name, "FS_PROFILE_");
    out.sense = value(p.value("sense", json("attractive")), fs_sense_name, "FS_SENSE_");
    out.gain = p.value("gain", 0.0);
    out.offset = p.value("offset", 0.0);
    out.width = p.value("width", 0.0);
    out.limit = p.value("limit", 0.0);
    out.reach = p.value("reach", 0.0);
    if (p.contains("curve")) out.curve = curves_.at(p["curve"]);
    return out;
  }
  fs_object object(const json& o) const {
    const std::string name = o.at("name");
    fs_object out = fs_object_init(name.c_str(), FS_PRIMITIVE_POINT);
    if (o.contains("wall")) {
      const json& wall = o["wall"];
      out = fs_wall_init(name.c_str(), vector(wall.at(0)), vector(wall.at(1)), wall.at(2), wall.at(3));
    }
    if (o.contains("primitive")) out.primitive = value(o["primitive"], fs_primitive_name, "FS_PRIMITIVE_");
    if (o.contains("pose")) out.pose = pose(o["pose"]);
    if (o.contains("twist")) out.twist = twist(o["twist"]);
    out.time = o.value("time", 0.0);
    out.start = o.value("start", 0.0);
    out.lifetime = o.value("lifetime", 0.0);
    if (o.contains("front")) out.front = profile(o["front"]);
    if (o.contains("back")) out.back = profile(o["back"]);
    out.damping = o.value("damping", 0.0);
    if (o.contains("solid")) out.contact = {FS_KEEP_FRONT, 0, o["solid"], 10, 0, 0, {}};
    if (o.contains("surface")) out.surface = surfaces_.at(o["surface"]);
    if (o.contains("shape")) out.shape = shapes_.at(o["shape"]);
    out.tool_points = o.value("tool_points", 0u);
    out.enabled = o.value("enabled", true);
    return out;
  }
  fs_shape* make_shape(const json& step) const {
    fs_shape* shape = nullptr;
    if (step.contains("file")) {
      check(fs_shape_load((folder_ + "/" + step["file"].get<std::string>()).c_str(), step.at("scale"), &shape));
    } else if (step.contains("triangles")) {
      const auto points = vectors(step.at("points"));
      std::vector<uint32_t> triangles;
      for (const json& t : step["triangles"]) triangles.insert(triangles.end(), t.begin(), t.end());
      check(fs_shape_create_mesh(points.data(), points.size(), triangles.data(), triangles.size() / 3, &shape));
    } else {
      const auto points = vectors(step.at("points"));
      check(fs_shape_create_polyline(points.data(), points.size(), step.value("closed", false), &shape));
    }
    return shape;
  }
  // Steps until the changes of all scenes are felt, and then until the hand rests.
  void settle() {
    for (fs_scene* const scene : {scene_, is_connected_ ? base_ : nullptr, other_}) {
      fs_status status = FS_OK;
      int patience = 10000;
      while (scene) {
        check(fs_servo_step(servo_, 10));
        status = fs_scene_sync(scene, 1e-3);
        if (status != FS_ERROR_TIMEOUT || --patience == 0) break;
      }
      check(status);
    }
    check(fs_servo_step(servo_, 5000));
  }

  void run(const json& step, const std::string& verb) {
    const std::string name = step.value("name", ""), client_name = step.value("client", "");
    const char* const client = step.contains("client") ? client_name.c_str() : nullptr;
    if (verb == "time") {
      double now;
      if (is_connected_) {
        check(fs_scene_get_time(scene_, &now));
        check(fs_servo_step(servo_, uint64_t((step.at("at").get<double>() - now) * 1000 + 0.5)));
      } else {
        check(fs_scene_set_time(scene_, step.at("at")));
      }
      check(fs_scene_get_time(scene_, &now));
      give(now);
    } else if (verb == "shape") {
      fs_shape* shape = make_shape(step);
      fs_shape_info info = fs_shape_info_init();
      shapes_[name] = shape;
      check(fs_shape_get_info(shape, &info));
      give(info.primitive), give(info.closed), give(double(info.open_edges)), give(info.lower), give(info.upper);
      for (const uint64_t part : info.content) {
        char text[20];
        std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(part));
        give(text);
      }
    } else if (verb == "build") {
      fs_shape_info info = fs_shape_info_init();
      check(fs_shape_build(shapes_.at(name)));
      check(fs_shape_get_info(shapes_.at(name), &info));
      double progress;
      check(fs_shape_get_progress(shapes_.at(name), &progress));
      give(info.built), give(progress);
    } else if (verb == "curve") {
      fs_curve* curve;
      if (step.contains("table")) {
        const std::vector<double> table = step["table"];
        check(fs_curve_create_table(table.data(), table.size(), step.at("step"), &curve));
      } else {
        check(fs_curve_create_expression(step.at("expression").get<std::string>().c_str(), &curve));
      }
      curves_[name] = curve;
    } else if (verb == "surface") {
      fs_surface_settings settings = fs_surface_settings_init();
      settings.static_friction = step.at("static"), settings.dynamic_friction = step.at("dynamic");
      settings.slip_distance = step.at("distance");
      if (step.contains("impact")) check(fs_surface_set_impact(&settings, step["impact"].get<fs_impact>()));
      fs_surface* surface;
      if (step.contains("heights")) {
        const std::vector<double> heights = step["heights"];
        settings.columns = step.at("columns"), settings.rows = static_cast<uint32_t>(heights.size()) / settings.columns;
        settings.column_width = settings.row_width = step.at("width"), settings.repeats = true;
        check(fs_surface_create_texture(&settings, heights.data(), heights.size(), &surface));
      } else if (step.contains("expression")) {
        settings.columns = step.at("columns"), settings.rows = step.at("rows");
        settings.column_width = settings.row_width = step.at("width");
        check(fs_surface_create_expression(&settings, step["expression"].get<std::string>().c_str(), &surface));
      } else {
        check(fs_surface_create(&settings, &surface));
      }
      surfaces_[name] = surface;
    } else if (verb == "profile") {
      const fs_profile p = profile(step.at("profile"));
      const std::vector<double> distances = step.at("distances");
      std::vector<double> forces(distances.size());
      check(fs_profile_evaluate(&p, step.value("max_stiffness", 0.0), step.at("t"), distances.data(), distances.size(),
                                forces.data()));
      for (const double force : forces) give(force);
    } else if (verb == "law") {
      const fs_object o = object(step.at("object"));
      const std::vector<double> distances = step.at("distances");
      std::vector<double> forces(distances.size());
      check(fs_object_evaluate_law(&o, step.at("max_stiffness"), step.at("t"), distances.data(), distances.size(),
                                   forces.data()));
      for (const double force : forces) give(force);
    } else if (verb == "set") {
      const fs_object o = object(step.at("object"));
      check(fs_object_set(scene_, &o));
    } else if (verb == "change") {
      const std::map<std::string, uint32_t> parts = {{"pose", 1}, {"profiles", 2}, {"contact", 4}, {"shape", 8}, {"other", 16}};
      const fs_object o = object(step.at("object"));
      uint32_t bits = 0;
      for (const json& part : step.at("parts")) bits |= parts.at(part);
      check(fs_object_change(scene_, &o, bits));
    } else if (verb == "move") {
      const fs_pose to = pose(step.at("pose"));
      const fs_twist with = step.contains("twist") ? twist(step["twist"]) : fs_twist{};
      check(fs_object_move(scene_, name.c_str(), &to, step.contains("twist") ? &with : nullptr, step.value("time", 0.0)));
    } else if (verb == "remove") {
      check(fs_object_remove(scene_, name.c_str()));
    } else if (verb == "group") {
      check(step.at("commit") ? fs_scene_commit(scene_) : fs_scene_cancel(scene_));
    } else if (verb == "evaluate") {
      const auto positions = step.contains("positions") ? vectors(step["positions"]) : places_;
      std::vector<fs_vec3> forces(positions.size());
      check(fs_evaluate_field(scene_, step.contains("name") ? name.c_str() : nullptr, step.at("time"), positions.data(),
                              positions.size(), forces.data()));
      for (const fs_vec3& force : forces) give(force);
    } else if (verb == "tool") {
      const auto points = step.contains("points") ? vectors(step["points"]) : std::vector<fs_vec3>();
      fs_tool* tool;
      check(fs_tool_create(scene_, points.empty() ? nullptr : points.data(), points.size(), &tool));
      for (const fs_vec3& place : places_) {
        fs_state state = {};
        fs_response response;
        state.pose = pose(step.at("pose"));
        state.pose.position = place;
        state.twist = twist(step.at("twist"));
        state.time = step.at("time");
        check(fs_evaluate(tool, &state, &response));
        give(response.wrench), give(response.felt_count);
        for (const double k : {response.stiffness.xx, response.stiffness.xy, response.stiffness.zz}) give(k);
      }
      check(fs_tool_reset(tool));
      fs_tool_destroy(tool);
    } else if (verb == "get") {
      fs_object o = fs_object_init("", FS_PRIMITIVE_POINT);
      check(fs_object_get(scene_, name.c_str(), &o));
      give(o.name), give(o.primitive), give(o.pose), give(o.twist), give(o.lifetime), give(o.front), give(o.back);
      give(o.damping), give(o.tool_points), give(o.enabled);
      size_t count = 0;
      double table_step = 0;
      const fs_vec3* points = o.shape ? fs_shape_get_points(o.shape, &count) : nullptr;
      for (size_t i = 0; i < count; ++i) give(points[i]);
      const uint32_t* corners = o.shape ? fs_shape_get_triangles(o.shape, &count) : nullptr;
      for (size_t i = 0; corners && i < 3 * count; ++i) give(corners[i]);
      if (o.front.curve) {
        const char* expression = fs_curve_get_expression(o.front.curve);
        if (expression) give(expression);
        const double* table = fs_curve_get_table(o.front.curve, &count, &table_step);
        for (size_t i = 0; table && i < count; ++i) give(table[i]);
        give(table_step);
      }
      if (o.surface) {
        fs_surface_settings settings = fs_surface_settings_init();
        check(fs_surface_get_settings(o.surface, &settings));
        give(settings.static_friction), give(settings.dynamic_friction), give(settings.slip_distance);
        size_t count = 0;
        const double* const heights = fs_surface_get_heights(o.surface, &count);
        for (size_t i = 0; i < count; ++i) give(heights[i]);
        give(settings.column_width), give(settings.impact_gain), give(settings.impact_frequency), give(settings.impact_decay);
      }
      fs_object_release(&o);
    } else if (verb == "motions") {
      std::vector<fs_motion> motions(100);
      size_t count = 0;
      check(fs_scene_get_motions(scene_, client, motions.data(), motions.size(), &count));
      for (size_t i = 0; i < count; ++i) {
        const fs_motion& m = motions[i];
        fs_pose soon;
        check(fs_motion_at(&m, m.time + 0.03, &soon));
        give(m.name), give(m.primitive), give(m.pose), give(m.twist), give(m.horizon), give(soon);
      }
    } else if (verb == "motions_since") {
      std::vector<fs_motion> motions(100);
      size_t count = 0;
      check(fs_scene_get_motions_since(scene_, client, since_, motions.data(), motions.size(), &count));
      for (size_t i = 0; i < count; ++i) {
        give(motions[i].name), give(motions[i].pose);
        since_ = motions[i].motion_revision;
      }
    } else if (verb == "reports") {
      std::vector<fs_report> reports(100);
      size_t count = 0;
      check(fs_scene_get_reports(scene_, reports.data(), reports.size(), &count));
      std::sort(reports.begin(), reports.begin() + std::ptrdiff_t(count),
                [](const fs_report& a, const fs_report& b) { return std::strcmp(a.name, b.name) < 0; });
      for (size_t i = 0; i < count; ++i) {
        give(reports[i]);
      }
    } else if (verb == "report") {
      fs_report report;
      check(fs_scene_get_report(scene_, name.c_str(), &report));
      give(report);
    } else if (verb == "clear") {
      check(fs_scene_clear(scene_));
    } else if (verb == "accuracy") {
      check(fs_scene_set_accuracy(scene_, step.at("newtons")));
    } else if (verb == "max_stiffness") {
      check(fs_scene_set_max_stiffness(scene_, step.at("stiffness")));
    } else if (verb == "events") {
      std::vector<fs_event> events;
      fs_event event;
      while (check(fs_scene_next_event(scene_, 0, &event)), event.kind != FS_EVENT_NONE) events.push_back(event);
      std::sort(events.begin(), events.end(), [](const fs_event& a, const fs_event& b) {
        return a.kind != b.kind ? a.kind < b.kind : std::strcmp(a.name, b.name) < 0;
      });
      for (const fs_event& e : events) {
        const double value = e.kind == FS_EVENT_CLIENT ? e.value == double(getpid()) : e.value;
        if (!step.value("drain", false)) give(e.kind), give(e.status), give(value), give(e.name), give(e.text);
      }
    } else if (verb == "clients") {
      std::vector<fs_client> clients(100);
      size_t count = 0;
      check(fs_scene_get_clients(scene_, clients.data(), clients.size(), &count));
      for (size_t i = 0; i < count; ++i) {
        const fs_client& c = clients[i];
        give(c.name), give(c.process == uint32_t(getpid())), give(c.objects), give(c.force_limit), give(c.wrench);
        give(double(c.refused)), give(double(c.limited)), give(double(c.shape_bytes));
      }
    } else if (verb == "frame") {
      const fs_frame frame = {pose(step.at("pose")), step.at("scale"), step.at("force_scale"), {}};
      check(fs_scene_set_frame(scene_, &frame));
    } else if (verb == "get_frame") {
      fs_frame frame;
      check(fs_scene_get_frame(scene_, client, &frame));
      fs_pose there, back;
      check(fs_frame_to_device(&frame, &frame.pose, &there));
      check(fs_frame_to_scene(&frame, &there, &back));
      give(frame), give(there), give(back);
    } else if (verb == "points") {
      const auto points = vectors(step.at("points"));
      check(fs_scene_set_tool(scene_, points.data(), points.size()));
    } else if (verb == "radius") {
      check(fs_scene_set_tool_radius(scene_, step.at("radius")));
      double radius;
      check(fs_scene_get_tool_radius(scene_, &radius));
      give(radius);
    } else if (verb == "get_points") {
      fs_vec3 points[FS_TOOL_POINTS_MAX];
      size_t count = 0;
      check(fs_scene_get_tool(scene_, points, FS_TOOL_POINTS_MAX, &count));
      for (size_t i = 0; i < count; ++i) give(points[i]);
    } else if (verb == "clutch") {
      check(fs_scene_set_clutch(scene_, step.at("held")));
    } else if (verb == "view") {
      fs_view view;
      check(fs_scene_get_view(scene_, client, &view));
      give(view);
    } else if (verb == "views") {
      std::vector<fs_client_view> views(100);
      size_t count = 0;
      check(fs_scene_get_views(scene_, views.data(), views.size(), &count));
      for (size_t i = 0; i < count; ++i) give(views[i].name), give(views[i].view);
    } else if (verb == "servo") {
      if (!is_connected_) check(fs_servo_start(scene_, device_, &options_, &servo_));
    } else if (verb == "settle") {
      settle();
    } else if (verb == "enable") {
      check(fs_servo_set_enabled(servo_, step.at("enabled")));
    } else if (verb == "record") {
      std::vector<fs_tick> ticks(10000);
      size_t count = 0;
      check(fs_servo_get_record(servo_, ticks.data(), ticks.size(), &count));
      give(double(count));
      for (size_t i = count - 3; i < count; ++i) {
        const fs_tick& t = ticks[i];
        give(t.state.pose), give(t.response.wrench), give(t.sent), give(t.device), give(t.faults);
      }
    } else if (verb == "scene_record") {
      std::vector<fs_recorded_tick> ticks(10000);
      size_t count = 0;
      check(fs_scene_get_record(scene_, 0, ticks.data(), ticks.size(), &count));
      give(double(count));
      check(fs_scene_get_record(scene_, ticks[count - 1].number - 3, ticks.data(), ticks.size(), &count));
      give(double(count));
      for (size_t i = 0; i < count; ++i) {
        const fs_tick& t = ticks[i].tick;
        give(t.state.pose), give(t.response.wrench), give(t.sent), give(double(ticks[i].number - ticks[0].number));
      }
    } else if (verb == "stats") {
      fs_servo_stats t = fs_servo_stats_init();
      check(fs_scene_get_servo_stats(scene_, &t));
      give(t.realtime), give(t.faults), give(t.protections_off), give(t.max_stiffness), give(t.damping);
      give(double(t.misses)), give(double(t.device_errors)), give(double(t.approximated));
      give(t.enabled), give(t.ticks > 5000), give(t.energy > 0);  // these two depend on when a server took a change
    } else if (verb == "stop_force") {
      check(fs_scene_stop_force(scene_));
    } else if (verb == "resume_force") {
      check(fs_scene_resume_force(scene_));
    } else if (verb == "device") {
      fs_device_info d = fs_device_info_init();
      check(step.contains("opened") ? fs_device_get_info(device_, &d) : fs_scene_get_device_info(scene_, &d));
      give(d.name), give(d.serial), give(d.force_axes), give(d.torque_axes);
      give(d.workspace_radius), give(d.workspace_height), give(d.workspace_angle), give(d.force_max), give(d.torque_max);
      give(d.resolution), give(d.rate), give(d.delay), give(d.damping), give(d.mass);
      give(d.link_rate), give(d.controller_rate), give(d.controller_delay), give(d.controller_damping), give(d.watchdog);
    } else if (verb == "devices") {
      std::vector<fs_device_entry> entries(100);
      size_t count = 0;
      check(fs_device_list(entries.data(), entries.size(), &count));
      for (size_t i = 0; i < count; ++i) {
        if (std::strcmp(entries[i].uri, "sim:") == 0) give(entries[i].label);
      }
    } else if (verb == "device_read") {
      fs_state state;
      check(fs_device_read(device_, &state));
      give(state.pose), give(state.flags);
    } else if (verb == "device_write") {
      const fs_wrench wrench = {vector(step.at("force")), {0, 0, 0}};
      check(fs_device_write(device_, &wrench));
    } else if (verb == "device_control") {
      fs_answer answer;
      check(fs_device_control(device_, step.at("request").get<std::string>().c_str(), &answer));
      give(answer.text);
    } else if (verb == "drivers") {
      std::vector<fs_driver_info> drivers(100);
      size_t count = 0;
      check(fs_driver_list(drivers.data(), drivers.size(), &count));
      for (size_t i = 0; i < count; ++i) {
        if (std::strcmp(drivers[i].scheme, "sim") == 0) give(drivers[i].path), give(drivers[i].trouble);
      }
    } else if (verb == "state_reason") {
      give(fs_state_reason(step.at("flags").get<uint32_t>()));
    } else if (verb == "driver") {
      check(fs_driver_load(step.at("file").get<std::string>().c_str()));
    } else if (verb == "hand") {
      fs_state state;
      fs_response response;
      fs_wrench sent;
      check(fs_scene_get_hand(scene_, &state, &response, &sent));
      give(state.pose), give(response.wrench), give(sent);
    } else if (verb == "save") {
      check(fs_scene_save(scene_, (folder_ + "/" + step.at("file").get<std::string>()).c_str()));
    } else if (verb == "load") {
      check(fs_scene_load(scene_, (folder_ + "/" + step.at("file").get<std::string>()).c_str()));
    } else {
      std::fprintf(stderr, "there is no verb %s\n", verb.c_str());
      std::exit(2);
    }
  }

  const bool is_connected_;
  const std::string folder_;
  const std::vector<fs_vec3> places_;
  fs_scene *base_ = nullptr, *scene_ = nullptr;  // of the servo; that the steps are about
  uint64_t since_ = 0;
  fs_scene* other_ = nullptr;                    // connected: of another client
  fs_device* device_ = nullptr;
  fs_servo_options options_ = fs_servo_options_init();
  fs_servo* servo_ = nullptr;
  fs_server* server_ = nullptr;
  std::map<std::string, fs_shape*> shapes_;
  std::map<std::string, fs_curve*> curves_;
  std::map<std::string, fs_surface*> surfaces_;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  std::ifstream file(argv[1]);
  const json scenario = json::parse(file);
  try {
    Player(scenario, std::string(argv[2]) == "connected", argv[3]).play(scenario.at("steps"));
  } catch (const Failure&) {
    std::fprintf(stderr, "parity_player: %s\n", fs_last_error());
    return 1;
  }
}
