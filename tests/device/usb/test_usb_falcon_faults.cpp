// What may go wrong with a Falcon while it is opened, and while a servo pushes the hand that holds it: the hand feels 0 soon, and when
// the trouble has gone, the force comes back through READY.
#include <cmath>
#include <functional>
#include <vector>

#include "device/usb/falcon_rig.h"

using namespace scenes;

namespace {

bool pushes(const FalconRig& rig) { return rig.push() > 0.5; }

// How long the hand felt a force after the trouble began, as the Falcon saw it (s). Waits until there is none.
double felt_after(const FalconRig& rig, double begin) {
  ck_assert(until([&] { return rig.push() == 0; }));
  return rig.see([](FalconModel& model) { return model.last_force_time; }) - begin;
}

double time_of(const FalconRig& rig) { return rig.see([](FalconModel& model) { return model.time(); }); }

// A busy machine may need longer than 20 ms; the Falcon's own watchdog is 20 ms.
constexpr double soon = 0.5;  // s

struct Trouble {
  const char* name;
  std::function<void(FalconRig&)> begin, end;
};

void endure(const Trouble& trouble, double lasting) {
  FalconRig rig;
  const Device device = open_device("falcon:0");
  Pushing pushing(device.get(), {0.01, 0, 0});
  ck_assert(until([&] { return pushes(rig); }));
  const double begin = time_of(rig);
  trouble.begin(rig);
  const double felt = felt_after(rig, begin);
  std::this_thread::sleep_for(std::chrono::duration<double>(lasting));
  ck_assert_msg(rig.push() == 0, "%s: a force of %g N", trouble.name, rig.push());
  rig.change([](FalconModel& model) { model.most_motor = 0; });
  trouble.end(rig);
  const bool is_back = until([&] { return pushes(rig); });
  ck_assert_msg(is_back, "%s: no force came back", trouble.name);
  std::printf("  %-30s %3g s: felt for %5.1f ms\n", trouble.name, lasting, 1e3 * felt);
  ck_assert_msg(felt < soon, "%s: felt for %g s", trouble.name, felt);
}

const std::vector<Trouble>& troubles() {
  const auto none = [](FalconRig& rig) { rig.fault(UsbFault::none); };
  static const std::vector<Trouble> all{
      {"reports stall", [](FalconRig& rig) { rig.fault(UsbFault::stall); }, none},
      {"errors on the bus", [](FalconRig& rig) { rig.fault(UsbFault::error); }, none},
      {"reports that are too long", [](FalconRig& rig) { rig.fault(UsbFault::overlong); }, none},
      {"reports that are cut", [](FalconRig& rig) { rig.fault(UsbFault::shortened); }, none},
      {"garbage", [](FalconRig& rig) { rig.fault(UsbFault::garbage); }, none},
      {"no transfer comes", [](FalconRig& rig) { rig.fault(UsbFault::silence); }, none},
      {"the Falcon is silent", [](FalconRig& rig) { rig.change([](FalconModel& m) { m.answers = false; }); },
       [](FalconRig& rig) { rig.change([](FalconModel& m) { m.answers = true; }); }},
      {"commands stall", [](FalconRig& rig) { rig.fault(UsbFault::none, UsbFault::stall); }, none},
      {"commands fail", [](FalconRig& rig) { rig.fault(UsbFault::none, UsbFault::error); }, none},
      {"commands are not taken", [](FalconRig& rig) { rig.fault(UsbFault::none, UsbFault::silence); }, none},
      {"all stalls", [](FalconRig& rig) { rig.fault(UsbFault::stall, UsbFault::stall, UsbFault::stall); }, none},
      {"nothing works", [](FalconRig& rig) { rig.fault(UsbFault::silence, UsbFault::silence, UsbFault::silence); }, none},
      {"it is no longer homed",
       [](FalconRig& rig) { rig.change([](FalconModel& m) { m.is_homed = m.homes_when_asked = false; }); },
       [](FalconRig& rig) { rig.change([](FalconModel& m) { m.homes_when_asked = true; }); }},
  };
  return all;
}

}  // namespace

// For a moment, and so long that the driver opens the device again.
START_TEST(troubles_of_a_moment) { endure(troubles()[static_cast<size_t>(_i)], 0.05); }
END_TEST
START_TEST(troubles_that_last) { endure(troubles()[static_cast<size_t>(_i)], 1.5); }
END_TEST

START_TEST(an_encoder_that_jumps) {
  FalconRig rig;
  const Device device = open_device("falcon:0");
  Pushing pushing(device.get(), {0.01, 0, 0});
  ck_assert(until([&] { return pushes(rig); }));
  double begin = time_of(rig);
  rig.change([](FalconModel& model) { model.encoder_offset = {0, 600, 0}; });
  std::printf("  a jump: felt for %.1f ms\n", 1e3 * felt_after(rig, begin));
  ck_assert(until([&] { return rig.see([](FalconModel& model) { return model.lights; }) == 8; }));  // blue
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  ck_assert_double_eq(rig.push(), 0);
  fs_answer answer;
  OK(fs_device_control(device.get(), "status", &answer));
  ck_assert_msg(std::strstr(answer.text, "an encoder has jumped") == answer.text, "%s", answer.text);
  OK(fs_device_control(device.get(), "home", &answer));
  rig.change([](FalconModel& model) { model.encoder_offset = {}; });  // homing finds the origin
  ck_assert(until([&] { return pushes(rig); }));
}
END_TEST

// It stands still while the hand goes on.
START_TEST(an_encoder_that_is_stuck) {
  FalconRig rig;
  rig.change([](FalconModel& model) {
    model.hand_stiffness = 2000;
    model.hand_damping = 30;
  });
  const Device device = open_device("falcon:0");
  ck_assert(until([&] { return is_ready(device.get()); }));
  rig.change([](FalconModel& model) { model.is_encoder_stuck = {false, true, false}; });
  ck_assert(until([&] {
    rig.change([](FalconModel& model) { model.target.z = model.target.z > 0.125 ? 0.100 : 0.150; });
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    return !is_ready(device.get());
  }));
  // It moves again, from where it was: it has lost counts.
  rig.change([](FalconModel& model) {
    model.is_encoder_stuck = {};
    model.target = {0, 0, 0.125};
  });
  fs_answer answer;
  OK(fs_device_control(device.get(), "home", &answer));
  ck_assert(until([&] { return is_ready(device.get()); }));
}
END_TEST

// ------------------------------------------------------------------------------------------------------------------ unplugged

namespace {

// Opens the device while it is unplugged; any status but OK, or a device that is lost at once, is right; then it is there again.
void unplug_while_opening(UsbMoment moment, uint64_t count, Unplug how) {
  FalconRig rig;
  rig.bus.unplug_at(1, moment, count, how);
  fs_device* raw = nullptr;
  const fs_status status = fs_device_open("falcon:0", &raw);
  if (status == FS_OK) {
    const Device device(raw);
    ck_assert(until([&] { return !rig.bus.is_plugged(1); }));
    fs_state state{};
    ck_assert(until([&] { return fs_device_read(device.get(), &state) == FS_ERROR_DISCONNECTED; }));
  } else {
    ck_assert_msg(status == FS_ERROR_DISCONNECTED || status == FS_ERROR_NOT_FOUND || status == FS_ERROR_IO, "%s: %s",
                  fs_status_name(status), fs_last_error());
    if (how == Unplug::in_flight && count < 3) std::printf("  %s\n", fs_last_error());
  }
  ck_assert(until([&] { return rig.bus.counts(1).open_now == 0; }));
  rig.bus.plug(1, rig.falcon);
  const Device device = open_device("falcon:0");
  ck_assert(until([&] { return is_ready(device.get()); }));
}

}  // namespace

START_TEST(unplugged_while_it_is_opened) {
  for (const Unplug how : {Unplug::in_flight, Unplug::between}) {
    unplug_while_opening(UsbMoment::open, 1, how);
    unplug_while_opening(UsbMoment::claim, 1, how);
  }
}
END_TEST
START_TEST(unplugged_while_it_is_set_up) {
  for (const Unplug how : {Unplug::in_flight, Unplug::between}) {
    for (uint64_t i = 1; i <= 6; ++i) unplug_while_opening(UsbMoment::control, i, how);
    for (uint64_t i = 1; i <= 3; ++i) unplug_while_opening(UsbMoment::out, i, how);
    for (uint64_t i = 1; i <= 4; ++i) unplug_while_opening(UsbMoment::in, i, how);
  }
}
END_TEST

// While it pushes; the same device comes back in the same handle.
START_TEST(unplugged_while_it_pushes) {
  FalconRig rig;
  const Device device = open_device("falcon:0");
  Pushing pushing(device.get(), {0.01, 0, 0});
  const auto recover = [&](const char* what) {
    ck_assert(until([&] { return !rig.bus.is_plugged(1) && pushing.event_with("lost"); }));
    ck_assert(until([&] { return rig.bus.counts(1).open_now == 0; }));
    const double begin = now_s();
    rig.change([](FalconModel& model) { model.rest(); });
    rig.bus.plug(1, rig.falcon);
    ck_assert(until([&] { return pushes(rig); }));
    std::printf("  %s: pushes again %.2f s after it was plugged in\n", what, now_s() - begin);
  };
  for (const Unplug how : {Unplug::in_flight, Unplug::between}) {
    for (const UsbMoment moment : {UsbMoment::in, UsbMoment::out}) {
      for (const uint64_t count : {1, 2}) {
        ck_assert(until([&] { return pushes(rig); }));
        rig.bus.unplug_at(1, moment, count, how);
        recover(moment == UsbMoment::in ? "a report" : "a command");
      }
    }
    ck_assert(until([&] { return pushes(rig); }));
    rig.bus.unplug(1, how);
    recover("at any moment");
  }
}
END_TEST

START_TEST(another_one_is_refused) {
  FalconRig rig;
  const Device device = open_device("falcon:0");
  Pushing pushing(device.get(), {0.01, 0, 0});
  ck_assert(until([&] { return pushes(rig); }));
  rig.bus.unplug(1, Unplug::in_flight);
  ck_assert(until([&] { return rig.bus.counts(1).open_now == 0; }));
  const uint64_t opens = rig.bus.counts(1).opens;
  const auto other = FalconRig::made("B2");
  rig.bus.plug(1, other);
  // It was opened and closed; the event tells what is known when it is asked for.
  ck_assert(until([&] { return rig.bus.counts(1).opens > opens && rig.bus.counts(1).open_now == 0; }));
  ck_assert(until([&] { return rig.bus.counts(1).opens > opens + 1; }));
  ck_assert(pushing.event_with("another device is there: Novint Falcon, serial 'B2'"));
  rig.bus.with_models([&] { ck_assert_int_eq(other->most_motor, 0); });
  rig.bus.unplug(1, Unplug::between);
  ck_assert(until([&] { return rig.bus.counts(1).open_now == 0; }));
  rig.change([](FalconModel& model) { model.rest(); });
  rig.bus.plug(1, rig.falcon);
  ck_assert(until([&] { return pushes(rig); }));
}
END_TEST

START_TEST(two_at_once) {
  FalconRig rig;
  const auto other = FalconRig::made("B2");
  rig.bus.plug(2, other);
  const Device one = open_device("falcon:A1"), two = open_device("falcon:1");
  fs_device_info info = fs_device_info_init();
  OK(fs_device_get_info(two.get(), &info));
  ck_assert_str_eq(info.serial, "B2");
  Pushing right(one.get(), {0.01, 0, 0}), up(two.get(), {0, 0, 0.01});
  const auto force_of_other = [&] {
    fs_vec3 force{};
    rig.bus.with_models([&] { force = other->force(); });
    return force;
  };
  const auto both_push = [&] {
    const fs_vec3 first = rig.see([](FalconModel& model) { return model.force(); }), second = force_of_other();
    return first.x > 0.5 && std::fabs(first.y) < 0.2 && second.y > 0.5 && std::fabs(second.x) < 0.2;
  };
  ck_assert(until(both_push));
  rig.bus.unplug(1, Unplug::in_flight);
  ck_assert(until([&] { return right.event_with("lost"); }));
  uint64_t before = 0;
  rig.bus.with_models([&] { before = other->commands; });
  ck_assert(until([&] {
    uint64_t commands = 0;
    rig.bus.with_models([&] { commands = other->commands; });
    return commands > before + 100;
  }));
  ck_assert_double_gt(force_of_other().y, 0.5);
  rig.change([](FalconModel& model) { model.rest(); });
  rig.bus.plug(1, rig.falcon);
  ck_assert(until(both_push));
}
END_TEST

// What is cancelled does not come back: the device is closed all the same, within some seconds.
START_TEST(a_close_that_hangs) {
  FalconRig rig;
  UsbFaults faults;
  {
    const Device device = open_device("falcon:0");
    ck_assert(until([&] { return is_ready(device.get()); }));
    faults.in = UsbFault::silence;
    faults.is_stuck = true;
    rig.bus.set(1, faults);
  }
  faults = {};
  rig.bus.set(1, faults);
}
END_TEST

// A process that is killed sends nothing any more: the Falcon's own watchdog ends its force.
START_TEST(reports_are_asked_for_while_nobody_has_a_servo) {
  FalconRig rig;
  const Device device = open_device("falcon:0");
  const uint64_t before = rig.see([](FalconModel& model) { return model.commands; });
  ck_assert(until([&] { return rig.see([](FalconModel& model) { return model.commands; }) > before + 100; }));
}
END_TEST

int main() {
  require(fs_driver_load(FALCON_MODULE), "fs_driver_load");
  Suite* suite = suite_create("usb_falcon_faults");
  TCase* looped = tcase_create("troubles");
  tcase_set_timeout(looped, 200);
  tcase_add_loop_test(looped, troubles_of_a_moment, 0, static_cast<int>(troubles().size()));
  tcase_add_loop_test(looped, troubles_that_last, 0, static_cast<int>(troubles().size()));
  suite_add_tcase(suite, looped);
  add_case(suite, "encoders", {an_encoder_that_jumps, an_encoder_that_is_stuck});
  add_case(suite, "unplugged",
           {unplugged_while_it_is_opened, unplugged_while_it_is_set_up, unplugged_while_it_pushes, another_one_is_refused, two_at_once,
            a_close_that_hangs, reports_are_asked_for_while_nobody_has_a_servo});
  return run_suite(suite);
}
