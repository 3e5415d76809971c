// Between the structs of the C headers and the samples of the room.
#pragma once

#include <cstring>
#include <string>
#include <string_view>

#include <forceserver/forceserver.hpp>

#include "forceserver.h"

namespace bridge {

// A text of a sample: always ends, whatever the other side wrote.
template <size_t size>
std::string text_of(const char (&text)[size]) {
  return std::string(text, strnlen(text, size));
}
// Puts a text into a sample, cut where there is no room.
template <size_t size>
void put_text(char (&out)[size], std::string_view text) {
  out[text.copy(out, size - 1)] = '\0';
}

bool is_site_name(std::string_view name);

// The name of another site's client at this server: "client@site". Where that is too long the client's part is cut, and has a hash.
std::string name_at_site(const std::string& client, const std::string& site);
// "client/object" in its two parts; false: there is no '/'.
bool split_name(std::string_view name, std::string& client, std::string& object);

forceserver_Vec3 to_sample(const fs_vec3& v);
forceserver_Pose to_sample(const fs_pose& pose);
forceserver_Twist to_sample(const fs_twist& twist);
fs_vec3 to_c(const forceserver_Vec3& v);
fs_pose to_c(const forceserver_Pose& pose);
fs_twist to_c(const forceserver_Twist& twist);

// What an object is, but for its keys (site, client, name), its numbers, and the keys of its contents.
void put_object(forceserver_ForceObject& out, const fs_object& object);
// The other way: without handles, and with the times of the sample.
fs_object to_c(const forceserver_ForceObject& sample, const std::string& name);

forceserver_Moved to_moved(const forceserver_ForceObject& object);  // where it is
void put_moved(forceserver_ForceObject& out, const forceserver_Moved& moved);

void put_view(forceserver_ClientView& out, const fs_view& view);  // but for the points
fs_frame frame_of(const forceserver_ClientView& view);

// What one object adds to the digest of a site (forceserver.idl, HeldObjects).
uint64_t digest_of(const std::string& client, const std::string& name, uint64_t revision);

}  // namespace bridge
