// Why one of the random scenes oscillates: which objects it takes, and what they do.
#include <algorithm>
#include <map>

#include "measure.h"
#include "random_scenes.h"
#include "stability.h"

namespace stability {

using namespace scenes;

namespace {

std::string described(const char* side, const fs_profile& p) {
  if (p.kind == FS_PROFILE_NONE) return "";
  return format("; %s%s %s, gain %.4g, offset %.4g, width %.4g, limit %.4g", side, fs_profile_kind_name(p.kind),
                p.sense == FS_SENSE_ATTRACTIVE ? "attracts" : "repels", p.gain, p.offset, p.width, p.limit);
}

std::string described(const fs_object& o) {
  std::string out = format("%s: %s", o.name, fs_primitive_name(o.primitive));
  out += described("front ", o.front) + described("back ", o.back);
  if (o.damping > 0) out += format("; damping %.3g", o.damping);
  if (o.contact.keep != FS_KEEP_NONE) {
    out += format("; solid (keep %d), %.4g N/m, %.3g N, %.3g N s/m, friction %.2g", static_cast<int>(o.contact.keep),
                  o.contact.stiffness, o.contact.limit, o.contact.damping, o.contact.friction);
  }
  if (o.shape) {
    fs_shape_info info = fs_shape_info_init();
    require(fs_shape_get_info(o.shape, &info), "fs_shape_get_info");
    const fs_vec3 size = info.upper - info.lower;
    out += format("; %.3g x %.3g x %.3g m", size.x, size.y, size.z);
  }
  return out;
}

// What an object did in the late window, at the device.
struct Seen {
  double wanted = 0, applied = 0;                // N/m
  double nearest = 1e300, farthest = 0;          // m
  double greatest_step = 0, way_of_step = 0;     // N in a tick; m that the hand moved then
  Span force;                                    // N
  fs_vec3 last{};
};

// Looks at each object of a scene, at each tick of the late window.
class Watch {
 public:
  Watch(Report& report, double from) : report_(report), from_(from) {}

  void look(fs_scene* scene, double t) {
    if (t < from_ || t > from_ + 1) return;
    fs_frame frame = fs_frame_init();
    require(fs_scene_get_frame(scene, nullptr, &frame), "fs_scene_get_frame");
    fs_state hand;
    require(fs_scene_get_hand(scene, &hand, nullptr, nullptr), "fs_scene_get_hand");
    const fs_vec3 x = (1 / frame.scale) * hand.pose.position;
    fs_report reports[16];
    size_t count = 0;
    require(fs_scene_get_reports(scene, reports, 16, &count), "fs_scene_get_reports");
    for (size_t i = 0; i < count; ++i) {
      const fs_report& r = reports[i];
      const bool is_new = !seen_.count(r.name);
      if (is_new) tell(scene, r.name);
      Seen& o = seen_[r.name];
      const fs_vec3 force = frame.force_scale * r.wrench.force;
      const double distance = r.distance / frame.scale;
      o.wanted = r.stiffness_wanted, o.applied = r.stiffness_applied;
      o.nearest = std::min(o.nearest, distance), o.farthest = std::max(o.farthest, distance);
      if (!is_new && norm(force - o.last) > o.greatest_step) {
        o.greatest_step = norm(force - o.last), o.way_of_step = norm(x - last_);
      }
      o.force.add(force);
      o.last = force;
    }
    last_ = x;
  }
  void tell() const {
    for (const auto& [name, o] : seen_) {
      report_.note(format("%s: %.0f of %.0f N/m; %.3f to %.3f mm away; its force changes by %.2f N, in a tick by %.3f N while the "
                          "hand moves %.4f mm", name.c_str(), o.applied, o.wanted, 1e3 * o.nearest, 1e3 * o.farthest,
                          o.force.length(), o.greatest_step, 1e3 * o.way_of_step));
    }
  }

 private:
  void tell(fs_scene* scene, const char* name) {
    fs_object object = fs_object_init("", FS_PRIMITIVE_POINT);
    require(fs_object_get(scene, name, &object), "fs_object_get");
    report_.note(described(object));
    fs_object_release(&object);
  }

  Report& report_;
  double from_;
  std::map<std::string, Seen> seen_;
  fs_vec3 last_{};
};

void explain_link(Report& report, uint64_t seed) {
  report.title(format("link %zu: %s", static_cast<size_t>(seed), link_of(seed).c_str()));
  const Outcome o = run_link(seed);
  report.note(format("%s, %.2f mm", o.is_bad() ? "oscillates" : "rests", 1e3 * o.swing));
  uint32_t left_out = 0;
  for (uint32_t object = 0; object < 6; ++object) {
    if (run_link(seed, left_out | 1u << object).is_bad()) left_out |= 1u << object;
  }
  Watch watch(report, 4.5);
  run_link(seed, left_out, [&](fs_scene* scene, double t) { watch.look(scene, t); });
  watch.tell();
}

}  // namespace

void explain(Report& report, uint64_t seed, const std::string& hand) {
  if (hand == "link") return explain_link(report, seed);
  Situation s = any_situation(seed);
  for (const HandModel& model : hands) {
    if (hand == model.name) s = simple_situation(seed, model);
  }
  report.title(format("number %zu: %s", static_cast<size_t>(seed), described(s).c_str()));
  double bound = 0;
  const auto tell = [&](const char* what, const Situation& of, const fs_servo_options& options) {
    const Outcome o = run(of, options, [&](Rig& rig, double t) { if (t > 1 && bound == 0) bound = rig.stats().max_stiffness; });
    report.note(format("%s: %s, %.2f mm%s", what, o.oscillates ? "oscillates" : "rests", 1e3 * o.swing,
                       o.is_flung ? ", driven away" : o.faults ? ", fault" : ""));
  };
  fs_servo_options options = default_options();
  tell("as it is", s, options);
  options.max_stiffness = bound / 2;
  tell(format("half of the stiffness of %.0f N/m", bound).c_str(), s, options);
  for (const double friction : {0.0, 1.0}) {
    Situation other = s;
    other.device.friction = friction;
    tell(format("friction of %.0f N", friction).c_str(), other, default_options());
  }
  Situation exact = s;
  exact.device.encoder = 0;
  tell("exact encoder", exact, default_options());
  for (uint32_t object = 0; object < 6; ++object) {  // without each object that it does not take
    Situation other = s;
    other.left_out |= 1u << object;
    if (run(other, default_options()).is_bad()) s = other;
  }
  Watch watch(report, s.late);
  run(s, default_options(), [&](Rig& rig, double t) { watch.look(rig.scene.get(), t); });
  watch.tell();
}

}  // namespace stability
