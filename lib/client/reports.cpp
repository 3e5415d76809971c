#include "client/reports.h"

#include "base/enum.h"
#include "base/error.h"
#include "base/text.h"
#include "scene/moment.h"

namespace fs {

// ours: of the replica. theirs: of the server; null: it does not know the object.
fs_report Reports::in_group(const fs_report& ours, const fs_report* theirs) const {
  if (!theirs) return ours;
  fs_report out = *theirs;
  out.primitive = ours.primitive;
  out.stiffness_wanted = ours.stiffness_wanted;
  out.stiffness_applied = ours.stiffness_applied;
  fs_object object;
  replica_.scene->get(ours.name, object);
  const int32_t state = raw_value(out.state);
  if (state == FS_OBJECT_REFUSED) return out;
  if (out.weight > 0) {
    out.state = out.weight < 1 ? FS_OBJECT_FADING : FS_OBJECT_FELT;
  } else if (!object.enabled) {
    out.state = FS_OBJECT_DISABLED;
  } else if (state != FS_OBJECT_PENDING) {
    out.state = FS_OBJECT_FADING;
  }
  return out;
}

fs_report Reports::of_foreign(Call& call, const char* name) {
  return line_.request(call, wire::type_report, to_target(name, "name")).as<fs_report>();
}

fs_report Reports::of_own(Call& call, const char* name) {
  pulls_.catch_up(call, name);
  const fs_report ours = replica_.scene->report(name);
  try {
    const fs_report theirs = of_foreign(call, name);
    return groups_.mine() ? in_group(ours, &theirs) : theirs;
  } catch (const Error& error) {
    if (!groups_.mine() || error.status != FS_ERROR_NOT_FOUND) throw;
    return in_group(ours, nullptr);
  }
}

std::vector<fs_report> Reports::of_all(Call& call) {
  pulls_.catch_up(call, "");
  std::vector<fs_report> out = line_.request(call, wire::type_reports).list<fs_report>();
  if (!groups_.mine()) return out;
  NameMap<fs_report> theirs;  // of own objects; names of others have a '/'
  std::erase_if(out, [&](const fs_report& report) {
    const std::string name = text_of(report.name);
    const bool is_own = name.find('/') == std::string::npos;
    if (is_own) theirs[name] = report;
    return is_own;
  });
  std::vector<fs_report> own = replica_.scene->reports();
  for (fs_report& report : own) {
    const auto found = theirs.find(text_of(report.name));
    report = in_group(report, found == theirs.end() ? nullptr : &found->second);
  }
  out.insert(out.begin(), own.begin(), own.end());
  return out;
}

std::vector<fs_motion> Reports::own_motions(Call& call) {
  pulls_.catch_up(call);
  replica_.catch_up_with_moves();
  return replica_.scene->motions(nullptr);
}

std::vector<fs_motion> Reports::own_motions_since(Call& call, uint64_t since) {
  pulls_.catch_up(call);
  replica_.catch_up_with_moves();
  return replica_.scene->motions_since(nullptr, since);
}

static wire::Target to_client(const char* name) {
  if (!*name) fail(FS_ERROR_NOT_FOUND, "client is '': no client of that name is connected");
  return to_target(name, "client");
}

std::vector<fs_motion> Reports::foreign_motions(Call& call, const char* client) {
  return line_.request(call, wire::type_motions, to_client(client)).list<fs_motion>();
}

std::vector<fs_motion> Reports::foreign_motions_since(Call& call, const char* client, uint64_t since) {
  const wire::Since wanted{client ? to_client(client) : wire::Target{}, since};
  std::vector<fs_motion> out = line_.request(call, wire::type_motions_since, wanted).list<fs_motion>();
  sort_by_revision(out);
  return out;
}

// The request may wait, so it comes first: own objects are looked at without giving the lock back.
std::vector<fs_motion> Reports::all_motions(Call& call) {
  const auto others = line_.request(call, wire::type_motions, wire::Target{}).list<fs_motion>();
  std::vector<fs_motion> out = own_motions(call);
  out.insert(out.end(), others.begin(), others.end());
  return out;
}

}  // namespace fs
