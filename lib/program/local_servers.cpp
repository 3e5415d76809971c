#include "local_servers.h"

#include <fcntl.h>
#include <pwd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <stdexcept>

#include "words.h"

namespace {

constexpr std::string_view file_prefix = ".forceserver-";

// A listening socket of a server: its name and user, as its address says.
bool parse_address(std::string_view address, LocalServer& out) {
  constexpr std::string_view abstract = "@forceserver/";
  if (address.starts_with(abstract)) {  // "@forceserver/1000/lab" of a user, "@forceserver/lab" for all
    const std::string rest(address.substr(abstract.size()));
    const std::size_t slash = rest.find('/');
    out.name = rest.substr(slash == rest.npos ? 0 : slash + 1);
    out.for_all = slash == rest.npos;
    out.is_user_known = !out.for_all;
    if (out.is_user_known) out.user = static_cast<std::uint32_t>(std::strtoul(rest.c_str(), nullptr, 10));
    return true;
  }
  const std::string_view file = address.substr(std::min(address.size(), address.rfind('/') + 1));
  if (!file.starts_with(file_prefix)) return false;
  out.name = file.substr(file_prefix.size());
  return true;
}

// The process of each of these sockets (inodes), as far as this user may see it.
std::map<std::string, long> processes_of(const std::map<std::string, LocalServer>& sockets) {
  std::map<std::string, long> found;
  std::error_code none;
  for (const auto& process : std::filesystem::directory_iterator("/proc", none)) {
    const long number = std::strtol(process.path().filename().c_str(), nullptr, 10);
    if (number <= 0) continue;
    std::error_code denied;
    for (const auto& descriptor : std::filesystem::directory_iterator(process.path() / "fd", denied)) {
      std::error_code gone;
      const std::string target = std::filesystem::read_symlink(descriptor.path(), gone).string();
      const std::string_view prefix = "socket:[";
      if (!target.starts_with(prefix)) continue;
      const std::string inode = target.substr(prefix.size(), target.size() - prefix.size() - 1);
      if (sockets.contains(inode)) found[inode] = number;
    }
  }
  return found;
}

}  // namespace

std::vector<LocalServer> local_servers() {
  std::ifstream list("/proc/net/unix");
  if (!list) throw std::runtime_error("/proc/net/unix cannot be read");
  std::map<std::string, LocalServer> sockets;  // by inode
  for (std::string line; std::getline(list, line);) {
    unsigned long flags = 0;
    char inode[32];
    int end = 0;
    // Num RefCount Protocol Flags Type St Inode Path
    if (std::sscanf(line.c_str(), "%*s %*s %*s %lx %*s %*s %31s %n", &flags, inode, &end) < 2 || end == 0) continue;
    constexpr unsigned long listens = 0x10000;
    LocalServer server;
    if ((flags & listens) && parse_address(std::string_view(line).substr(std::size_t(end)), server)) sockets[inode] = server;
  }
  const std::map<std::string, long> processes = processes_of(sockets);
  std::vector<LocalServer> all;
  for (auto& [inode, server] : sockets) {
    const auto process = processes.find(inode);
    if (process != processes.end()) {
      const std::string folder = "/proc/" + std::to_string(process->second);
      server.process = process->second;
      struct stat info{};
      if (stat(folder.c_str(), &info) == 0) {
        server.user = info.st_uid;
        server.is_user_known = true;
      }
      std::getline(std::ifstream(folder + "/comm"), server.program);
    }
    // A server for all users listens at two sockets.
    const auto same = std::find_if(all.begin(), all.end(), [&](const LocalServer& other) {
      if (other.name != server.name || (other.for_all == server.for_all)) return false;
      return other.process == server.process && (server.process != 0 || !(other.is_user_known && server.is_user_known));
    });
    if (same == all.end()) {
      all.push_back(server);
      continue;
    }
    if (server.is_user_known) same->user = server.user;
    same->is_user_known |= server.is_user_known;
    same->for_all = true;
  }
  std::sort(all.begin(), all.end(), [](const LocalServer& a, const LocalServer& b) { return a.name < b.name; });
  return all;
}

std::vector<std::string> abandoned_sockets() {
  std::vector<std::string> all;
  const passwd* const entry = getpwuid(geteuid());
  for (const std::string& folder : {"/run/user/" + std::to_string(geteuid()), std::string(entry ? entry->pw_dir : "")}) {
    const int opened = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (opened < 0) continue;
    std::error_code none;
    for (const auto& file : std::filesystem::directory_iterator(folder, none)) {
      const std::string name = file.path().filename().string();
      std::error_code gone;
      if (!name.starts_with(file_prefix) || !file.is_socket(gone)) continue;
      sockaddr_un address{};
      address.sun_family = AF_UNIX;
      std::snprintf(address.sun_path, sizeof address.sun_path, "/proc/self/fd/%d/%s", opened, name.c_str());
      const int made = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
      const bool is_refused =
          made >= 0 && connect(made, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 && errno == ECONNREFUSED;
      if (is_refused) all.push_back(file.path().string());
      if (made >= 0) close(made);
    }
    close(opened);
  }
  return all;
}
