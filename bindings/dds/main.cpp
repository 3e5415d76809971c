// forceserver-bridge: joins the force-servers of several machines over DDS.
#include <signal.h>

#include <atomic>
#include <cmath>
#include <cstdio>

#include <CLI/CLI.hpp>

#include "bridge.h"

namespace {

std::atomic<bool> is_ending{false};

void end(int) { is_ending = true; }

void end_on_signals() {
  struct sigaction action{};
  action.sa_handler = end;
  for (const int signal : {SIGINT, SIGTERM}) sigaction(signal, &action, nullptr);
  struct sigaction hang_up{};
  sigaction(SIGHUP, nullptr, &hang_up);
  if (hang_up.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);  // under nohup it stays ignored
  signal(SIGPIPE, SIG_IGN);
}

const char* const help = R"(examples:
  forceserver run --device fidel:usb --listen lab
  forceserver-bridge lab --room mars --site lab --interface eth0 --security keys/lab
      the objects of the clients of the server `lab` are felt at the other sites of the room, and theirs are felt here
  forceserver-bridge --listen desk --mirror lab --room mars --site desk --interface eth0 --security keys/desk
      a machine without a device: a server that shows the hand of site lab; other programs connect to shm:desk
  forceserver-bridge lab --site a
      the sites of this machine alone, in the room "main"

Applications connect to the server of their own machine, as if there were no other. A client of another site is called
CLIENT@SITE here. bindings/dds/README.md has the rest.

Ends with 0 on Ctrl-C, and with 2 if it could not be done.)";

// "SITE=SCALE" or "SITE=SCALE,X,Y,Z": metres of that site's device per metre of ours, and where its centre is here, m.
std::pair<std::string, fs_frame> parse_frame(const std::string& text) {
  const size_t equals = text.find('=');
  fs_frame frame = fs_frame_init();
  fs_vec3& p = frame.pose.position;
  int end = 0;
  const char* const numbers = equals == std::string::npos ? "" : text.c_str() + equals + 1;
  const int count = std::sscanf(numbers, "%lf%n,%lf,%lf,%lf%n", &frame.scale, &end, &p.x, &p.y, &p.z, &end);
  const bool is_whole = (count == 1 || count == 4) && numbers[end] == '\0' && std::isfinite(frame.scale + p.x + p.y + p.z);
  if (!is_whole || !(frame.scale > 0) || !bridge::is_site_name(text.substr(0, equals))) {
    throw CLI::ValidationError("--frame", "is '" + text + "', must be SITE=SCALE or SITE=SCALE,X,Y,Z, such as lab=2");
  }
  return {text.substr(0, equals), frame};
}

std::string full_endpoint(const std::string& name) { return name.find(':') == std::string::npos ? "shm:" + name : name; }

int run(int argc, char** argv) {
  CLI::App app("Joins the force-servers of several machines: what clients of one have is felt at all of them.",
               "forceserver-bridge");
  app.footer(help);
  app.set_version_flag("--version", std::string("forceserver-bridge ") + fs_version());
  bridge::Options options;
  bridge::Participant::Settings& network = options.network;
  std::string server, listen;
  std::vector<std::string> frames, follow;
  bool is_open = false;
  network.network = "lo";
  network.partition = "main";
  app.add_option("SERVER", server, "the server of this machine: NAME, or an endpoint such as shm:NAME");
  app.add_option("--site", options.site, "the name of this site in the room: 1 to 20 of a-z 0-9 _ . -")->required();
  app.add_option("--room", network.partition, "the room that sites share")->capture_default_str();
  app.add_option("--interface", network.network, "the network interface, such as eth0")->capture_default_str();
  app.add_option("--peer", network.peers, "the address of a machine that multicast does not reach; may be repeated");
  app.add_option("--domain", network.domain, "the domain of DDS; with --security at most 230")
      ->check(CLI::Range(0, 232))
      ->capture_default_str();
  app.add_option("--security", network.security, "a folder with the keys of this site (make-keys)");
  app.add_flag("--open", is_open, "no keys on a network: then anyone there can push the hand");
  app.add_option("--lease", network.lease, "seconds after which a site that says nothing is lost, and its objects fade")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  app.add_option("--hand-rate", options.hand_rate, "Hz, how often the hand is told")
      ->check(CLI::Range(1.0, 1000.0))
      ->capture_default_str();
  app.add_option("--frame", frames,
                 "SITE=SCALE[,X,Y,Z]: metres of that site's device per metre of this one, and where its centre is here; by "
                 "default workspaces are made to fit; may be repeated");
  app.add_option("--mirror", options.mirrors, "runs a server without a device, which shows the hand of this site");
  app.add_option("--listen", listen, "with --mirror: the name of that server");
  app.add_option("--client-force", options.client_force, "with --mirror: N, the limit of each client and of each other site")
      ->check(CLI::NonNegativeNumber);
  app.add_flag("--no-stop", options.no_stop, "with --mirror: a client cannot end the force");
  app.add_flag("--ros", options.ros, "writes the hand as topics of ROS 2, /forceserver/SITE/pose and others");
  app.add_option(
      "--follow", follow,
      "OBJECT=/TOPIC or CLIENT/OBJECT=/TOPIC: the object goes where a PoseStamped of ROS 2 says; without a client it is one of the server's own scene; may be repeated");
  try {
    app.parse(argc, argv);
    if (!bridge::is_site_name(options.site))
      throw CLI::ValidationError("--site", "is '" + options.site + "', must be 1 to 20 of a-z 0-9 _ . -");
    // '*' and '?' would be all rooms.
    const bool is_room =
        !network.partition.empty() && network.partition.size() <= 63 &&
        network.partition.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.-") ==
            std::string::npos;
    if (!is_room) throw CLI::ValidationError("--room", "is '" + network.partition + "', must be 1 to 63 of a-z A-Z 0-9 _ . -");
    if (options.mirrors.empty() == server.empty())
      throw CLI::ValidationError("SERVER", "give either the server of this machine, or --listen and --mirror");
    if (options.mirrors.empty() != listen.empty())
      throw CLI::ValidationError("--listen", "belongs to --mirror, and --mirror needs it");
    if (!options.mirrors.empty() && (!bridge::is_site_name(options.mirrors) || options.mirrors == options.site)) {
      throw CLI::ValidationError("--mirror", "is '" + options.mirrors + "', must be the name of another site");
    }
    if (options.mirrors.empty() && (options.client_force > 0 || options.no_stop))
      throw CLI::ValidationError("--client-force, --no-stop", "belong to --mirror; otherwise give them to `forceserver run`");
    if (!options.mirrors.empty() && options.ros) throw CLI::ValidationError("--ros", "belongs to the site whose hand it is");
    if (network.network != "lo" && network.security.empty() && !is_open) {
      throw CLI::ValidationError("--interface",
                                 "on a network anyone could push the hand: give --security, or --open if that is what you want");
    }
    if (!network.security.empty() && network.domain > 230)
      throw CLI::ValidationError("--domain", "must be at most 230 with --security");
    if (is_open && !network.security.empty()) throw CLI::ValidationError("--open", "and --security exclude each other");
    for (const std::string& frame : frames) options.frames.insert(parse_frame(frame));
    for (const std::string& each : follow) {
      const size_t equals = each.find('=');
      if (equals == 0 || equals == std::string::npos || each.find("=/") != equals) {
        throw CLI::ValidationError("--follow", "is '" + each + "', must be OBJECT=/TOPIC or CLIENT/OBJECT=/TOPIC");
      }
      const std::string object = each.substr(0, equals);
      options.follow[object.find('/') == std::string::npos ? "server/" + object : object] = each.substr(equals + 1);
    }
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  options.endpoint = full_endpoint(options.mirrors.empty() ? server : listen);
  end_on_signals();
  bridge::Bridge bridge(options);
  return bridge.run(is_ending);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "forceserver-bridge: %s\n", error.what());
    return 2;
  }
}
