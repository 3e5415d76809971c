// Carries Ethernet frames between two interfaces of this network namespace and delays or loses some, as a bad network does; for
// namespaces.sh. IPv4 and ARP only.
//
//   frame_relay INTERFACE INTERFACE DELAY_MS JITTER_MS LOSS SEED    until it is ended
//   frame_relay --checksums INTERFACE    makes the system put checksums into what it sends there: a veth would leave them out, and
//                                        frames that come by another way would be dropped
#include <arpa/inet.h>
#include <linux/ethtool.h>
#include <linux/if_packet.h>
#include <linux/sockios.h>
#include <net/ethernet.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <queue>
#include <vector>

#include "scenes/random.h"

namespace {

using Bytes = std::vector<unsigned char>;

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
  const int out = socket(AF_PACKET, SOCK_RAW | SOCK_NONBLOCK, htons(ETH_P_ALL));
  sockaddr_ll address{};
  address.sll_family = AF_PACKET;
  address.sll_protocol = htons(ETH_P_ALL);
  address.sll_ifindex = static_cast<int>(if_nametoindex(name));
  if (out < 0 || bind(out, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) fail(name);
  return out;
}

struct Flying {
  double due;  // s
  uint64_t order;
  int to;
  Bytes bytes;
  bool operator<(const Flying& other) const { return due != other.due ? due > other.due : order > other.order; }
};

}  // namespace

int main(int count, char** arguments) {
  if (count == 3 && std::strcmp(arguments[1], "--checksums") == 0) return give_checksums(arguments[2]), 0;
  if (count != 7) return 2;
  const int ends[]{open_interface(arguments[1]), open_interface(arguments[2])};
  const double delay = 1e-3 * std::atof(arguments[3]), jitter = 1e-3 * std::atof(arguments[4]), loss = std::atof(arguments[5]);
  scenes::Random random(std::strtoull(arguments[6], nullptr, 10));
  std::priority_queue<Flying> flying;
  for (uint64_t order = 0;;) {
    const double wait = flying.empty() ? 0.1 : std::clamp(flying.top().due - now_s(), 0.0, 0.1);
    const timespec time{0, static_cast<long>(1e9 * wait)};
    pollfd both[]{{ends[0], POLLIN, 0}, {ends[1], POLLIN, 0}};
    ppoll(both, 2, &time, nullptr);
    for (int i = 0; i < 2; ++i) {
      for (;;) {
        Bytes bytes(2000);
        sockaddr_ll from{};
        socklen_t size = sizeof from;
        const ssize_t got = recvfrom(ends[i], bytes.data(), bytes.size(), 0, reinterpret_cast<sockaddr*>(&from), &size);
        if (got < 0) break;
        const bool is_ours = from.sll_pkttype == PACKET_OUTGOING;  // what this relay has sent
        const bool is_wanted = ntohs(from.sll_protocol) == ETH_P_IP || ntohs(from.sll_protocol) == ETH_P_ARP;
        if (is_ours || !is_wanted) continue;
        if (ntohs(from.sll_protocol) == ETH_P_IP && random.coin(loss)) continue;
        bytes.resize(static_cast<size_t>(got));
        flying.push({now_s() + delay + jitter * random.unit_interval(), order++, ends[1 - i], std::move(bytes)});
      }
    }
    for (const double time_now = now_s(); !flying.empty() && flying.top().due <= time_now; flying.pop()) {
      if (send(flying.top().to, flying.top().bytes.data(), flying.top().bytes.size(), 0) < 0) continue;  // it is lost
    }
  }
}
