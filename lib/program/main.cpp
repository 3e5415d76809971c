#include <cstdio>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>

#include "arguments.h"
#include "complete.h"
#include "program.h"
#include "words.h"

namespace {

const char* const run_help = R"(examples:
  forceserver run room.json
      the scene with a simulated device and hand, until Ctrl-C
  forceserver run --listen lab
      a server without a scene of its own: other programs connect to it (fs_scene_connect), each with its scene; see
      also `forceserver watch lab`
  forceserver run room.json --device 'sim:?path=figure8' --duration 10 --record ticks.csv
      ten seconds with a hand that draws an eight; every tick goes to a file
  forceserver run room.json --driver ./libmine.so --device mine:0
      a device of your own, whose driver (driver.h) is in a shared library
  sudo forceserver run room.json --rate 4000
      four thousand ticks a second; root is granted a real-time priority

The columns of the record: time (s), the pose (m; w, x, y, z), the force as evaluated and as sent after all
protections (N), how late the tick began and how long it took (s), the faults, the torque as evaluated and as sent
(N m), and the buttons (bit i: button i is down). Positions, forces and torques are in the device's frame.

A fault ends the force. If the device was lost, the force returns when the device does; after any other fault it returns
by `forceserver resume NAME` for a server, or when you start again. Ends with 1 after any fault, and if the hand chattered.)";

const char* const clients_help = R"(examples:
  forceserver clients lab
      the clients of the server that was started by `forceserver run --listen lab`
  forceserver clients 'lab?user=anna' --json
      those of another user's server that lets in all users, as one JSON document, in SI units

For each client it counts, since the client connected: the moves of its objects, its other changes that the server
applied, those that it refused, and the ticks in which the limit on a client's force bounded its force. The client that
asks is left out. Ends with 1 if the server ends meanwhile.)";

const char* const watch_help = R"(examples:
  forceserver watch lab
      the server called lab, twice a second until Ctrl-C; on a terminal each output replaces the one before
  forceserver watch lab --interval 5 > log.txt
      an output every five seconds, one below the other
  forceserver watch lab --json --interval 0.1 --count 100 > looks.jsonl
      ten seconds, one JSON object per line, in SI units; a number that is not finite is null
  forceserver watch 'lab?user=anna'
      another user's server that lets in all users

Positions and distances are the device's; `distance` is measured from the nearest point of the tool. The rate (Hz)
and the lateness are those of the last 10 s; the missed ticks, the moves and the changes are those since the previous
look. `refused` and `limited` are totals since the client connected: of its changes that the server refused, and of the
ticks in which the limit on its force bounded its force. A slope "400 of 800" is capped: 800 N/m are wanted, 400 N/m
are felt. The force of clients that have gone stays in the force on the hand until it has faded, but no line shows it;
nor does one show the damping of the servo itself.

It does not wait for a server to start, unless the name has a timeout, in seconds: 'lab?timeout=5'. Ends with 1 when the
server ends, with 0 on Ctrl-C; while it waits for the server, Ctrl-C ends it at once.)";

const char* const stop_help = R"(examples:
  forceserver stop lab
      the force at the server called lab ends at once, as by the stop button of an editor

Any client may do so, unless the server was started with --no-stop (no_stop of fs_server_options). `forceserver resume lab` lets the force return.)";

const char* const resume_help = R"(examples:
  forceserver resume lab
      the force at the server called lab returns, if a client has ended it (a stop button, fs_scene_stop_force)

Only the user whose server it is, and root, may do so. First make sure that nobody will be hit. The force ramps up. A fault
that has stopped the force is cleared, too; if its cause is still there, it stops the force again.)";

const char* const check_help = R"(examples:
  forceserver check room.json
  forceserver check part.stl --scale 0.001
      a mesh whose file is in millimetres

Describes the file and reports what is odd in it: holes, triangles without area, objects that nobody can feel or reach,
numbers that look like millimetres, forces that jump in space or time, slopes steeper than a servo renders on the device
(--device), forces of points and planes that pull from everywhere or drive the hand deeper. Ends with 0 when nothing is
odd, 1 when something is, 2 when the file cannot be read.)";

const char* const evaluate_help = R"(examples:
  forceserver evaluate room.json points.csv > forces.csv
  echo 0 0 -0.06 | forceserver evaluate room.json --object floor
  seq 0 0.001 0.1 | sed 's/^/0 0 /' | forceserver evaluate room.json --time 2.5

Input: one position per line, "x y z" or "x,y,z" in metres of the scene; '#' begins a comment; the first line may be a
header. Output: x,y,z,fx,fy,fz in full precision, so that the same input gives the same file. These are the forces of
the scene alone, without a device and without protections.)";

const char* const devices_help = R"(examples:
  forceserver devices
  forceserver devices --why
      also each driver and where it is from, or why it cannot be used, and the haptic devices on the USB bus, whether
      or not there is a driver for them and this user may open them
  forceserver devices --json
      one JSON document, in SI units, with the names of fs_device_info

The command opens each device for a moment, to ask for its properties. "sim:" takes options; their defaults are in
parentheses:

  sim:?hand=nominal|firm|light|released|worst
                                          who holds it (nominal). kg, N s/m, N/m: nominal 0.554, 6.45, 135;
                                          firm 0.8, 5.5, 568; light 0.15, 3, 100; released: nobody; worst: as light,
                                          with friction=0 and delay_ms=1: what shakes, shakes here first
  sim:?hand_mass=..&hand_damping=..&hand_stiffness=..
                                          other values than those of the hand, kg, N s/m and N/m
  sim:?path=figure8|sweep|touch|FILE      how the hand wants to move (it rests). figure8: 120 mm by 60 mm about the
                                          origin in the plane z = 0, once in 4 s; sweep: along x, 100 mm each way, in
                                          5 s; touch: along z, from 60 mm above the origin to 20 mm below it and back
                                          in 2 s; FILE: lines of "t x y z", s and m
  sim:?hold=X,Y,Z                         where it wants to rest, m (0,0,0)
  sim:?mass=..&friction=..&encoder=joint|ideal&wrist=passive|active&delay_ms=..&seed=..
                                          properties of the device: mass in kg (0.3), friction in N (0.3), encoders in
                                          the joints or exact positions (joint), whether it gives torque (passive),
                                          ms from force sent to force felt (0), seed of the encoders' offsets (0)
  sim:?link=force|model&link_ms=..&link_hz=..
                                          a controller of 1 kHz at the device, behind a link (no link): it passes on
                                          the force sent, or renders local models; ms from a pose to the force that
                                          answers it (10), and how often a pose comes, Hz (100)

device.h has the ranges of all of them.)";

const char* const doctor_help = R"(examples:
  forceserver doctor > doctor.txt
      a page for a report: what is installed, what the system grants to a servo, which devices and servers there are, and how
      late a servo is on this machine for ten seconds
  forceserver doctor --seconds 1
  forceserver doctor --json
      one JSON document, in SI units

For each thing that is wrong the page says what is wrong, and the command that cures it. It changes nothing, opens no device and
joins no server. It needs no root; what this user may not see it calls not known. The page names the user, paths of
the library and the home folder, the serial numbers of haptic devices on the USB, and the servers that run on this machine, also
those of others: read it before you publish it. Ends with 0 when nothing is wrong, 1 when
something is, 2 when the page could not be made.)";

const char* const test_device_help = R"(examples:
  forceserver test-device mine:0 --driver ./libmine.so > page.md
      without force: the properties that the driver tells of, the rate, intervals and age of its states, how long each
      call takes, a servo that sends 0, the delay that the driver measures, and opening and closing again and again
  forceserver test-device mine:0 --driver ./libmine.so --push 1
      also pushes with 1 N along each axis, for 0.3 s each, and looks where the handle goes: hold it loosely
  forceserver test-device falcon:0 --request home --push 1
      a device that must be homed first: it waits until you have done what the driver says

The output is a page for whoever makes the device or its driver. Each verdict is passed, odd or FAILED. A machine that is
busy with other things makes states late: try it again on a quiet one. Unplug the device meanwhile to see what is then
told. Not tested is what only the device itself knows: whether its force ends within 20 ms when this process is killed.
Ends with 1 if anything is odd or failed, with 2 if the device cannot be opened or is lost.)";

const char* const hello_device_help = R"(examples:
  forceserver hello-device mine:0 --driver ./libmine.so
      three minutes with a device that nobody has felt yet, with 1 N at most
  forceserver hello-device falcon:0 --request home --force 0.5 --report first.md
      a device that must be homed first: it waits until you have done what the driver says

You are asked to move the handle, to press the buttons, and to say which way the device pushes; then you feel a soft ball, and
stop it. Answer with a letter and Enter; s skips a step, Ctrl-D gives up, and Ctrl-C ends it at any moment with force 0. A push
ends after 3 s, the ball after 60 s. It finds axes that are exchanged, and wrong signs and scales, and says what the likely
cause is. The report is printed and written to a new file. Ends with 1 if anything is odd or failed, with 2 if the device
cannot be opened.)";

const char* const calibrate_help = R"(examples:
  forceserver calibrate fidel:usb
      the FIDEL on the USB; device/fidel/README.md tells what is needed for it

The driver of the device says step by step what to do, and keeps the result for this device. A step that failed, such as
when the hand moved, is done again. Ends with 1 when you give up; then what was known before stays.)";

const char* const request_help = R"(examples:
  forceserver request fidel:usb status
  forceserver request fidel:usb clear
  forceserver request falcon:0 lights=green

The requests of a device are on the page of its driver. The answer is printed, and the device is
closed. What counts only while it is open, such as "home" of a device whose encoders count from where
they are when it is opened, is for `test-device --request` and `hello-device --request`.)";

// The usage line of the help. To CLI11 every word is optional, since need() asks for it in a better sentence.
class Usage : public CLI::Formatter {
 public:
  std::string make_usage(const CLI::App* app, std::string name) const override {
    std::string text = CLI::Formatter::make_usage(app, std::move(name));
    for (std::string word : {"server", "file", "device", "request", app->get_name() == "evaluate" ? "scene" : "file"}) {
      const std::size_t at = text.find("[" + word + "]");
      if (at != text.npos) text.replace(at, word.size() + 2, word);
    }
    return text;
  }
};

// The check of an option. A comparison with NaN is false, so is_within refuses it.
template <class IsWithin>
CLI::Validator number(const std::string& bound, IsWithin is_within) {
  const auto check = [=](const std::string& text) {
    double value = 0;
    return CLI::detail::lexical_cast(text, value) && is_within(value) ? "" : text + " is not a number " + bound;
  };
  return {check, ""};
}
CLI::Validator number_within(double least, double most) {
  char bound[64];
  std::snprintf(bound, sizeof bound, "from %g to %g", least, most);
  return number(bound, [=](double value) { return value >= least && value <= most; });
}

void need(const std::string& value, const char* sentence) {
  if (value.empty()) throw std::runtime_error(sentence);
}

}  // namespace

int main(int argc, char** argv) {
  const CLI::Validator above_zero = number("above 0", [](double value) { return value > 0; });
  const CLI::Validator not_negative = number("of 0 or more", [](double value) { return value >= 0; });
  CLI::App app("Describe what should be felt; a servo renders it at 1 kHz and more.", "forceserver");
  app.formatter(std::make_shared<Usage>());
  app.set_version_flag("--version", std::string("forceserver ") + fs_version());
  app.require_subcommand(1);
  app.footer(
      "Each command has its own help with examples: forceserver run --help\n"
      "Exit status: 0 all is well; 1 something is odd or wrong (check, doctor, test-device, hello-device), a fault\n"
      "happened or the hand chattered (run), the server has gone (clients, watch, stop, resume) or you have given up\n"
      "(calibrate); 2 the command failed");

  RunOptions run_options;
  CLI::App* run_command = app.add_subcommand("run", "Run a scene on a device");
  auto run_option = [&](const char* name, auto& value, const char* type, const char* help) {
    return run_command->add_option(name, value, help)->type_name(type);
  };
  run_option("scene", run_options.scene, "", "The scene, a .json file; without it nothing is felt");
  run_option("--device", run_options.device, "URI", "The device; see `forceserver devices`")->capture_default_str();
  const char* const driver_help = "First load this shared library with a device driver (driver.h)";
  run_option("--driver", run_options.driver, "FILE", driver_help);
  run_option("--duration", run_options.duration, "SECONDS", "How long to run; without it until Ctrl-C")->check(above_zero);
  run_option("--rate", run_options.rate, "HZ", "Ticks a second, 100 to 20000; without it the rate of the device")
      ->check(above_zero);
  run_option("--force-limit", run_options.force_limit, "N", "The largest force to send; without it the device's")
      ->check(above_zero);
  run_option("--record", run_options.record, "FILE", "Write every tick to this .csv file");
  CLI::Option* listen =
      run_option("--listen", run_options.listen, "NAME", "Let other programs connect; NAME lab is the endpoint shm:lab")
          ->check([](const std::string& name) { return name.empty() ? "its name is empty" : std::string(); });
  run_option("--client-force", run_options.client_force, "N", "The largest force of a client; without it the servo's")
      ->check(above_zero)
      ->needs(listen);
  run_option("--max-clients", run_options.max_clients, "N", "How many clients there may be; without it 32")
      ->check(CLI::Range(1u, 4096u).description(""))
      ->needs(listen);
  run_option("--max-objects", run_options.max_objects, "N", "How many objects a client may have; without it 4096")
      ->check(CLI::Range(1u, 65536u).description(""))
      ->needs(listen);
  run_command->add_flag("--locked", run_options.locked, "Each client may change its own objects only")->needs(listen);
  run_command->add_flag("--no-stop", run_options.no_stop, "No client may end the force")->needs(listen);
  run_command->add_flag("--all-users", run_options.all_users, "Also let in programs of other users of this machine")
      ->needs(listen);
  run_command->footer(run_help);

  const char* const server_help = "The server: NAME for shm:NAME, or an endpoint in full";
  ClientsOptions clients_options;
  CLI::App* clients_command = app.add_subcommand("clients", "List who is connected to a server");
  clients_command->add_option("server", clients_options.server, server_help)->type_name("");
  clients_command->add_flag("--json", clients_options.json, "One JSON document");
  clients_command->footer(clients_help);

  WatchOptions watch_options;
  CLI::App* watch_command = app.add_subcommand("watch", "Watch a server: the hand, the clients, what is felt");
  watch_command->add_option("server", watch_options.server, server_help)->type_name("");
  watch_command->add_option("--interval", watch_options.interval, "The time between two looks")
      ->type_name("SECONDS")
      ->check(number_within(0.01, 86400))
      ->capture_default_str();
  watch_command->add_option("--count", watch_options.count, "The number of looks; without it until Ctrl-C")
      ->type_name("N")
      ->check(CLI::Range(1u, 1000000000u).description(""));
  watch_command->add_flag("--json", watch_options.json, "Print each look as a JSON object on one line");
  watch_command->footer(watch_help);

  std::string stopped;
  CLI::App* stop_command = app.add_subcommand("stop", "End the force of a server at once");
  stop_command->add_option("server", stopped, server_help)->type_name("");
  stop_command->footer(stop_help);

  std::string resumed;
  CLI::App* resume_command = app.add_subcommand("resume", "Let the force of a server return after a client has stopped it");
  resume_command->add_option("server", resumed, server_help)->type_name("");
  resume_command->footer(resume_help);

  CheckOptions check_options;
  CLI::App* check_command = app.add_subcommand("check", "Describe a scene or mesh and report what is odd in it");
  check_command->add_option("file", check_options.file, "A scene (.json) or a mesh (.obj .ply .stl .off)")->type_name("");
  check_command->add_option("--scale", check_options.scale, "For a mesh: metres per unit of the file")
      ->type_name("M")
      ->check(above_zero)
      ->capture_default_str();
  check_command->add_option("--device", check_options.device, "For a scene: the device on which it will run")
      ->type_name("URI")
      ->capture_default_str();
  check_command->add_option("--driver", check_options.driver, driver_help)->type_name("FILE");
  check_command->footer(check_help);

  EvaluateOptions evaluate_options;
  CLI::App* evaluate_command = app.add_subcommand("evaluate", "The forces of a scene at given positions");
  evaluate_command->add_option("scene", evaluate_options.scene, "The scene, a .json file")->type_name("");
  evaluate_command->add_option("positions", evaluate_options.input, "A file of positions; - is the standard input")
      ->type_name("")
      ->capture_default_str();
  evaluate_command->add_option("--object", evaluate_options.object, "Only the forces of this object; without it of all")
      ->type_name("NAME");
  evaluate_command->add_option("--time", evaluate_options.time, "The time since the scene began")
      ->type_name("SECONDS")
      ->check(not_negative)
      ->capture_default_str();
  evaluate_command->footer(evaluate_help);

  CalibrateOptions calibrate_options;
  CLI::App* calibrate_command = app.add_subcommand("calibrate", "Calibrate a device, step by step");
  calibrate_command->add_option("device", calibrate_options.device, "The device; see `forceserver devices`")->type_name("");
  calibrate_command->add_option("--driver", calibrate_options.driver, driver_help)->type_name("FILE");
  calibrate_command->footer(calibrate_help);

  RequestOptions request_options;
  CLI::App* request_command = app.add_subcommand("request", "Send a request to a device, such as status, and print its answer");
  request_command->add_option("device", request_options.device, "The device; see `forceserver devices`")->type_name("");
  request_command->add_option("request", request_options.request, "What the device is asked for")->type_name("");
  request_command->add_option("--driver", request_options.driver, driver_help)->type_name("FILE");
  request_command->footer(request_help);

  DevicesOptions devices_options;
  CLI::App* devices_command = app.add_subcommand("devices", "List the devices that can be opened, and what they are");
  devices_command->add_flag("--why", devices_options.why,
                            "Also each driver, and the haptic devices on the USB bus, with what stands in the way");
  devices_command->add_flag("--json", devices_options.json, "One JSON document");
  devices_command->add_option("--driver", devices_options.driver, driver_help)->type_name("FILE");
  devices_command->footer(devices_help);

  DoctorOptions doctor_options;
  CLI::App* doctor_command =
      app.add_subcommand("doctor", "What is wrong on this machine, and what cures it: a page for a report");
  doctor_command->add_option("--seconds", doctor_options.seconds, "How long the lateness of a servo is measured")
      ->type_name("SECONDS")
      ->check(number_within(0.1, 10))
      ->capture_default_str();
  doctor_command->add_flag("--json", doctor_options.json, "One JSON document");
  doctor_command->footer(doctor_help);

  TestDeviceOptions test_options;
  CLI::App* test_command = app.add_subcommand("test-device", "Test a device and its driver, for whoever makes one");
  test_command->add_option("device", test_options.uri, "The device; see `forceserver devices`")->type_name("");
  test_command->add_option("--driver", test_options.driver, driver_help)->type_name("FILE");
  test_command->add_option("--push", test_options.push, "Also push with this force along each axis")
      ->type_name("N")
      ->check(above_zero);
  test_command->add_option("--seconds", test_options.seconds, "How long each measurement takes")
      ->type_name("SECONDS")
      ->check(number_within(0.5, 3600))
      ->capture_default_str();
  const char* const request_first_help = "First send this to the driver, such as home";
  test_command->add_option("--request", test_options.requests, request_first_help)->type_name("TEXT")->expected(1)->take_all();
  const char* const wait_help = "How long the device may then take until it is ready";
  test_command->add_option("--wait", test_options.wait, wait_help)
      ->type_name("SECONDS")
      ->check(not_negative)
      ->capture_default_str();
  test_command->footer(test_device_help);

  HelloDeviceOptions hello_options;
  CLI::App* hello_command = app.add_subcommand("hello-device", "Feel a new device for the first time, step by step");
  hello_command->add_option("device", hello_options.uri, "The device; see `forceserver devices`")->type_name("");
  hello_command->add_option("--driver", hello_options.driver, driver_help)->type_name("FILE");
  hello_command->add_option("--force", hello_options.force, "The largest force, 0.1 to 3; without it 1, or what the device has")
      ->type_name("N")
      ->check(number_within(0.1, 3));
  hello_command->add_option("--report", hello_options.report, "A new file for the report; without it hello-SCHEME-SERIAL.md")
      ->type_name("FILE");
  hello_command->add_option("--request", hello_options.requests, request_first_help)->type_name("TEXT")->expected(1)->take_all();
  hello_command->add_option("--wait", hello_options.wait, wait_help)
      ->type_name("SECONDS")
      ->check(not_negative)
      ->capture_default_str();
  hello_command->footer(hello_device_help);

  try {
    const bool is_for_shell = argc > 1 && argv[1] == std::string_view("--complete");  // see completion.bash
    if (is_for_shell) return complete(app, {argv + 2, argv + argc});
    refuse_options_as_values(app);
    require_command(app, argc, argv);
    app.parse(argc, argv);
    if (*run_command) return run(run_options);
    if (*clients_command) {
      need(clients_options.server, "clients needs a server, such as: forceserver clients lab");
      return clients(clients_options);
    }
    if (*watch_command) {
      need(watch_options.server, "watch needs a server, such as: forceserver watch lab");
      return watch(watch_options);
    }
    if (*stop_command) {
      need(stopped, "stop needs a server, such as: forceserver stop lab");
      return stop(stopped);
    }
    if (*resume_command) {
      need(resumed, "resume needs a server, such as: forceserver resume lab");
      return resume(resumed);
    }
    if (*check_command) {
      need(check_options.file, "check needs a file, such as: forceserver check room.json");
      return check(check_options);
    }
    if (*evaluate_command) {
      need(evaluate_options.scene, "evaluate needs a scene, such as: forceserver evaluate room.json points.csv");
      return evaluate(evaluate_options);
    }
    if (*devices_command) return devices(devices_options);
    if (*doctor_command) return doctor(doctor_options);
    if (*test_command) {
      need(test_options.uri, "test-device needs a device, such as: forceserver test-device sim:");
      return test_device(test_options);
    }
    if (*hello_command) {
      need(hello_options.uri, "hello-device needs a device, such as: forceserver hello-device sim:");
      return hello_device(hello_options);
    }
    if (*calibrate_command) {
      need(calibrate_options.device, "calibrate needs a device, such as: forceserver calibrate fidel:usb");
      return calibrate(calibrate_options);
    }
    if (*request_command) {
      need(request_options.device, "request needs a device, such as: forceserver request fidel:usb status");
      need(request_options.request, "request needs a request, such as: forceserver request fidel:usb status");
      return request(request_options);
    }
  } catch (const CLI::Success& wanted) {  // --help, --version
    return app.exit(wanted);
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "forceserver: %s\n", explain(app, error).c_str());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "forceserver: %s\n", error.what());
  }
  return exit_failed;
}
