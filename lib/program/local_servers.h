// The force-servers of this machine, without joining them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

struct LocalServer {
  std::string name;
  std::uint32_t user = 0;   // whose it is
  bool is_user_known = false;
  bool for_all = false;     // other users may connect
  long process = 0;         // 0: not known
  std::string program;      // of the process; "": not known
};

std::vector<LocalServer> local_servers();     // by name; throws std::runtime_error where the system does not list sockets
std::vector<std::string> abandoned_sockets();  // files of this user's servers that were killed
