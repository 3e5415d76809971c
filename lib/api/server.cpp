#include <forceserver/server.h>

#include "api/guarded.h"
#include "scene/object.h"

using namespace fs;

fs_status fs_server_start(fs_servo* servo, const char* endpoint, const fs_server_options* options, fs_server** out) {
  return guarded([&] {
    require_pointer(servo, "servo");
    require_pointer(endpoint, "endpoint");
    require_pointer(out, "out");
    if (options) check_struct_size(options->struct_size, sizeof *options, "fs_server_options");
    fail(FS_ERROR_UNSUPPORTED, "endpoint is '%.80s': servers are not in version %s of this library", endpoint,
         fs_version());
  });
}

void fs_server_stop(fs_server*) {}  // there is none to stop
