// A network that is as bad as a test wants it: carries Ethernet frames between interfaces of this network namespace, one for
// each site, as a switch does, and delays, loses and reorders some on their way. For namespaces.sh.
//
//   net_relay SOCKET SEED INTERFACE...     until it is told `end`, or what started it ends
//   net_relay --tell SOCKET [COMMAND]...   tells it commands and prints its answers; waits up to 10 s until it is there
//   net_relay --checksums INTERFACE        makes the system put checksums into what it sends there: a veth would leave them
//                                          out, and frames that come by another way would be dropped
//
// The SOCKET is a file (SOCK_SEQPACKET). A packet has one command or more, each in a line, and is answered by one packet: "ok",
// what was asked, or "error: ...". The sites are 1, 2, .. in the order of their interfaces. Where WAYS is left out, a command
// is for all ways; "2" are the ways from and to site 2, "1-2" those between 1 and 2, "1>2" the way from 1 to 2.
//
//   delay S [WAYS]    jitter S [WAYS]    a frame takes from delay to delay + jitter. Frames of a way keep their order, so where
//                                        many come within the jitter, most take nearly all of it. A delay that is set anew
//                                        lets frames overtake those that are on their way
//   loss P [WAYS]                        the chance that a frame is lost. ARP never is: it would only cost a second
//   reorder P [WAYS]    late S [WAYS]    the chance that a frame comes `late` (0.005) after its turn, behind what followed it
//   cut [WAYS]    heal [WAYS]            nothing passes, nor what is on its way already. A site that was cut off by itself
//                                        ("2") is healed by itself; "heal" alone heals all
//   seed N                               what is random starts anew. Each way has its own: the same frame has the same fate
//   counts    clear                      asks for the counts since the start, or since clear
//   end
//
// The counts, in lines: "site A sent FRAMES BYTES got FRAMES BYTES" of what left and reached a site, where a frame to many
// counts once; and "way A B carried FRAMES BYTES lost FRAMES". BYTES are those of the frames without preamble and check sum.
#include <arpa/inet.h>
#include <linux/ethtool.h>
#include <linux/if_packet.h>
#include <linux/sockios.h>
#include <net/ethernet.h>
#include <net/if.h>
#include <poll.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <memory>
#include <queue>
#include <sstream>
#include <string>
#include <vector>

#include "scenes/random.h"

namespace {

using Bytes = std::vector<unsigned char>;
using Address = std::array<unsigned char, 6>;

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

[[noreturn]] void fail(const char* what) {
  std::perror(what);
  std::exit(1);
}

void give_checksums(const char* name) {
  const int any = socket(AF_INET, SOCK_DGRAM, 0);
  ethtool_value off{ETHTOOL_STXCSUM, 0};
  ifreq request{};
  std::strncpy(request.ifr_name, name, sizeof request.ifr_name - 1);
  request.ifr_data = reinterpret_cast<char*>(&off);
  if (ioctl(any, SIOCETHTOOL, &request) != 0) fail(name);
  close(any);
}

int open_interface(const char* name) {
  const int out = socket(AF_PACKET, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);  // 0: nothing until it is bound
  const int yes = 1, room = 8 << 20;
  setsockopt(out, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
  setsockopt(out, SOL_SOCKET, SO_SNDBUF, &room, sizeof room);
  setsockopt(out, SOL_SOCKET, SO_RCVBUFFORCE, &room, sizeof room);
  sockaddr_ll address{};
  address.sll_family = AF_PACKET;
  address.sll_protocol = htons(ETH_P_ALL);
  address.sll_ifindex = static_cast<int>(if_nametoindex(name));
  if (out < 0 || setsockopt(out, SOL_PACKET, PACKET_IGNORE_OUTGOING, &yes, sizeof yes) != 0 || address.sll_ifindex == 0 ||
      bind(out, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
    fail(name);
  }
  return out;
}

sockaddr_un place_of(const char* path) {
  sockaddr_un out{};
  out.sun_family = AF_UNIX;
  if (std::strlen(path) >= sizeof out.sun_path) {
    std::fprintf(stderr, "net_relay: this name of a socket is too long: %s\n", path);
    std::exit(1);
  }
  std::strcpy(out.sun_path, path);
  return out;
}

int tell(const char* path, int count, char** commands) {
  const sockaddr_un place = place_of(path);
  const int relay = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  for (const double start = now_s(); connect(relay, reinterpret_cast<const sockaddr*>(&place), sizeof place) != 0;) {
    if (now_s() - start > 10) fail(path);
    usleep(5000);
  }
  bool is_good = true;
  std::vector<char> answer(1 << 17);
  for (int i = 0; i < count; ++i) {
    const std::string line = commands[i] + std::string("\n");  // a packet without a byte would be an end
    if (send(relay, line.data(), line.size(), MSG_NOSIGNAL) < 0) fail(path);
    const ssize_t size = recv(relay, answer.data(), answer.size(), 0);
    if (size <= 0) return line == "end\n" ? 0 : 1;
    const std::string text(answer.data(), static_cast<size_t>(size));
    if (text != "ok\n") std::fputs(text.c_str(), stdout);
    is_good &= text.rfind("error:", 0) != 0;
  }
  return is_good ? 0 : 1;
}

struct Count {
  uint64_t frames = 0, bytes = 0;
  void add(size_t size) { ++frames, bytes += size; }
};

struct Way {
  double delay = 0, jitter = 0, loss = 0, reorder = 0, late = 0.005;
  bool is_cut = false;
  double newest_due = 0;  // s
  scenes::Random random{0};
  Count carried;
  uint64_t lost = 0;
};

struct Site {
  explicit Site(int its_interface) : interface(its_interface) {}
  int interface;
  bool is_cut = false;
  Count sent, got;
};

struct Flying {
  double due;  // s
  uint64_t order;
  int from, to;
  std::shared_ptr<const Bytes> bytes;
  bool operator<(const Flying& other) const { return due != other.due ? due > other.due : order > other.order; }
};

class Network {
 public:
  Network(uint64_t seed, const std::vector<const char*>& interfaces) : ways_(interfaces.size() * interfaces.size()) {
    for (const char* name : interfaces) sites_.emplace_back(open_interface(name));
    start_anew(seed);
  }

  const std::vector<Site>& sites() const { return sites_; }
  double next_due() const { return flying_.empty() ? now_s() + 0.1 : flying_.top().due; }

  // Takes what has come from the site, but not so much that others would wait.
  void take_from(int from) {
    for (int i = 0; i < 64; ++i) {
      const ssize_t got = recv(sites_[from].interface, frame_.data(), frame_.size(), 0);
      if (got < ETH_HLEN) return;
      launch(from, std::make_shared<const Bytes>(frame_.begin(), frame_.begin() + got));
    }
  }

  void deliver() {
    for (const double time_now = now_s(); !flying_.empty() && flying_.top().due <= time_now; flying_.pop()) {
      const Flying& frame = flying_.top();
      Way& way = way_of(frame.from, frame.to);
      if (is_cut(frame.from, frame.to) || send(sites_[frame.to].interface, frame.bytes->data(), frame.bytes->size(), 0) < 0) {
        ++way.lost;
        continue;
      }
      way.carried.add(frame.bytes->size());
      sites_[frame.to].got.add(frame.bytes->size());
    }
  }

  // What is answered to a packet of commands; empty: it shall end.
  std::string answer(const std::string& commands) {
    std::istringstream lines(commands);
    std::string out;
    for (std::string line; std::getline(lines, line);) {
      std::istringstream words(line);
      std::vector<std::string> all;
      for (std::string word; words >> word;) all.push_back(word);
      if (all.empty()) continue;
      if (all[0] == "end") return "";
      if (all[0] == "counts" && all.size() == 1)
        out += counts();
      else if (!obey(all))
        return "error: " + line + "\n";
    }
    return out.empty() ? "ok\n" : out;
  }

 private:
  struct Ways {
    int from = -1, to = -1;  // -1: any
    bool is_both = true;
  };

  int count() const { return static_cast<int>(sites_.size()); }
  Way& way_of(int from, int to) { return ways_[static_cast<size_t>(from * count() + to)]; }
  bool is_cut(int from, int to) { return sites_[from].is_cut || sites_[to].is_cut || way_of(from, to).is_cut; }

  void start_anew(uint64_t seed) {
    scenes::Random seeds(seed);
    for (Way& way : ways_) way.random = scenes::Random(seeds.bits());
  }

  void launch(int from, const std::shared_ptr<const Bytes>& bytes) {
    Site& site = sites_[from];
    if (site.is_cut) return;
    site.sent.add(bytes->size());
    Address target, source;
    std::copy_n(bytes->begin(), 6, target.begin());
    std::copy_n(bytes->begin() + 6, 6, source.begin());
    const bool is_to_many = target[0] & 1;
    home_[source] = from;
    const auto known = home_.find(target);
    const bool may_be_lost = (*bytes)[12] != ETH_P_ARP >> 8 || (*bytes)[13] != (ETH_P_ARP & 255);
    for (int to = 0; to < count(); ++to) {
      if (to == from || (!is_to_many && known != home_.end() && known->second != to)) continue;
      Way& way = way_of(from, to);
      // The same number of random ones for each frame, so that its fate does not depend on what is set.
      const bool is_lost = way.random.coin(way.loss), is_late = way.random.coin(way.reorder);
      double due = now_s() + way.delay + way.jitter * way.random.unit_interval();
      if ((is_lost && may_be_lost) || is_cut(from, to)) {
        ++way.lost;
        continue;
      }
      due = std::max(due, way.newest_due);
      if (is_late)
        due += way.late;
      else
        way.newest_due = due;
      flying_.push({due, order_++, from, to, bytes});
    }
  }

  static bool read(const std::string& word, double& out) {
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), out);
    return error == std::errc() && end == word.data() + word.size() && out >= 0;
  }
  bool read_site(const std::string& word, int& out) const {
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), out);
    return error == std::errc() && end == word.data() + word.size() && --out >= 0 && out < count();
  }
  bool read(const std::string& word, Ways& out) const {
    const size_t at = word.find_first_of("->");
    if (at == std::string::npos) return read_site(word, out.from);
    out.is_both = word[at] == '-';
    return read_site(word.substr(0, at), out.from) && read_site(word.substr(at + 1), out.to) && out.from != out.to;
  }
  template <class F>
  void for_each(const Ways& ways, F f) {
    const auto fits = [](int is, int wanted) { return wanted < 0 || is == wanted; };
    for (int from = 0; from < count(); ++from) {
      for (int to = 0; to < count(); ++to) {
        if ((fits(from, ways.from) && fits(to, ways.to)) || (ways.is_both && fits(to, ways.from) && fits(from, ways.to)))
          f(way_of(from, to));
      }
    }
  }

  bool obey(const std::vector<std::string>& words) {
    static const std::map<std::string, double Way::*> numbers{
        {"delay", &Way::delay}, {"jitter", &Way::jitter}, {"loss", &Way::loss}, {"reorder", &Way::reorder}, {"late", &Way::late}};
    const auto number = numbers.find(words[0]);
    Ways ways;
    if (number != numbers.end()) {
      double value = 0;
      if (words.size() < 2 || words.size() > 3 || !read(words[1], value)) return false;
      if (words.size() == 3 && !read(words[2], ways)) return false;
      for_each(ways, [&](Way& way) {
        way.*number->second = value;
        if (words[0] == "delay") way.newest_due = 0;  // a shorter one holds from now on
      });
      return true;
    }
    if (words[0] == "cut" || words[0] == "heal") {
      const bool is_cut = words[0] == "cut";
      if (words.size() > 2 || (words.size() == 2 && !read(words[1], ways))) return false;
      if (ways.from >= 0 && ways.to < 0)
        sites_[ways.from].is_cut = is_cut;
      else
        for_each(ways, [&](Way& way) { way.is_cut = is_cut; });
      if (ways.from < 0 && !is_cut)
        for (Site& site : sites_) site.is_cut = false;
      return true;
    }
    if (words[0] == "seed" && words.size() == 2) {
      start_anew(std::strtoull(words[1].c_str(), nullptr, 10));
      return true;
    }
    if (words[0] == "clear" && words.size() == 1) {
      for (Way& way : ways_) way.carried = {}, way.lost = 0;
      for (Site& site : sites_) site.sent = site.got = {};
      return true;
    }
    return false;
  }

  std::string counts() {
    std::ostringstream out;
    for (int i = 0; i < count(); ++i) {
      const Site& site = sites_[i];
      out << "site " << i + 1 << " sent " << site.sent.frames << ' ' << site.sent.bytes << " got " << site.got.frames << ' '
          << site.got.bytes << '\n';
    }
    for (int from = 0; from < count(); ++from) {
      for (int to = 0; to < count(); ++to) {
        const Way& way = way_of(from, to);
        if (to == from) continue;
        out << "way " << from + 1 << ' ' << to + 1 << " carried " << way.carried.frames << ' ' << way.carried.bytes << " lost "
            << way.lost << '\n';
      }
    }
    return out.str();
  }

  std::vector<Site> sites_;
  std::vector<Way> ways_;
  std::map<Address, int> home_;  // where an address was seen last
  std::priority_queue<Flying> flying_;
  uint64_t order_ = 0;
  Bytes frame_ = Bytes(1 << 16);
};

int relay(const char* path, uint64_t seed, const std::vector<const char*>& interfaces) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  prctl(PR_SET_TIMERSLACK, 1);
  Network network(seed, interfaces);
  const int listening = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  const sockaddr_un place = place_of(path);
  if (bind(listening, reinterpret_cast<const sockaddr*>(&place), sizeof place) != 0 || listen(listening, 8) != 0) fail(path);
  std::vector<pollfd> all;
  for (const Site& site : network.sites()) all.push_back({site.interface, POLLIN, 0});
  const size_t door = all.size();
  all.push_back({listening, POLLIN, 0});
  std::vector<char> packet(1 << 16);
  for (;;) {
    const double wait = std::clamp(network.next_due() - now_s(), 0.0, 0.1);
    const timespec time{0, static_cast<long>(1e9 * wait)};
    if (ppoll(all.data(), all.size(), &time, nullptr) < 0) continue;
    for (size_t i = 0; i < door; ++i)
      if (all[i].revents) network.take_from(static_cast<int>(i));
    network.deliver();
    for (size_t i = all.size() - 1; i > door; --i) {
      if (!all[i].revents) continue;
      const ssize_t size = recv(all[i].fd, packet.data(), packet.size(), 0);
      if (size > 0) {
        const std::string said = network.answer(std::string(packet.data(), static_cast<size_t>(size)));
        if (said.empty()) return unlink(path), 0;
        send(all[i].fd, said.data(), said.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
      } else {
        close(all[i].fd);
        all.erase(all.begin() + static_cast<std::ptrdiff_t>(i));
      }
    }
    if (all[door].revents)
      if (const int talking = accept4(listening, nullptr, nullptr, SOCK_CLOEXEC); talking >= 0)
        all.push_back({talking, POLLIN, 0});
  }
}

}  // namespace

int main(int count, char** arguments) {
  if (count == 3 && std::strcmp(arguments[1], "--checksums") == 0) return give_checksums(arguments[2]), 0;
  if (count > 2 && std::strcmp(arguments[1], "--tell") == 0) return tell(arguments[2], count - 3, arguments + 3);
  if (count < 4) return 2;
  return relay(arguments[1], std::strtoull(arguments[2], nullptr, 10), {arguments + 3, arguments + count});
}
