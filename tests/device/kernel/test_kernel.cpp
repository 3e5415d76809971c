// The drivers falcon and fidel through the public C ABI, with the kernel's own USB stack, usbfs, udev and libusb. Function, not
// timing: an emulated machine is slow.
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <sstream>

#include "api/support.h"
#include "device/kernel/guest.h"
#include "device/kernel/loop_model.h"
#include "device/kernel/serve.h"
#include "device/usb/falcon_model.h"
#include "device/usb/fidel_model.h"

using namespace scenes;

namespace {

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// A Falcon and a FIDEL under the same names. force: N, of the motors on the handle, at this moment, also when no host is there.
struct Falcon : Served<FalconModel> {
  static constexpr const char* uri = "falcon:0";
  explicit Falcon(const char* serial, bool has_firmware = true) : Served<FalconModel>(serial) {
    change([has_firmware](FalconModel& model) { model.has_firmware = has_firmware; });
  }
  double force() {
    return see([](FalconModel& model) {
      std::vector<uint8_t> data;
      model.in(0x81, 64, data, now());
      return norm(model.force());
    });
  }
  bool has_command() {  // a force is wanted by the newest command, no matter how old that is
    return see([](FalconModel& model) { return model.motors != std::array<int, 3>{}; });
  }
};
struct Fidel : Served<FidelModel> {
  static constexpr const char* uri = "fidel:usb";
  explicit Fidel(const char* serial) : Served<FidelModel>(FidelOptions{.serial = serial}) {}
  double force() {
    return see([](FidelModel& model) {
      model.advance(now());
      return norm(model.body().force);
    });
  }
  bool has_command() {
    return see([](FidelModel& model) {
      const auto& wanted = model.body().firmware.wanted;
      return std::any_of(std::begin(wanted), std::end(wanted), [](int32_t torque) { return torque != 0; });
    });
  }
};

// A spring that draws the handle aside.
struct Drawing {
  Scene scene = make_scene();
  Device device;
  Servo servo;

  explicit Drawing(const char* uri) : device(open_device(uri)) {
    fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
    spring.pose = at({0.03, 0, 0});
    spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 50, 0, 2);
    require(fs_object_set(scene.get(), &spring), "fs_object_set");
    fs_servo_options options = fs_servo_options_init();
    options.rate = 200;
    options.ramp = 0.1;
    options.speed_limit = -1;
    servo = start_servo(scene.get(), device.get(), options);
  }
  // Late ticks may have held the force: this is no test of time.
  uint32_t faults() {
    const uint32_t faults = stats_of(scene.get()).faults;
    if (faults & FS_FAULT_LATE) fs_servo_set_enabled(servo.get(), true);
    return faults;
  }
  // When not, it says what the servo and the device say.
  template <class Kind>
  bool is_felt(Kind& kind) {
    if (until([&] { return faults() == 0 && kind.force() > 0.2; })) return true;
    fs_answer answer{};
    const fs_status status = fs_device_control(device.get(), "status", &answer);
    std::printf("not felt: %g N, the servo's faults %x; status: %s\n", kind.force(), faults(), status == FS_OK ? answer.text : fs_last_error());
    std::fflush(stdout);
    return false;
  }
  bool is_told(const char* word) {
    return until([&] {
      fs_event event;
      while (fs_scene_next_event(scene.get(), 0, &event) == FS_OK && event.kind != FS_EVENT_NONE) {
        if (event.kind == FS_EVENT_DEVICE && std::strstr(event.text, word)) return true;
      }
      return false;
    });
  }
};

bool is_ready(fs_device* device) {
  fs_state state{};
  return fs_device_read(device, &state) == FS_OK && state.flags == FS_STATE_READY;
}

fs_vec3 position_of(fs_device* device) {
  fs_state state{};
  fs_device_read(device, &state);
  return state.pose.position;
}

// From plugging in to closing. The tests are the same for both kinds.
template <class Kind>
void plugged_felt_and_closed(const char* serial) {
  Kind kind(serial);
  kind.plug();
  await_node(serial);
  {
    Drawing drawing(Kind::uri);
    fs_device_info info = fs_device_info_init();
    OK(fs_device_get_info(drawing.device.get(), &info));
    ck_assert_str_eq(info.serial, serial);
    ck_assert(drawing.is_felt(kind));
  }
  ck_assert(!kind.has_command());
  ck_assert(kind.force() == 0);
  const Device again = open_device(Kind::uri);  // it was given back
  ck_assert(until([&] { return is_ready(again.get()); }));
}

template <class Kind>
void unplugged_and_back() {
  Kind kind("K1"), other("K2");
  kind.plug();
  await_node("K1");
  Drawing drawing(Kind::uri);
  ck_assert(drawing.is_felt(kind));

  kind.unplug();  // in the middle of a transfer, as two always wait
  ck_assert(until([&] { return (drawing.faults() & FS_FAULT_DEVICE) != 0; }));
  ck_assert(until([&] { return kind.force() == 0; }));
  fs_answer answer;
  ck_assert(until([&] { return fs_device_control(drawing.device.get(), "status", &answer) == FS_ERROR_DISCONNECTED; }));
  ck_assert(drawing.is_told("lost"));

  kind.plug();
  ck_assert(drawing.is_felt(kind));
  ck_assert(drawing.is_told("ready"));
  kind.unplug();
  ck_assert(drawing.is_told("lost"));

  other.plug();
  ck_assert(until([&] {
    return fs_device_control(drawing.device.get(), "status", &answer) == FS_ERROR_DISCONNECTED && std::strstr(fs_last_error(), "'K2'");
  }));
  ck_assert(other.force() == 0);
  other.unplug();
  kind.plug();
  ck_assert(drawing.is_felt(kind));
}

template <class Kind>
void refused_without_permission() {
  Kind kind("K1");
  kind.plug();
  const std::string node = await_node("K1");
  ck_assert_int_eq(chmod(node.c_str(), 0600), 0);
  ck_assert(as_user([&] {
    fs_device* device = nullptr;
    EXPECT_SENTENCE(FS_ERROR_DENIED, fs_device_open(Kind::uri, &device), node.c_str());
    EXPECT_SENTENCE(FS_ERROR_DENIED, fs_device_open(Kind::uri, &device), "60-forceserver.rules");
  }));
  ck_assert_int_eq(chmod(node.c_str(), 0666), 0);
  ck_assert(as_user([&] {
    const Device device = open_device(Kind::uri);
    ck_assert(until([&] { return is_ready(device.get()); }));
  }));
}

// The kernel takes the device away from a process that is killed, and the device's own watchdog ends the force.
template <class Kind>
void killed() {
  Kind kind("K1");
  kind.plug();
  await_node("K1");
  const pid_t host = fork();
  if (host == 0) {
    const Drawing drawing(Kind::uri);
    for (;;) pause();
  }
  ck_assert(until([&] { return kind.force() > 0.2; }));
  ck_assert_int_eq(::kill(host, SIGKILL), 0);
  ck_assert_int_eq(waitpid(host, nullptr, 0), host);
  ck_assert(until([&] { return kind.force() == 0; }));
  Drawing drawing(Kind::uri);
  ck_assert(drawing.is_felt(kind));
}

START_TEST(falcon_is_felt) { plugged_felt_and_closed<Falcon>("K1"); }
END_TEST
START_TEST(fidel_is_felt) { plugged_felt_and_closed<Fidel>("K1"); }
END_TEST
START_TEST(falcon_is_unplugged_and_comes_back) { unplugged_and_back<Falcon>(); }
END_TEST
START_TEST(fidel_is_unplugged_and_comes_back) { unplugged_and_back<Fidel>(); }
END_TEST
START_TEST(falcon_is_refused_without_permission) { refused_without_permission<Falcon>(); }
END_TEST
START_TEST(fidel_is_refused_without_permission) { refused_without_permission<Fidel>(); }
END_TEST
START_TEST(a_program_with_a_falcon_is_killed) { killed<Falcon>(); }
END_TEST
START_TEST(a_program_with_a_fidel_is_killed) { killed<Fidel>(); }
END_TEST

START_TEST(a_falcon_is_given_its_firmware) {
  Falcon falcon("K1", false);
  falcon.plug();
  await_node("K1");
  std::vector<char> image(2000);
  for (size_t i = 0; i < image.size(); ++i) image[i] = char(i * i + i / 7);
  std::ofstream("/tmp/image", std::ios::binary).write(image.data(), std::streamsize(image.size()));
  falcon.change([](FalconModel& model) {
    for (size_t i = 0; i < 2000; ++i) model.firmware.push_back(uint8_t(i * i + i / 7));
  });
  const Device device = open_device("falcon:0?firmware=/tmp/image");
  ck_assert(falcon.see([](FalconModel& model) { return model.has_firmware; }));
  ck_assert(until([&] { return is_ready(device.get()); }));  // the model homes itself when it is asked to
}
END_TEST

START_TEST(positions_come) {
  Falcon falcon("K1");
  Fidel fidel("K2");
  falcon.plug();
  fidel.plug();
  await_node("K1");
  await_node("K2");
  falcon.change([](FalconModel& model) { model.target = {0.01, 0, 0.125}; });
  fidel.change([](FidelModel& model) { model.body().target = {0.02, -0.03, 0.01}; });
  const Device a = open_device("falcon:K1"), b = open_device("fidel:usb:K2");
  ck_assert(until([&] { return is_ready(a.get()) && norm(position_of(a.get()) - fs_vec3{0.01, 0, 0}) < 5e-4; }));
  ck_assert(until([&] { return is_ready(b.get()) && norm(position_of(b.get()) - fs_vec3{0.02, -0.03, 0.01}) < 5e-4; }));
}
END_TEST

START_TEST(two_of_a_kind_at_once) {
  Fidel one("K1"), two("K2");
  one.plug();
  two.plug();
  await_node("K1");
  await_node("K2");
  Drawing first("fidel:usb:K1");
  const Device second = open_device("fidel:usb:K2");
  ck_assert(first.is_felt(one));
  ck_assert(until([&] { return is_ready(second.get()); }));
  ck_assert(two.force() == 0);
  two.unplug();
  fs_state state{};
  ck_assert(until([&] { return fs_device_read(second.get(), &state) == FS_ERROR_DISCONNECTED; }));
  ck_assert(first.is_felt(one));
}
END_TEST

START_TEST(a_device_in_use_says_by_whom) {
  Falcon falcon("K1");
  falcon.plug();
  await_node("K1");
  const Device device = open_device("falcon:0");
  const std::string pid = "(pid " + std::to_string(getpid()) + ")";
  ck_assert(as_user([&] {
    fs_device* second = nullptr;
    EXPECT_SENTENCE(FS_ERROR_DENIED, fs_device_open("falcon:0", &second), "60-forceserver.rules");
  }));
  fs_device* second = nullptr;
  EXPECT_SENTENCE(FS_ERROR_IO, fs_device_open("falcon:0", &second), pid.c_str());
}
END_TEST

// What udevd says of a device, as KEY=VALUE lines.
std::string udev_of(const std::string& node) {
  const std::string command = "udevadm info --query=property --name=" + node + " > /tmp/udev";
  ck_assert_int_eq(std::system(command.c_str()), 0);
  std::ostringstream text;
  text << std::ifstream("/tmp/udev").rdbuf();
  return text.str();
}

// The guest has the rules that are installed with the library.
START_TEST(rules_mean_the_devices) {
  Falcon falcon("K1");
  Fidel fidel("K2");
  Served<LoopModel> loop("K3");  // has the numbers of a FIDEL
  falcon.plug();
  fidel.plug();
  loop.plug();
  for (const char* serial : {"K1", "K2", "K3"}) {
    const std::string text = udev_of(await_node(serial));
    const bool is_tagged = text.find(":uaccess:") != std::string::npos;
    ck_assert_msg(is_tagged == (std::string(serial) != "K3"), "%s: %s", serial, text.c_str());
  }
  fs_device* device = nullptr;
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("fidel:usb:K3", &device), "K2");
}
END_TEST

}  // namespace

int main() {
  return run_cases("kernel", {falcon_is_felt, fidel_is_felt, positions_come, a_falcon_is_given_its_firmware, two_of_a_kind_at_once,
                              falcon_is_unplugged_and_comes_back, fidel_is_unplugged_and_comes_back,
                              falcon_is_refused_without_permission, fidel_is_refused_without_permission, a_program_with_a_falcon_is_killed,
                              a_program_with_a_fidel_is_killed, a_device_in_use_says_by_whom, rules_mean_the_devices});
}
